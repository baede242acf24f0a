"""Rules of the house. A failure says the reason and the way to mend it."""

import ast
import configparser
from pathlib import Path

import pytest

ROOT = Path(__file__).parent.parent
# Imports run from the top of this table to the bottom, never back.
FLOORS = [
    ["errors", "codes", "messages", "log", "units", "params", "block"],
    ["geometry", "control", "estimation", "blocks", "links", "plant", "graph"],
    ["config"],
    ["model", "reference"],
    ["engine", "processes"],
    ["recording"],
    ["ports"],
    ["bluetooth"],
    ["drivers", "render"],
    ["control_socket", "prompts", "emulator"],
    ["runs"],
    ["replay", "board", "calibrate", "diagnostics"],
    ["flash", "start"],
    ["ui", "cli"],
]
FLOOR = {name: number for number, names in enumerate(FLOORS) for name in names}
PURE = {"time", "random", "os", "socket", "threading", "pathlib", "io", "datetime", "secrets"}
SOURCES = sorted((ROOT / "diffbotctl").rglob("*.py"))


def imports(path):
    """Module names that a file imports, with their lines."""
    for node in ast.walk(ast.parse(path.read_text())):
        if isinstance(node, ast.Import):
            for alias in node.names:
                yield alias.name, node.lineno
        elif isinstance(node, ast.ImportFrom) and node.module:
            for alias in node.names:
                yield f"{node.module}.{alias.name}", node.lineno


def part(path):
    """The room of the house that a file is in."""
    inside = path.relative_to(ROOT / "diffbotctl").parts
    return inside[0].removesuffix(".py")


@pytest.mark.parametrize("path", SOURCES, ids=lambda path: str(path.relative_to(ROOT)))
def test_imports_run_one_way(path):
    here = FLOOR.get(part(path))
    if here is None:
        return
    for name, line in imports(path):
        steps = name.split(".")
        if steps[0] != "diffbotctl" or len(steps) < 2 or steps[1] not in FLOOR:
            continue
        assert FLOOR[steps[1]] <= here, (
            f"{path.relative_to(ROOT)}:{line} imports {name}, which lives on a higher floor; "
            "move what both need down to the lower one"
        )


@pytest.mark.parametrize(
    "path",
    [path for path in SOURCES if part(path) in ("blocks", "links", "plant")],
    ids=lambda path: str(path.relative_to(ROOT)),
)
def test_blocks_codecs_and_plant_know_no_clock_chance_or_file(path):
    for name, line in imports(path):
        if name == "random.Random":
            continue  # the class of the seeded generator that the plant is handed
        assert name.split(".")[0] not in PURE, (
            f"{path.relative_to(ROOT)}:{line} imports {name}; time and inputs are handed in, "
            "or a replay could not be equal"
        )


def test_every_package_ships():
    metadata = configparser.ConfigParser()
    metadata.read(ROOT / "setup.cfg")
    listed = set(metadata["options"]["packages"].split())
    folders = {
        ".".join(path.parent.relative_to(ROOT).parts)
        for path in SOURCES
        if path.name == "__init__.py"
    }
    missing = folders - listed
    assert not missing, f"setup.cfg does not list {missing}: the wheel would lack them"


def test_help_imports_nothing_heavy():
    import subprocess
    import sys

    code = (
        "import sys; sys.argv = ['diffbotctl', '--help']\n"
        "from diffbotctl.cli.main import main\n"
        "try: main()\nexcept SystemExit: pass\n"
        "heavy = {'numpy', 'rich', 'jsonschema', 'yaml', 'serial', 'mcap', 'textual'}\n"
        "print('HEAVY', sorted(heavy & set(sys.modules)))"
    )
    out = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert "HEAVY []" in out.stdout, "import heavy libraries inside the command that uses them"
