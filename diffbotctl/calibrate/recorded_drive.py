"""A drive that was recorded: what the wheels counted, and where the robot really was."""

from __future__ import annotations

from dataclasses import dataclass, replace
from math import ceil, pi
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from diffbotctl.calibrate.geometry import Geometry

Floats: TypeAlias = NDArray[np.float64]
OVERLAP = 20  # pieces begun in the length of one: where the first begins must not matter


@dataclass(frozen=True, slots=True)
class GroundTruth:
    """How well the true poses are known: standard deviations of one of them."""

    position: float
    """m, along each axis"""
    heading: float
    """rad"""


CAMERAS = GroundTruth(
    position=0.001, heading=0.0035
)  # motion capture of a robot: 1 mm, 0.2 degrees
TAPE = GroundTruth(
    position=0.002, heading=0.0175
)  # a tape and a set square on the floor: 2 mm, 1 degree


@dataclass(frozen=True, slots=True)
class RecordedDrive:
    """One recorded run. Rows may be at any rate; where few poses are known, only some have one."""

    name: str
    times: Floats
    """(rows,): s, rising"""
    turns: Floats
    """(rows, 2): turns of the right and left wheel since the first row, forward positive"""
    rows: NDArray[np.intp]
    """(poses,): the rows at which the true pose is known, rising"""
    poses: Floats
    """(poses, 3): true x, y in m and unwrapped heading in rad; a heading may be nan, but only the
    last one of a drive with two poses"""
    tick: tuple[float, float]
    """turns of the right and left wheel from one count to the next"""
    truth: GroundTruth

    def swapped(self) -> RecordedDrive:
        """The same with the columns of the wheels exchanged."""
        return replace(self, turns=self.turns[:, ::-1], tick=self.tick[::-1])


@dataclass(frozen=True, slots=True)
class Segment:
    """A piece of a drive between two known poses."""

    ways: Floats
    """(steps, 2): what each wheel rolled in each step, in turns times pi: times diameter it is m"""
    moved: Floats
    """(3,): true x, y in m and heading in rad of the end, in the frame of the beginning"""
    tick: tuple[float, float]
    """what one count is, in turns times pi"""
    truth: GroundTruth


def segments(drive: RecordedDrive, nominal: Geometry, length: float) -> list[Segment]:
    """Pieces of the drive in each of which the wheels roll about `length` m, overlapping.

    A drive that is shorter, or has no pose in between, is one piece. Raises ValueError when fewer
    than two poses are known.
    """
    if len(drive.rows) < 2:
        raise ValueError(f"{drive.name}: a beginning and an end pose are needed")
    return [_stretch(drive, first, last) for first, last in _cuts(drive, nominal, length)]


def whole_drive(drive: RecordedDrive) -> Segment:
    """The drive from its first known pose to its last."""
    return _stretch(drive, 0, len(drive.rows) - 1)


def _cuts(drive: RecordedDrive, nominal: Geometry, length: float) -> list[tuple[int, int]]:
    steps = np.abs(np.diff(drive.turns, axis=0)).mean(axis=1) * pi * nominal.mean
    rolled = np.concatenate(([0.0], np.cumsum(steps)))[drive.rows]
    spare = float(rolled[-1] - rolled[0]) - length
    if spare <= 0:
        return [(0, len(rolled) - 1)]
    begins = rolled[0] + np.linspace(0, spare, 1 + ceil(spare * OVERLAP / length))
    first = np.searchsorted(rolled, begins)
    last = np.minimum(np.searchsorted(rolled, begins + length), len(rolled) - 1)
    return sorted({(int(a), int(b)) for a, b in zip(first, last, strict=True) if a < b})


def _stretch(drive: RecordedDrive, first: int, last: int) -> Segment:
    ways = np.diff(drive.turns[drive.rows[first] : drive.rows[last] + 1], axis=0) * pi
    began, ended = drive.poses[first], drive.poses[last]
    cosine, sine = np.cos(began[2]), np.sin(began[2])
    x, y, heading = ended - began
    moved = np.array([cosine * x + sine * y, cosine * y - sine * x, heading])
    return Segment(ways, moved, (drive.tick[0] * pi, drive.tick[1] * pi), drive.truth)
