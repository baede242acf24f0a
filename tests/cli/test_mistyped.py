"""What a newcomer types by mistake, and the error: place, cause, fix, and the exit code."""

import os
import socket
import subprocess
from math import radians

import pytest

from diffbotctl.cli.drive import goto
from tests.sampling import by_day
from tests.support.command_process import command_line
from tests.support.running import cli, running
from tests.support.terminal import Terminal

ROBOT_FILE = "format: 1\nkind: robot\ninclude: book_2wd\nwheels: 3\n"


@pytest.mark.parametrize(
    "words",
    [
        ("0.5,-0.2,90deg",),
        ("(0.5,", "-0.2,", "90deg)"),
        ("0.5; -0.2 90deg",),
        ("0.5 , -20cm, 90deg",),
    ],
)
def test_goto_takes_a_pose_with_commas(words):
    values = goto.make_context("goto", list(words)).params
    assert [values[name] for name in ("x", "y", "heading")] == [0.5, -0.2, radians(90)]


def outcome(folder, *words):
    """Exit code, and the output, in one line."""
    code, out, err = cli(folder, *words, cwd=folder)
    assert "Traceback" not in err and "E-DEFECT" not in err
    return code, " ".join((out + err).split())


@pytest.mark.parametrize(
    ("words", "expected"),
    by_day(
        14,
        [
            (("goto", "0", "0", "90", "deg"), "'90 deg' are two words here: write 90deg"),
            (("goto", "0.5", "m", "0", "m"), "'0.5 m' are two words here: write 0.5m"),
            (("drive", "--speed", "0.1", "m/s"), "'0.1 m/s' are two words here: write 0.1m/s"),
            (("run", "goal", "--for", "10", "s"), "'10 s' are two words here: write 10s"),
            (("param", "set", "guard.margin", "8", "cm"), "write 8cm"),
            (
                ("new", "message", "my_package/Face"),
                "use lower-case letters, digits and _ such as face",
            ),
            (("goto", "1,2"), "write 2: diffbotctl goto 1 2"),
            (("goto", "0,5 0"), "write 3: diffbotctl goto 0 5 0"),
            (("goto", "", "1", "2"), "'' is not a number"),
            (("goto", "0,5", "0"), "has a decimal comma: write 0.5"),
            (("goto", "1", "1", "--heading", "90deg"), "No such option '--heading'"),
            (("goto", "1", "1", "--engin", "x"), "Did you mean '--engine'?"),
            (("drive", "--sped", "0.1"), "Did you mean '--speed'?"),
            (("drive", "0.2"), "Write --speed 0.1 to drive"),
            (("drive",), "without a speed the robot does not move: give --speed"),
            (("drive", "--for", "2s"), "without a speed the robot does not move: give --speed"),
            (("drive", "--distance", "0", "--speed", "0.1"), "--distance 0 is no drive"),
            (("drive", "--angle", "0", "--turn", "1"), "--angle 0 is no drive"),
            (("run", "goal", "book_2wd"), "write --robot book_2wd"),
            (("engines", ""), "unexpected extra argument ()"),
            (("run", "goal", "--goal", "1", "0.5", "90deg"), '--goal "1 0.5 90deg"'),
            (
                ("run", "hello", "--robot", "none"),
                "--robot has no effect: this pipeline has no robot",
            ),
            (("run", "hello", "--port", "emulated"), "--port has no effect"),
            (("run", "hello", "--seed", "3"), "--seed has no effect"),
            (("run", "teleop", "--goal", "1 0"), "no block of this pipeline follows goals"),
            (("run", "goal.yaml"), "did you mean goal, without .yaml?"),
            (
                ("run", "goal", "--robot", "robots/turtle.yaml"),
                "did you mean turtle, without .yaml?",
            ),
            (("check", "pipelines/goal.yaml"), "did you mean goal, without .yaml?"),
            (("explain", "E-PIN-"), "did you mean E-PIN-UNKNOWN, E-PIN-PWM,"),
            (("record",), "Did you mean 'bag record'?"),
            (("echo", "/odom"), "Did you mean 'topic echo'?"),
            (("list",), "Did you mean 'topic list' or 'param list'?"),
            (("status",), "Did you mean 'engines'?"),
            (("version",), "Did you mean '--version'?"),
            (("service", "--name", "a/b"), "use letters, digits, - and _ only"),
        ],
    ),
)
def test_a_mistyped_command_names_what_to_write(words, expected, tmp_path):
    code, text = outcome(tmp_path, *words)
    assert code == 2 and expected in text
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    ("words", "expected"),
    [
        (("--port", "SIM"), "did you mean sim?"),
        (("--port", "simulated"), "did you mean sim?"),
        (("--port", "emulator"), "did you mean emulated?"),
        (("--group", "nothing_"), "--group E-SOCKET there is no group 'nothing_'"),
    ],
    ids=["upper", "longer", "other", "group"],
)
def test_no_such_port(words, expected, tmp_path):
    code, text = outcome(tmp_path, "run", "goal", *words)
    assert code == 1 and expected in text


@pytest.mark.parametrize("command", by_day(2, ["web", "foxglove", "blocks", "why"]))
def test_the_engine_of_another_computer_is_never_taken_for_one_here(command, tmp_path):
    with running(tmp_path, "standby", "--stay"):
        code, text = outcome(tmp_path, command, "--at", "ann@computer.invalid")
        assert code == 1 and "ann@computer.invalid E-SSH" in text


def test_a_problem_of_two_files_is_reported_once(tmp_path):
    (tmp_path / "robot.yaml").write_text(ROBOT_FILE)
    robot = "robot: {use: ./robot.yaml}\n"
    (tmp_path / "mine.yaml").write_text(f"format: 1\nkind: pipeline\ninclude: goal\n{robot}")
    code, text = outcome(tmp_path, "check", "./mine.yaml", "./robot.yaml")
    assert code == 2 and text.count("unknown key 'wheels'") == 1
    assert "./mine.yaml: 1 error" in text and "./robot.yaml: 1 error, reported above" in text


@pytest.mark.parametrize("content", ["format: 1\n", '[{"a": 1}]\n'])
def test_a_log_is_not_appended_to_another_file(content, tmp_path):
    file = tmp_path / "mine"
    file.write_text(content)
    code, text = outcome(tmp_path, "run", "goal", "--fast", "--log", "mine")
    assert code == 2 and "E-LOG this file is not the log" in text.partition("mine ")[2]
    assert file.read_text() == content


def test_a_log_and_a_recording_are_two_files(tmp_path):
    code, text = outcome(tmp_path, "run", "goal", "--fast", "--record", "a", "--log", "./a")
    assert code == 2 and "--record and --log name the same file" in text


@pytest.mark.parametrize("option", ["--record", "--log"])
@pytest.mark.parametrize("kind", ["pipe", "socket", "terminal"])
def test_a_run_writes_to_files_only(option, kind, tmp_path):
    path, (terminal, slave) = tmp_path / "out", os.openpty()
    if kind == "pipe":
        os.mkfifo(path)
    elif kind == "socket":
        with socket.socket(socket.AF_UNIX) as bound:
            bound.bind(str(path))
    else:
        path.symlink_to(os.ttyname(slave))  # as the port of a board
    words = ("run", "goal", "--fast", "--quiet", option, "out")
    for more in ((), ("--force",)) if option == "--record" else ((),):
        code, text = outcome(tmp_path, *words, *more)
        assert code == 2 and "this is a device or a pipe, not a file" in text
    os.close(terminal)
    os.close(slave)


@pytest.mark.parametrize(
    ("option", "name", "field"),
    [("--record", "recording", "incomplete_recording"), ("--log", "log file", "incomplete_log")],
)
def test_a_run_whose_file_is_incomplete_fails(option, name, field, tmp_path):
    code, text = outcome(tmp_path, "run", "goal", "--fast", "--quiet", option, "/dev/full")
    assert code == 1 and f"{name} INCOMPLETE: No space left on device" in text
    code, text = outcome(tmp_path, "run", "goal", "--fast", "--json", option, "/dev/full")
    assert code == 1 and f'"{field}": "No space left on device"' in text


def test_a_replay_whose_recording_is_incomplete_reports_it(tmp_path):
    assert outcome(tmp_path, "run", "goal", "--fast", "--quiet", "--record", "a.mcap")[0] == 0
    for more in ((), ("--set", "follower.tolerance=20 mm")):
        code, text = outcome(tmp_path, "replay", "a.mcap", "--record", "/dev/full", *more)
        assert code == 1 and "/dev/full E-RECORD cannot record there: No space left" in text


def test_a_replay_from_beyond_the_end_is_refused(tmp_path):
    words = ("--for", "1s", "--record", "a.mcap")
    assert outcome(tmp_path, "run", "hello", "--fast", *words)[0] == 0
    code, text = outcome(tmp_path, "replay", "a.mcap", "--from", "100s")
    assert code == 2 and "--from 100 s has nothing to show: the last message is at 0.90 s" in text


def test_fields_and_file_are_exported_in_either_order(tmp_path):
    words = ("--for", "1s", "--record", "a.mcap")
    assert outcome(tmp_path, "run", "hello", "--fast", *words)[0] == 0
    code, text = outcome(
        tmp_path, "bag", "export", "a.mcap", "talker.text.text", "listener.heard.text"
    )
    assert code == 0 and text.startswith("time,talker.text.text,listener.heard.text ")
    assert outcome(
        tmp_path, "bag", "export", "talker.text.text", "listener.heard.text", "a.mcap"
    ) == (
        0,
        text,
    )


def test_a_device_is_not_replaced_by_a_file(tmp_path):
    assert outcome(tmp_path, "run", "goal", "--fast", "--quiet", "--record", "a.mcap")[0] == 0
    pipe = tmp_path / "pipe"
    os.mkfifo(pipe)
    code, text = outcome(tmp_path, "bag", "recover", "a.mcap", "--output", "pipe")
    assert code == 2 and "pipe E-OUTPUT this is a device or a pipe, not a file" in text
    assert pipe.is_fifo()


@pytest.mark.parametrize("words", [("run", "goal", "--dash"), ("run", "standby", "--dash")])
def test_a_terminal_that_cannot_draw_has_no_dashboard(words, tmp_path):
    with Terminal(command_line(*words), TERM="dumb") as terminal:
        assert terminal.ended() == 2
        assert "--dash needs a terminal that can draw (TERM is" in " ".join(terminal.text.split())


def test_a_terminal_that_cannot_draw_gets_lines():
    with Terminal(command_line("run", "goal", "--fast"), TERM="dumb") as terminal:
        assert terminal.ended() == 0
        assert "goal 1 reached" in terminal.text and "\x1b" not in terminal.text


@pytest.mark.parametrize("words", [("explain",), ("run", "goal", "--fast"), ("blocks",)])
def test_a_reader_that_ends_early_is_no_defect(words):
    line = command_line(*words)
    process = subprocess.Popen(line, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    process.stdout.readline()
    process.stdout.close()
    err = process.stderr.read()
    process.wait(timeout=60)
    assert "Traceback" not in err and "E-DEFECT" not in err
