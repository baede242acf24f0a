"""New files work as they stand, and a new block is found where its package is installed."""

import json
import os
import re
import resource
import shutil
import subprocess
import sys
import tty
from pathlib import Path

import pytest
import yaml
from jsonschema import Draft202012Validator

from diffbotctl.calibrate.robot_file import writable_copy
from diffbotctl.cli import check, new
from diffbotctl.config.load import load, load_robot
from diffbotctl.errors import UserError
from diffbotctl.recording.reader import RecordingReader
from diffbotctl.runs.options import RunOptions
from diffbotctl.runs.run import Run
from tests.command_result import invoke
from tests.sampling import by_day
from tests.support.command_process import MAIN, command_line

ROOT = Path(__file__).parents[2]
MODELINE = "# yaml-language-server: $schema=../schemas/robot.schema.json\n"


pytestmark = pytest.mark.usefixtures("empty_folder")


@pytest.mark.parametrize("kind", ["robot", "pipeline"])
def test_a_new_file_has_no_problem_and_asks_nothing(kind):
    code, output = invoke(new.new, kind, "mine")
    path = f"{kind}s/mine.yaml"
    assert f"written: {path}" in output
    code, output = invoke(check.check, path)
    assert code == 0
    assert output.startswith(f"{path}: no errors\n")


@pytest.mark.parametrize("what", ["trials", "block", "message", "driver", "program"])
def test_a_terminal_of_80_columns_shows_what_is_to_be_typed(what):
    invoke(new.new, what, "sonar")
    text = Path("trials/sonar.yaml" if what == "trials" else "sonar/README.md").read_text()
    assert [line for line in text.splitlines() if len(line) > 80] == []


@pytest.mark.parametrize("kind", ["robot", "pipeline"])
def test_a_new_file_among_the_shipped_ones_is_refused(monkeypatch, kind):
    monkeypatch.chdir(ROOT)
    with pytest.raises(UserError, match="mkdir ~/robot; cd ~/robot"):
        invoke(new.new, kind, "mine_among_shipped_ones")
    assert not (ROOT / f"{kind}s" / "mine_among_shipped_ones.yaml").exists()


def test_a_new_robot_is_the_kit_of_the_book():
    invoke(new.new, "robot", "mine")
    ours, book = load_robot("mine").robot, load_robot("book_2wd").robot
    for part in ("drive", "sensors", "limits", "simulation"):  # sections compare by their fields
        assert repr(getattr(ours, part)) == repr(getattr(book, part))


def test_a_new_pipeline_drives_a_new_robot_to_its_goal():
    invoke(new.new, "robot", "mine")
    invoke(new.new, "pipeline", "mine")
    result = Run(load("mine"), RunOptions(fast=True)).go()
    assert (result.reached, result.goals) == (1, 1)


@pytest.mark.parametrize("what", ["robot", "pipeline", "block", "driver", "message", "program"])
def test_an_editor_finds_the_schema_of_a_new_file_and_no_mistake(what, tmp_path_factory):
    invoke(new.new, what, "mine")
    elsewhere = tmp_path_factory.mktemp("another") / "machine"
    shutil.copytree(".", elsewhere)
    (path,) = elsewhere.rglob("*.yaml")
    text = path.read_text()
    named = re.match(r"# yaml-language-server: \$schema=(.*)\n", text)[1]
    schema = json.loads((path.parent / named).read_text())
    assert schema["title"] == f"A {'robot' if what == 'robot' else 'pipeline'} of diffbotctl"
    assert not list(Draft202012Validator(schema).iter_errors(yaml.safe_load(text)))


@pytest.mark.parametrize("kit", new.kits())
def test_an_editor_finds_no_mistake_in_a_kit(kit):
    invoke(new.new, "robot", "--kit", kit)
    schema = json.loads(Path("schemas/robot.schema.json").read_text())
    content = yaml.safe_load(Path(f"robots/{kit}.yaml").read_text())
    assert not list(Draft202012Validator(schema).iter_errors(content))


def test_schemas_of_another_version_are_replaced_and_files_of_others_kept():
    others = {"title": "Robots of a museum"}
    Path("schemas").mkdir()
    Path("schemas/robot.schema.json").write_text(json.dumps(others))
    Path("schemas/view.schema.json").write_text('{"title": "A saved view of diffbotctl"}')
    _, output = invoke(new.new, "schemas")
    assert "schemas/ is up to date" in output
    assert json.loads(Path("schemas/robot.schema.json").read_text()) == others
    for name in ("view", "pipeline"):
        file = f"{name}.schema.json"
        assert Path("schemas", file).read_text() == (ROOT / "schemas" / file).read_text()


def test_a_copied_robot_has_its_schema():
    path, was_copied = writable_copy(ROOT / "robots" / "book_2wd.yaml")
    assert was_copied and path.read_text().startswith(MODELINE)
    assert (path.parent / "../schemas/robot.schema.json").is_file()


@pytest.mark.parametrize(
    ("words", "code"),
    [
        (["robot", "Mine"], "E-NAME"),
        (["pipeline", "../mine"], "E-NAME"),
        (["block", "2nd"], "E-NAME"),
        (["block", "lambda"], "E-NAME"),  # no module can be called so
        (["block", "odometry"], "E-NAME"),  # a clash in the registry
        (["driver", "lidar"], "E-NAME"),
    ],
)
def test_names_that_cannot_be(words, code):
    with pytest.raises(UserError) as raised:
        invoke(new.new, *words)
    assert raised.value.problems[0].code == code
    assert not [path for path in Path().rglob("*") if "cache" not in path.parts]


@pytest.mark.parametrize("kind", ["robot", "pipeline", "block", "driver", "message", "program"])
def test_nothing_is_written_over(kind):
    invoke(new.new, kind, "mine")
    before = {path: path.read_text() for path in Path().rglob("*.*") if path.is_file()}
    with pytest.raises(UserError) as raised:
        invoke(new.new, kind, "mine")
    assert raised.value.problems[0].code == "E-FILE-WRITE"
    assert {path: path.read_text() for path in before} == before


def test_a_disk_without_room_leaves_no_half_a_robot():
    done = subprocess.run(
        command_line("new", "robot", "mine"),
        capture_output=True,
        text=True,
        env=os.environ | {"PYTHONPATH": str(ROOT)},
        preexec_fn=lambda: resource.setrlimit(resource.RLIMIT_FSIZE, (100, 100)),  # bytes a file
    )
    assert done.returncode == 2 and "E-FILE-WRITE" in done.stderr
    assert not list(Path("robots").iterdir())


PROGRAM = ("-c", MAIN)


def python(*words, path):
    """Run python as a person would, with these folders before all others."""
    environment = os.environ | {"PYTHONPATH": os.pathsep.join(map(str, path))}
    done = subprocess.run(
        [sys.executable, *map(str, words)], env=environment, capture_output=True, text=True
    )
    return done.returncode, done.stdout + done.stderr


def pip_install(folder, target):
    code, printed = python(
        "-m",
        "pip",
        "install",
        "-q",
        "--no-deps",
        "--no-build-isolation",
        "--no-index",
        "--disable-pip-version-check",
        "--target",
        target,
        folder,
        path=[],
    )
    assert code == 0, printed


def test_a_new_message_installs_runs_and_is_recorded(tmp_path):
    invoke(new.new, "message", "gas")
    folder, target = tmp_path / "gas", tmp_path / "installed"
    pip_install(folder, target)
    line = ["run", folder / "gas.yaml", "--fast", "--quiet", "--record", "gas.mcap"]
    code, printed = python(*PROGRAM, *line, path=[target, ROOT])
    assert (code, "INCOMPLETE" in printed) == (0, False), printed
    code, printed = python(*PROGRAM, "replay", "gas.mcap", "--check", path=[target, ROOT])
    assert (code, "same" in printed) == (0, True), printed
    code, printed = python(*PROGRAM, "bag", "export", "gas.mcap", "gas.gas", path=[ROOT])
    assert printed.startswith("time,gas.gas.distance,gas.gas.state,gas.gas.turns\n"), printed
    assert ",far," in printed  # the goal is 1.1 m away, and `far` begins at 0.5 m


def test_a_new_message_s_own_test_passes(tmp_path):
    invoke(new.new, "message", "gas")
    folder = tmp_path / "gas"
    code, printed = python("-m", "pytest", "-q", folder, path=[folder, ROOT])
    assert (code, "4 passed" in printed) == (0, True), printed


def test_a_new_driver_reads_its_device_and_is_replayed_without_it(tmp_path):
    invoke(new.new, "driver", "sonar")
    folder, target = tmp_path / "sonar", tmp_path / "installed"
    pip_install(folder, target)
    code, printed = python(*PROGRAM, "blocks", path=[target, ROOT])
    assert "sonar           (driver) Read a distance sensor" in printed, printed
    line = ["run", folder / "sonar.yaml", "--quiet", "--for", "2s", "--record", "sonar.mcap"]
    code, printed = python(*PROGRAM, *line, path=[target, ROOT])
    assert code == 1 and "E-DEVICE" in printed and "sonar.yaml:7:3" in printed
    assert "source sonar (/dev/ttyUSB0): No such file or directory" in printed
    master, slave = os.openpty()
    tty.setraw(slave)
    os.write(master, b"412\n" * 5)
    words = [*line, "--set", f"sonar.device={os.ttyname(slave)}"]
    code, printed = python(*PROGRAM, *words, path=[target, ROOT])
    os.close(master)
    os.close(slave)
    distances = [
        item.message.distance
        for item in RecordingReader(Path("sonar.mcap")).messages()
        if item.wire == "sonar.range"
    ]
    assert distances == [0.412] * 5, printed
    code, printed = python(*PROGRAM, "replay", "sonar.mcap", "--check", path=[target, ROOT])
    assert (code, "same" in printed) == (0, True), printed


def test_a_new_driver_s_own_tests_pass(tmp_path):
    invoke(new.new, "driver", "sonar")
    folder = tmp_path / "sonar"
    code, printed = python("-m", "pytest", "-q", folder, path=[folder, ROOT])
    assert (code, "6 passed" in printed) == (0, True), printed


@pytest.mark.parametrize("language", by_day(1, ["python", "c", "node"]))
def test_a_new_program_runs_as_it_stands(language, tmp_path):
    if language == "node" and shutil.which("node") is None:
        pytest.skip("no Node.js on this machine: `node` is not found")
    invoke(new.new, "program", "nose", "--language", language)
    folder = tmp_path / "nose"
    build = re.search(r"^    (cc .*)$", (folder / "README.md").read_text(), re.M)
    if build:
        flags = " -std=c99 -Wall -Wextra -Werror -pedantic"
        subprocess.run(build[1] + flags, shell=True, cwd=folder, check=True)
    words = ["run", folder / "nose.yaml", "--quiet", "--for", "5s", "--record", "nose.mcap"]
    code, printed = python(*PROGRAM, *words, path=[ROOT])
    assert code == 1 and "E-PROGRAM-CONSENT" in printed
    code, printed = python(*PROGRAM, *words, "--allow-programs", path=[ROOT])
    assert "final stop confirmed" in printed, printed
    received = [
        item.message.text
        for item in RecordingReader(Path("nose.mcap")).messages()
        if item.wire == "listener.heard"
    ]
    assert len(received) > 5 and all("m from the start" in text for text in received)
    code, printed = python(*PROGRAM, "replay", "nose.mcap", "--check", path=[ROOT])
    assert (code, "same" in printed) == (0, True), printed


def test_a_new_block_installs_through_its_entry_point_and_drives(tmp_path):
    invoke(new.new, "block", "half_speed")
    folder, target = tmp_path / "half_speed", tmp_path / "installed"
    pip_install(folder, target)
    code, printed = python(*PROGRAM, "blocks", path=[target, ROOT])
    assert "half_speed      Scale the commanded velocity." in printed, printed
    code, printed = python(
        *PROGRAM, "run", folder / "half_speed.yaml", "--fast", "--quiet", path=[target, ROOT]
    )
    assert (code, "1 of 1 reached" in printed) == (0, True), printed


def test_a_new_block_s_own_test_passes(tmp_path):
    invoke(new.new, "block", "half_speed")
    folder = tmp_path / "half_speed"
    code, printed = python("-m", "pytest", "-q", folder, path=[folder, ROOT])
    assert code == 0, printed
    assert "6 passed" in printed
