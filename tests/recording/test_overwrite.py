"""Output files: what diffbotctl wrote may be overwritten, and only that."""

import signal
import subprocess
from pathlib import Path

import pytest

from diffbotctl.cli import bag, replay, robot_model, wiring
from diffbotctl.cli import run as run_command
from diffbotctl.cli.output import check_overwrite, has_mark
from diffbotctl.config.load import load
from diffbotctl.errors import RunError, UsageError
from diffbotctl.recording.reader import recording_info
from diffbotctl.recording.recording_file import is_being_written, open_locked
from diffbotctl.runs.options import RunOptions
from diffbotctl.runs.run import Run
from tests.command_result import invoke
from tests.support.command_process import command_line, start_in_pipe

FIELD = "odometry.odometry.x"


def run(command, *words):
    return invoke(command, *words)[0]


def writers(goal):
    """Each command that writes a file, with its suffix."""
    return {
        ".csv": (bag.bag, "export", goal),
        ".svg": (bag.bag, "plot", FIELD, goal),
        ".png": (bag.bag, "plot", FIELD, goal),
        ".mcap": (bag.bag, "recover", goal),
        ".urdf": (robot_model.export, "urdf", "book_2wd"),
        "-wires.svg": (wiring.wiring, "book_2wd"),
        "-robot.svg": (robot_model.show, "book_2wd"),
    }


@pytest.mark.parametrize(
    "suffix", [".csv", ".svg", ".png", ".mcap", ".urdf", "-wires.svg", "-robot.svg"]
)
def test_a_file_of_ours_is_overwritten_and_one_of_others_is_not(suffix, goal, tmp_path):
    words = writers(goal)[suffix]
    output = tmp_path / f"x{suffix}"
    run(*words, "--output", output)
    first = output.read_bytes()
    assert has_mark(first)
    run(*words, "--output", output)
    output.write_bytes(b"time,diffbotctl,x\n1,2,3\n")
    with pytest.raises(UsageError, match="did not write it"):
        run(*words, "--output", output)
    assert output.read_bytes() == b"time,diffbotctl,x\n1,2,3\n"
    run(*words, "--output", output, "--force")
    assert output.read_bytes() == first


def test_a_wide_table_is_recognised(goal, tmp_path):
    run(bag.bag, "export", goal, "--output", tmp_path / "all.csv")
    header = (tmp_path / "all.csv").read_bytes().partition(b"\n")[0]
    assert len(header) > 1000
    check_overwrite(tmp_path / "all.csv", force=False)


@pytest.mark.parametrize(
    "content",
    [
        b"time,x\n0,1\n",
        b"# notes on diffbotctl\n",
        b"\x89PNG\r\n\x1a\n a screenshot of diffbotctl",
        b"<svg><text>diffbotctl</text></svg>",
        b"format: 1  # a pipeline for diffbotctl\n",
    ],
)
def test_the_name_alone_is_no_mark(content, tmp_path):
    path = tmp_path / "x"
    path.write_bytes(content)
    with pytest.raises(UsageError):
        check_overwrite(path, force=False)


def test_an_empty_file_may_be_overwritten(tmp_path):
    path = tmp_path / "x.csv"
    path.touch()
    check_overwrite(path, force=False)


def test_a_goal_is_not_recovered_onto_itself(goal):
    before = goal.read_bytes()
    with pytest.raises(Exception, match="must not overwrite"):
        run(bag.bag, "recover", goal, "--output", goal, "--force")
    assert goal.read_bytes() == before


@pytest.mark.parametrize("force", [(), ("--force",)])
@pytest.mark.parametrize(
    ("command", "words", "option"),
    [
        (run_command.run, ("goal", "--fast", "--quiet"), "--record"),
        (replay.replay, ("GOAL",), "--record"),
        (bag.bag, ("recover", "GOAL"), "--output"),
    ],
)
def test_a_recording_that_is_being_written_is_not_overwritten(
    command, words, option, force, goal, tmp_path
):
    path = tmp_path / "same.mcap"
    words = [goal if word == "GOAL" else word for word in words]
    with open_locked(path) as file:
        file.write(goal.read_bytes()[:1000])
        file.flush()
        with pytest.raises(UsageError, match="is writing this file now") as error:
            run(command, *words, option, path, *force)
        assert "end the other one first" in str(error.value)
        assert path.read_bytes() == goal.read_bytes()[:1000]
    run(command, *words, option, path, *force)  # it is free when its writer has ended
    assert len(path.read_bytes()) > 1000


def test_a_run_that_opens_a_recording_of_another_run_is_refused(tmp_path):
    path = tmp_path / "same.mcap"
    with open_locked(path), pytest.raises(RunError, match="is writing this file now"):
        Run(load("goal"), RunOptions(fast=True, record=path))
    assert Run(load("goal"), RunOptions(fast=True, record=path)).go().ending.code == 0


def test_two_runs_may_write_to_a_device_that_keeps_nothing():
    with open_locked(Path("/dev/null")):
        run = Run(load("goal"), RunOptions(fast=True, record="/dev/null"))
        assert run.go().ending.code == 0


def test_the_recording_of_a_killed_run_is_free_again(tmp_path):
    path = tmp_path / "same.mcap"
    words = command_line("run", "hello", "--record", path)
    process = start_in_pipe(words, cwd=tmp_path)
    assert "hello" in process.stdout.readline()
    # Not asked before something is in the file: the question would refuse it the lock.
    while not path.exists() or not path.stat().st_size:
        assert process.poll() is None
    assert is_being_written(path)
    second = subprocess.run(words, cwd=tmp_path, capture_output=True, text=True)
    assert second.returncode == 2 and "is writing this file now" in second.stderr
    process.send_signal(signal.SIGKILL)
    process.communicate()  # its children too have ended, which have the other end of the pipe
    assert not is_being_written(path)
    done = subprocess.run([*words, "--for", "0.1s"], cwd=tmp_path, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    assert recording_info(path).complete
