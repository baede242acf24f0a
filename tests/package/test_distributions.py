"""The source distribution and the wheel: what they contain, and what the wheel can do elsewhere.

The wheel is installed with its dependencies in a new virtual environment for each supported Python
of this machine, and used from an empty folder: nothing of the checkout is reached.
"""

import configparser
import os
import re
import shutil
import signal
import subprocess
import sys
import tarfile
import zipfile
from email.parser import HeaderParser
from pathlib import Path
from typing import NamedTuple

import pytest

from diffbotctl import __version__
from diffbotctl.emulator.program import RP2040
from tests.package.interpreters import OWN, VERSIONS, interpreters
from tests.support.virtual_board import LONGEST

ROOT = Path(__file__).parents[2]
UNSHIPPED = shutil.ignore_patterns(
    ".git", ".venv*", "node_modules", "__pycache__", ".*_cache", ".hypothesis", "build", "dist"
)
BUILD = "import setuptools.build_meta as build; print(build.build_{}({!r}))"
EXTRAS = {"web", "foxglove", "ros2", "bluetooth", "png"}


def built(kind, source, into):
    """Build a `wheel` or `sdist` from the folder `source`; its path."""
    words = [sys.executable, "-c", BUILD.format(kind, str(into))]
    done = subprocess.run(words, cwd=source, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    return Path(into, done.stdout.split()[-1])


class Distributions(NamedTuple):
    """The files that are published, the names in the wheel, and a copy of the checkout."""

    checkout: Path
    source: Path
    wheel: Path
    wheel_names: set


@pytest.fixture(scope="module")
def distributions(tmp_path_factory):
    """The source distribution, and the wheel that is built from it."""
    folder = tmp_path_factory.mktemp("distributions")
    shutil.copytree(ROOT, folder / "checkout", ignore=UNSHIPPED)
    source = built("sdist", folder / "checkout", folder)
    with tarfile.open(source) as archive:
        archive.extractall(folder)  # `filter` is missing before Python 3.11.4
    wheel = built("wheel", folder / f"diffbotctl-{__version__}", folder)
    names = set(zipfile.ZipFile(wheel).namelist())
    return Distributions(folder / "checkout", source, wheel, names)


@pytest.fixture(scope="module")
def metadata(distributions):
    """The headers and the description of the wheel."""
    with zipfile.ZipFile(distributions.wheel) as archive:
        text = archive.read(f"diffbotctl-{__version__}.dist-info/METADATA").decode()
    return HeaderParser().parsestr(text)


@pytest.mark.nightly
def test_the_wheel_from_the_source_distribution_is_that_from_the_checkout(distributions, tmp_path):
    direct = built("wheel", distributions.checkout, tmp_path)
    assert set(zipfile.ZipFile(direct).namelist()) == distributions.wheel_names


def test_the_wheel_has_every_module_and_what_the_emulators_need(distributions):
    modules = {str(path.relative_to(ROOT)) for path in (ROOT / "diffbotctl").rglob("*.py")}
    sources = {
        f"diffbotctl/{path.relative_to(ROOT)}"
        for pattern in ("*.c", "*.h", "rp2040/*.mjs", "rp2040/*.json")
        for path in (ROOT / "firmware" / "emulator").glob(pattern)
    }
    assert len(sources) > 20
    assert not (modules | sources) - distributions.wheel_names
    assert not [name for name in distributions.wheel_names if "node_modules" in name]


def test_the_source_distribution_has_everything_that_is_tracked(distributions):
    with tarfile.open(distributions.source) as archive:
        names = {name.partition("/")[2] for name in archive.getnames()}
    expected = {
        str(path.relative_to(ROOT))
        for folder in ("diffbotctl", "docs", "firmware", "pipelines", "prove", "robots", "schemas")
        for path in (ROOT / folder).rglob("*")
        if path.is_file() and not {"node_modules", "__pycache__", "build"} & set(path.parts)
    }
    tests = {str(path.relative_to(ROOT)) for path in (ROOT / "tests").rglob("*.py")}
    tops = {"Makefile", "README.md", "CHANGELOG.md", "LICENSE", "setup.cfg", "pyproject.toml"}
    assert not (expected | tests | tops) - names
    assert not [name for name in names if "node_modules" in name or name.endswith(".pyc")]


def test_the_metadata_is_complete(metadata):
    assert metadata["Version"] == __version__
    assert metadata["License"] == "MIT" and metadata["Author"] and metadata["Keywords"]
    assert metadata["Requires-Python"] == ">=3.11"
    assert metadata["Description-Content-Type"].startswith("text/markdown")
    assert set(metadata.get_all("Provides-Extra")) >= EXTRAS
    claimed = {
        text.rpartition(" ")[2]
        for text in metadata.get_all("Classifier")
        if re.search(r":: 3\.\d+$", text)
    }
    assert claimed >= interpreters().keys() - {"3.14"}


def test_the_description_has_no_link_into_a_checkout(metadata):
    description = metadata.get_payload()
    assert "## Extras" in description
    targets = re.findall(r"\]\(([^)]+)\)|src=[\"']([^\"']+)", description)
    assert not [target for target in targets if not "".join(target).startswith("https://")]


def test_the_pages_name_the_files_of_this_version():
    for page in ("package.md", "hardware.md"):
        text = (ROOT / "docs" / page).read_text()
        assert set(re.findall(r"diffbotctl-(\d[\d.]*\d)", text)) == {__version__}, page


def test_the_page_of_the_package_lists_the_packages_of_each_extra():
    setup = configparser.ConfigParser()
    setup.read(ROOT / "setup.cfg")
    text = (ROOT / "docs" / "package.md").read_text()
    rows = dict(re.findall(r"^\| `(\w+)` \|.*\| ([^|]+) \|$", text, re.M))
    assert rows.keys() == EXTRAS
    for extra, packages in rows.items():
        stated = setup["options.extras_require"][extra].split()
        assert packages.split(", ") == [re.split("[><=]", each)[0] for each in stated]


class Installed(NamedTuple):
    """The package in a virtual environment; `environment` reaches nothing of the checkout."""

    folder: Path
    environment: dict

    def run(self, *words, **options):
        """What `diffbotctl` prints in the empty folder of `self`; it must end with 0."""
        done = subprocess.run(
            [self.folder / "bin" / "diffbotctl", *words],
            cwd=self.folder / "empty",
            env=self.environment,
            capture_output=True,
            text=True,
            **options,
        )
        assert done.returncode == 0, done.stdout + done.stderr
        return done.stdout


@pytest.fixture(scope="module", params=VERSIONS)
def installed(request, distributions, tmp_path_factory):
    """The wheel installed for one of the interpreters, with its dependencies from the index."""
    folder = tmp_path_factory.mktemp(f"python{request.param}-")
    if request.param not in interpreters():
        pytest.skip(f"no Python {request.param} here")
    subprocess.run([interpreters()[request.param], "-m", "venv", folder], check=True)
    environment = {key: value for key, value in os.environ.items() if key != "PYTHONPATH"}
    environment |= {"XDG_CACHE_HOME": str(folder / "cache"), "XDG_STATE_HOME": str(folder)}
    words = [folder / "bin" / "python", "-m", "pip", "install", "-q", distributions.wheel]
    done = subprocess.run(
        [*words, "--disable-pip-version-check"], cwd=folder, capture_output=True, text=True
    )
    assert done.returncode == 0, done.stderr
    (folder / "empty").mkdir()
    return Installed(folder, environment)


@pytest.mark.nightly
def test_the_installed_program_is_that_of_the_wheel(installed):
    words = [installed.folder / "bin" / "python", "-c", "import diffbotctl as d; print(d.__file__)"]
    place = subprocess.check_output(
        words, cwd=installed.folder, env=installed.environment, text=True
    )
    assert Path(place).is_relative_to(installed.folder)
    assert installed.run("--version").split()[-1] == __version__
    assert "no errors" in installed.run("check", "goal")


@pytest.mark.nightly
def test_a_simulated_goal_is_reached(installed):
    assert "goals 1 of 1 reached" in installed.run("run", "goal", "--fast")


@pytest.mark.nightly
def test_a_goal_is_reached_on_an_emulated_board(installed):
    """The emulator is compiled from the sources in the wheel."""
    words = ("run", "goal", "--port", "emulated", "--fast", "--goal", "0.3 0")
    assert "goals 1 of 1 reached" in installed.run(*words)
    (program,) = (installed.folder / "cache" / "diffbotctl").glob("emulator-*")
    assert os.access(program, os.X_OK)


@pytest.mark.nightly
def test_a_goal_is_reached_on_an_emulated_pico(installed):
    """With the package from npm in the cache, where the error asks a user to install it."""
    installed.run("new", "robot", "--kit", "pico_tc1508s")
    words = ("run", "goal", "--robot", "pico_tc1508s", "--port", "emulated", "--fast")
    command = [installed.folder / "bin" / "diffbotctl", *words, "--goal", "0.2 0"]
    reported = subprocess.run(
        command,
        cwd=installed.folder / "empty",
        env=installed.environment,
        capture_output=True,
        text=True,
    )
    folder = Path(re.search(r"npm ci --prefix\s+(\S+)", reported.stderr)[1])
    assert reported.returncode == 1 and folder.is_relative_to(installed.folder / "cache")
    assert (folder / "package-lock.json").is_file()
    (folder / "node_modules").symlink_to(RP2040 / "node_modules")
    assert "goals 1 of 1 reached" in installed.run(*words, "--goal", "0.2 0")


@pytest.mark.nightly
def test_a_virtual_board_answers(installed):
    process = subprocess.Popen(
        [installed.folder / "bin" / "python", "-u", "-m", "diffbotctl", "emulate", "book_2wd"],
        cwd=installed.folder / "empty",
        env=installed.environment,
        stdout=subprocess.PIPE,
        text=True,
    )
    try:
        output = ""
        while "Ctrl-C ends" not in output:
            line = process.stdout.readline()
            assert line, output
            output += line
        port = re.search(r"^USB port +(\S+)$", output, re.M)[1]
        installed.run("blink", "--robot", "book_2wd", "--port", port, "--times", "1")
        process.send_signal(signal.SIGINT)
        process.communicate(timeout=LONGEST)
        assert process.returncode == 0
    finally:
        process.kill()
        process.communicate()


# For each extra a command that needs it.
NEEDS = {
    "web": ("web",),
    "foxglove": ("foxglove",),
    "bluetooth": ("bluetooth", "scan"),
    "ros2": ("bag", "export", "run.mcap", "--format", "rosbag2", "--output", "for_ros"),
    "png": ("bag", "plot", "gate.wheels", "run.mcap", "--output", "wheels.png"),
}


@pytest.mark.nightly
@pytest.mark.parametrize("installed", [OWN], indirect=True)
def test_the_extras_bring_what_their_commands_need(installed, distributions):
    installed.run("run", "goal", "--fast", "--quiet", "--record", "run.mcap", "--force")

    def lacks(extra):
        done = subprocess.run(
            [installed.folder / "bin" / "diffbotctl", *NEEDS[extra]],
            cwd=installed.folder / "empty",
            env=installed.environment,
            capture_output=True,
            text=True,
        )
        return "pip install" in done.stderr  # the fix

    assert NEEDS.keys() == EXTRAS
    assert [extra for extra in NEEDS if lacks(extra)] == list(NEEDS)
    expected = f"{distributions.wheel}[{','.join(EXTRAS)}]"
    words = [installed.folder / "bin" / "python", "-m", "pip", "install", "-q", expected]
    done = subprocess.run(
        [*words, "--disable-pip-version-check"],
        capture_output=True,
        text=True,
        cwd=installed.folder,
    )
    assert done.returncode == 0, done.stderr
    assert [extra for extra in NEEDS if lacks(extra)] == []
