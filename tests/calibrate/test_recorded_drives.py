"""Recordings as drives of `from-log`: those of which the start, the end or the robot is another."""

import pytest

from diffbotctl.calibrate.recorded_frames import read_frames
from diffbotctl.config.load import load, load_robot
from diffbotctl.errors import UsageError
from diffbotctl.messages import Encoders, Goal
from diffbotctl.recording.writer import RecordingHeader, RecordingWriter
from diffbotctl.runs.options import RunOptions
from diffbotctl.runs.run import Run

ROBOT = "book_2wd"
AHEAD = Goal(0, 1, 0.5, 0.0, None)


@pytest.fixture(scope="module")
def recorded(tmp_path_factory):
    """A recorded drive of a robot with discs of 24 slots."""
    file = tmp_path_factory.mktemp("drive") / "drive.mcap"
    sets = ["robot.drive.encoder.slots=24", "world.walls=[]"]
    options = RunOptions(goals=(AHEAD,), fast=True, record=file)
    result = Run(load("goal", ROBOT, sets), options, tell=lambda text: None).go()
    assert result.ending.code == 0
    return file


def refusal(file, robot=None):
    with pytest.raises(UsageError, match="E-CALIBRATE-LOG") as raised:
        read_frames(file, robot)
    return " ".join(str(raised.value).split())


def test_a_whole_drive(recorded):
    frames = read_frames(recorded)
    assert frames[-1].left > 20 and frames[-1].right > 20


def test_other_discs_than_those_of_the_robot_file(recorded):
    printed = refusal(recorded, load_robot(ROBOT).robot)
    assert "with 24 counts per turn of the left wheel, but the robot file states 20" in printed


def write(file, frames, wires=("robot.encoders",)):
    """A recording of these frames, on each of the wires."""
    about = {"epoch": "1000", "version": "1"}
    with file.open("wb") as output:
        writer = RecordingWriter(output, RecordingHeader(dict.fromkeys(wires, Encoders), 2, about))
        for frame in frames:
            writer.write((frame.time, *(frame for _ in wires)))
        writer.flush()
    return file


def first_rolling(frames):
    return next(number for number, frame in enumerate(frames) if frame.left > 10)


def test_a_drive_whose_end_is_missing(recorded, tmp_path):
    """The end pose was measured later, so a fit would take the missing way for slip."""
    frames = read_frames(recorded)
    part = write(tmp_path / "part.mcap", frames[: first_rolling(frames)])
    assert "still driven when it ends" in refusal(part)


def test_a_drive_whose_start_is_missing(recorded, tmp_path):
    frames = read_frames(recorded)
    part = write(tmp_path / "part.mcap", frames[first_rolling(frames) :])
    assert "already driven when it begins" in refusal(part)


def test_a_wheel_that_still_rolls_at_the_end(recorded, tmp_path):
    frames = read_frames(recorded)
    counts = (frames[-1].left, frames[-1].right)
    last = max(number for number, each in enumerate(frames) if (each.left, each.right) != counts)
    rolling = [each._replace(left_command=0.0, right_command=0.0) for each in frames[: last + 2]]
    assert "still driven when it ends" in refusal(write(tmp_path / "part.mcap", rolling))


def test_the_counts_of_two_robots(recorded, tmp_path):
    wires = ("left.robot.encoders", "right.robot.encoders")
    file = write(tmp_path / "two.mcap", read_frames(recorded), wires)
    assert "several robots: left.robot.encoders and right.robot.encoders" in refusal(file)
