"""The frames of a board in the recording of one drive, whose start and end were measured.

The turns of its wheels are finer than its counts: odometry knows the motors, the times of the
edges, and that a wheel which coasts past a reversal is counted in the wrong direction. Its estimate
of a wheel's travel has about a third of the error of the count.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from math import pi
from pathlib import Path

import numpy as np

from diffbotctl.blocks.odometry import OdometryBlock
from diffbotctl.calibrate.csv_table import unusable_log
from diffbotctl.calibrate.dead_reckoning import Floats
from diffbotctl.config.robot import SIDES, Robot, field_value
from diffbotctl.errors import ConfigurationError, RunError, join_words
from diffbotctl.messages import Encoders
from diffbotctl.recording.reader import RecordingReader
from diffbotctl.recording.run_metadata import check_replayable
from diffbotctl.replay.recorded_run import recorded_configuration
from diffbotctl.runs.build_graph import build_block
from diffbotctl.time import SECOND

TICK_RATIO = 0.3  # error of the estimate to that of the count
REST_NS = SECOND // 5  # without a count, after which a wheel stands: at 5 cm/s they come as often


def read_frames(path: Path, robot: Robot | None = None) -> list[Encoders]:
    """All frames of the drive in the recording at `path`.

    `robot`: whose counts per turn are used. Raises UsageError for a recording that is of several
    robots, of a board that restarted, of encoders with other slots, or of a part of a drive.
    """
    reader = RecordingReader(path)
    frames: dict[str, list[Encoders]] = {}
    try:
        for item in reader.messages():
            if item.from_driver and isinstance(item.message, Encoders):
                frames.setdefault(item.wire, []).append(item.message)
    except RunError as error:
        raise unusable_log(path, f"cannot be read: {error.problems[0].cause}") from error
    if len(frames) > 1:
        wires = join_words(sorted(frames), "and")
        raise unusable_log(path, f"contains the counts of several robots: {wires}")
    drive = next(iter(frames.values()), [])
    if len({frame.boot for frame in drive}) > 1:
        raise unusable_log(path, "the board and its counts restarted during this drive")
    _refuse_part(path, drive, reader.cut)
    if robot is not None:
        _refuse_other_slots(path, reader.about, robot)
    return drive


def _refuse_part(path: Path, frames: Sequence[Encoders], cut: str | None) -> None:
    """Refuse a drive whose measured start or end is not that of the recording."""
    if not frames:
        return
    first, last = frames[0], frames[-1]
    if first.left_command or first.right_command:
        cause = "the wheels were already driven when it begins: the start of the drive is missing"
        raise unusable_log(path, cause)
    before = next((frame for frame in reversed(frames) if frame.time <= last.time - REST_NS), first)
    is_moving = (before.left, before.right) != (last.left, last.right)
    if last.left_command or last.right_command or is_moving:
        because = f" ({cut})" if cut else ""
        cause = (
            f"the wheels were still driven when it ends{because}: the end of the drive is missing"
        )
        raise unusable_log(path, cause)


def _refuse_other_slots(path: Path, about: Mapping[str, str], robot: Robot) -> None:
    try:
        check_replayable(about)
        with recorded_configuration(path, about) as configuration:
            recorded = configuration.robot
    except (ValueError, ConfigurationError):
        return  # its files are not in it, or of a version that cannot be read
    if recorded is None:
        return
    for side in SIDES:
        field = f"drive.{side}.encoder.slots"
        was, stated = field_value(recorded, field), field_value(robot, field)
        if was != stated:
            cause = (
                f"was recorded with {was} counts per turn of the {side} wheel, but the robot file "
                f"states {stated}: is it of another robot?"
            )
            raise unusable_log(path, cause)


def estimated_turns(frames: Sequence[Encoders], robot: Robot) -> Floats:
    """(frames, 2): turns of the right and left wheel since the first frame."""
    block = build_block(OdometryBlock, robot, imu=None)
    block.reset()
    turns = np.zeros((len(frames), 2))
    start = np.zeros(2)
    lengths = [pi * side.wheel.diameter for side in (robot.drive.right, robot.drive.left)]
    for number, frame in enumerate(frames):
        block.react(frame.time, frame)
        assert block.wheels is not None
        left, right = block.wheels
        if number:
            turns[number] = (right.travel, left.travel)
            start += (right.start_correction, left.start_correction)
    # A better estimate of the phase at the start belongs to the first motion.
    turns[1:2] += start
    return np.asarray(np.cumsum(turns, axis=0) / lengths)
