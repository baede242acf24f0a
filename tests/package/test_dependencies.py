"""What is imported is declared in setup.cfg, and what is declared is locked in requirements/."""

import ast
import configparser
import re
import sys
from functools import cache
from importlib.metadata import packages_distributions
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
OWN = {"diffbotctl", "tests", "prove", "_pytest"}
# Of ROS 2, in whose Python the bridge runs; no package of an index.
OF_ROS = {"rclpy", "rcl_interfaces", "std_srvs"}
# Folders and files that only tests and developers use.
FOR_TESTS = ("tests", "prove", "build_compiled.py", "firmware")
# Declared for its command, its plugin or its stubs, and imported by nothing.
NOT_IMPORTED = {"build", "pytest-xdist", "ruff"}


@cache
def declared():
    """Name of an extra, "" for what is always installed -> names with the bounds of versions."""
    setup = configparser.ConfigParser()
    assert setup.read(ROOT / "setup.cfg")
    extras = dict(setup["options.extras_require"]) | {"": setup["options"]["install_requires"]}
    return {
        extra: {normal(re.match(r"[\w-]+", line)[0]): line for line in lines.split()}
        for extra, lines in extras.items()
    }


def normal(name):
    """As PEP 503 compares names."""
    return re.sub(r"[-_.]+", "-", name).lower()


@cache
def distributions():
    """Name of a module -> names of the packages that bring it."""
    found = packages_distributions()
    return {module: {normal(name) for name in names} for module, names in found.items()}


def imported(*places):
    """Third-party modules that the Python files at these places import -> one of the files."""
    files = [
        file
        for place in places
        for file in ([ROOT / place] if place.endswith(".py") else (ROOT / place).rglob("*.py"))
    ]
    modules = {}
    for file in files:
        for node in ast.walk(ast.parse(file.read_text())):
            names = [alias.name for alias in node.names] if isinstance(node, ast.Import) else []
            if isinstance(node, ast.ImportFrom) and node.level == 0:
                names = [node.module]
            for name in names:
                modules.setdefault(name.split(".")[0], str(file.relative_to(ROOT)))
    known = sys.stdlib_module_names | OWN | OF_ROS
    return {
        name: file
        for name, file in modules.items()
        if name not in known and not name.endswith("_msgs")
    }


@cache
def package_imports():
    """Those of the package."""
    return imported("diffbotctl")


@cache
def tool_imports():
    """Those of tests and tools."""
    return imported(*FOR_TESTS)


def test_what_the_package_imports_is_declared():
    names = {name for extra, lines in declared().items() if extra != "test" for name in lines}
    for module, file in package_imports().items():
        assert distributions().get(module, {module}) & names, f"{file} imports {module}"


def test_what_tests_and_tools_import_is_declared():
    names = {name for lines in declared().values() for name in lines}
    for module, file in tool_imports().items():
        assert distributions().get(module, {module}) & names, f"{file} imports {module}"


def test_what_is_declared_is_imported():
    """A package that nothing imports any more is installed for nothing."""
    modules = package_imports() | tool_imports()
    names = {name for module in modules for name in distributions().get(module, {module})}
    for extra, lines in declared().items():
        unused = {each for each in lines.keys() - names if not each.startswith("types-")}
        assert unused <= NOT_IMPORTED, f"{extra}: {unused}"


def test_no_two_extras_are_equal():
    expected = [tuple(sorted(lines.items())) for lines in declared().values()]
    assert len(set(expected)) == len(expected)


def locked(name):
    """Name of a package -> its pinned versions and hashes."""
    text = (ROOT / "requirements" / f"{name}.txt").read_text().replace("\\\n", " ")
    packages = {}
    for line in text.split("\n"):
        match = re.match(
            r"([\w.-]+)==([\w.+-]+)(?: ; [^-]*)?((?: +--hash=sha256:[0-9a-f]{64})+)$", line
        )
        assert match or not line, f"requirements/{name}.txt: {line[:80]}"
        if match:
            packages.setdefault(normal(match[1]), []).append(match[2])
    return packages


@pytest.mark.parametrize(("name", "extras"), [("run", [""]), ("test", ["", "test"])])
def test_each_package_is_locked_within_its_bounds(name, extras):
    versions = locked(name)
    for extra in extras:
        for package, line in declared()[extra].items():
            for version in versions[package]:
                assert within(version, line), (
                    f"requirements/{name}.txt: {package} {version}: {line}"
                )
    assert "setuptools" in versions  # builds the project itself


def within(version, line):
    """Whether a version has the bounds of a line such as `numpy>=1.24,<3`."""
    bounds = re.findall(r"(>=|<)([\d.]+)", line)
    return all(
        (numbers(version) >= numbers(bound)) == (relation == ">=") for relation, bound in bounds
    )


def numbers(version):
    """1.24 -> [1, 24]."""
    return [int(part) for part in re.findall(r"\d+", version)]


def test_what_runs_is_locked_to_the_same_versions_as_in_the_tests():
    tested = locked("test")
    for package, versions in locked("run").items():
        assert tested[package] == versions


def test_the_extras_of_the_package_are_locked_through_those_of_the_tests():
    for lines in declared().values():
        assert lines.keys() <= locked("test").keys()
