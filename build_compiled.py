"""Compiles the modules in which a simulated run spends its time: `python build_compiled.py`.

The extension modules come beside their sources, where Python prefers them; without them everything
runs as it is, several times slower. Needs mypy and a C compiler.
"""

from __future__ import annotations

import ast
import os
import shutil
import sys
from pathlib import Path

ROOT = Path(__file__).parent
PACKAGE = "diffbotctl"
BUILD = ROOT / "build" / "compiled"
FOLDERS = ("control", "estimation", "plant")
FURTHER = ("engine/overspeed.py", "geometry/footprint.py")
# Not worth it, or with class attributes, which the compiler does not take.
LEFT_OUT = frozenset(
    {
        "estimation/commanded_wheel.py",
        "plant/collision.py",
        "plant/components.py",
        "plant/faults.py",
        "plant/gyro.py",
        "plant/imu_mounting.py",
        "plant/robot_parameters.py",
        "plant/wiring.py",
    }
)
# Classes that stay as they are. The others can be saved in snapshots, and have subclasses.
PLAIN_BASES = frozenset({"NamedTuple", "Protocol", "IntEnum", "StrEnum"})
CLASS = "@mypyc_attr(serializable=True, allow_interpreted_subclasses=True)"
# A multiplication and an addition are not fused, which would round once instead of twice: the
# results are those of the interpreted modules on each computer.
os.environ["CFLAGS"] = f"{os.environ.get('CFLAGS', '')} -ffp-contract=off".strip()


def modules() -> list[str]:
    """The modules to compile, by their path in the package."""
    package = ROOT / PACKAGE
    found = [path for folder in FOLDERS for path in sorted((package / folder).glob("*.py"))]
    names = [str(path.relative_to(package)) for path in found if path.name != "__init__.py"]
    return [name for name in (*names, *FURTHER) if name not in LEFT_OUT]


def attributed(source: str) -> str:
    """The source of a module with the compiler's attributes at its classes, and final constants:
    others are looked up by name each time. Each line keeps its number, for tracebacks."""
    lines, body = source.splitlines(), ast.parse(source).body
    last_import = max(n.end_lineno or 0 for n in body if isinstance(n, ast.Import | ast.ImportFrom))
    lines[last_import - 1] += "; from typing import TYPE_CHECKING, Final"
    _fill(lines, last_import, "if TYPE_CHECKING: from mypy_extensions import mypyc_attr")
    for node in body:
        if isinstance(node, ast.ClassDef):
            bases = {ast.unparse(base) for base in node.bases}
            first = node.decorator_list[0].lineno if node.decorator_list else node.lineno
            if not bases & PLAIN_BASES:
                _fill(lines, first - 2, CLASS)
        elif isinstance(node, ast.Assign) and _is_constant(node):
            further = (node.end_lineno or node.lineno) - node.lineno
            lines[node.lineno - 1 : node.end_lineno] = [_final(node), *[""] * further]
    return "\n".join(lines) + "\n"


def _fill(lines: list[str], number: int, text: str) -> None:
    """Replace an empty line."""
    assert not lines[number], f"line {number + 1} is not empty: {lines[number]}"
    lines[number] = text


def _is_constant(node: ast.Assign) -> bool:
    """Whether it assigns numbers, to one name or to several."""
    values = node.value.elts if isinstance(node.targets[0], ast.Tuple) else [node.value]
    return all(map(_is_numeric, values))


def _is_numeric(value: ast.expr) -> bool:
    """Whether it is a number, or a calculation with numbers."""
    if isinstance(value, ast.BinOp):
        return _is_numeric(value.left) and _is_numeric(value.right)
    return isinstance(value, ast.Constant) and isinstance(value.value, int | float)


def _final(node: ast.Assign) -> str:
    """An assignment of one constant, or of several, as declarations."""
    target, value = node.targets[0], node.value
    is_one = isinstance(target, ast.Name)
    pairs = [(target, value)] if is_one else zip(target.elts, value.elts, strict=True)
    return "; ".join(f"{ast.unparse(name)}: Final = {ast.unparse(one)}" for name, one in pairs)


def main() -> None:
    """Compile a copy of the package, and put the extension modules beside the sources."""
    from mypyc.build import mypycify
    from setuptools import setup

    remove()
    shutil.rmtree(BUILD, ignore_errors=True)
    shutil.copytree(ROOT / PACKAGE, BUILD / PACKAGE, ignore=shutil.ignore_patterns("*.pyc"))
    shutil.copy(ROOT / "setup.cfg", BUILD / "mypy.ini")
    os.chdir(BUILD)
    files = [f"{PACKAGE}/{name}" for name in modules()]
    for name in files:
        Path(name).write_text(attributed(Path(name).read_text()))
    extensions = mypycify(files, group_name=PACKAGE, opt_level="2", debug_level="0")
    sys.argv[1:] = ["--quiet", "build_ext", "--inplace"]
    setup(name=PACKAGE, packages=[], ext_modules=extensions)
    for path in extension_modules(BUILD):
        shutil.copy(path, ROOT / path.relative_to(BUILD))


def extension_modules(root: Path) -> list[Path]:
    """The extension modules beside the sources below `root`."""
    return [*root.glob(f"{PACKAGE}__mypyc*.so"), *(root / PACKAGE).rglob("*.so")]


def remove() -> None:
    """Remove the extension modules, so that the sources run."""
    for path in extension_modules(ROOT):
        path.unlink()


if __name__ == "__main__":
    remove() if sys.argv[1:] == ["--remove"] else main()
