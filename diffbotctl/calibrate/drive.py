"""A drive that was recorded: what the wheels counted, and where the robot really was."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from itertools import pairwise
from math import pi
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from diffbotctl.calibrate.geometry import Geometry

Floats: TypeAlias = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class Truth:
    """How well the true poses are known: standard deviations of one of them."""

    position: float
    """m, along each axis"""
    heading: float
    """rad"""


CAMERAS = Truth(position=0.001, heading=0.0035)  # motion capture of a robot: 1 mm, 0.2 degrees
TAPE = Truth(position=0.002, heading=0.0175)  # a tape and a set square on the floor: 2 mm, 1 degree


@dataclass(frozen=True, slots=True)
class Drive:
    """One recorded run. Rows may be at any rate; where few poses are known, only some have one."""

    name: str
    turns: Floats
    """(rows, 2): turns of the right and left wheel since the first row, forward positive"""
    rows: NDArray[np.intp]
    """(poses,): the rows at which the true pose is known, rising"""
    poses: Floats
    """(poses, 3): true x, y in m and unwrapped heading in rad; a heading may be nan, but only the
    last one of a drive with two poses"""
    tick: tuple[float, float]
    """turns of the right and left wheel from one count to the next"""
    truth: Truth

    def swapped(self) -> Drive:
        """The same with the columns of the wheels exchanged."""
        return replace(self, turns=self.turns[:, ::-1], tick=self.tick[::-1])


@dataclass(frozen=True, slots=True)
class Stretch:
    """A piece of a drive between two known poses."""

    ways: Floats
    """(steps, 2): what each wheel rolled in each step, in turns times pi: times diameter it is m"""
    moved: Floats
    """(3,): true x, y in m and heading in rad of the end, in the frame of the beginning"""
    tick: tuple[float, float]
    """what one count is, in turns times pi"""
    truth: Truth


def stretches(drive: Drive, nominal: Geometry, length: float) -> list[Stretch]:
    """The drive cut into pieces in which a wheel rolls about `length` m; the rest joins the last.

    Raises ValueError when fewer than two poses are known.
    """
    if len(drive.rows) < 2:
        raise ValueError(f"{drive.name}: a beginning and an end pose are needed")
    return [_stretch(drive, first, last) for first, last in _cuts(drive, nominal, length)]


def _cuts(drive: Drive, nominal: Geometry, length: float) -> Iterator[tuple[int, int]]:
    steps = np.abs(np.diff(drive.turns, axis=0)).mean(axis=1) * pi * nominal.mean
    rolled = np.concatenate(([0.0], np.cumsum(steps)))[drive.rows]
    pieces = max(1, int((rolled[-1] - rolled[0]) / length))
    marks = rolled[0] + np.arange(1, pieces) * (rolled[-1] - rolled[0]) / pieces
    inner = np.searchsorted(rolled, marks)
    bounds = sorted({0, *map(int, inner), len(rolled) - 1})
    yield from pairwise(bounds)


def _stretch(drive: Drive, first: int, last: int) -> Stretch:
    ways = np.diff(drive.turns[drive.rows[first] : drive.rows[last] + 1], axis=0) * pi
    began, ended = drive.poses[first], drive.poses[last]
    cosine, sine = np.cos(began[2]), np.sin(began[2])
    x, y, heading = ended - began
    moved = np.array([cosine * x + sine * y, cosine * y - sine * x, heading])
    return Stretch(ways, moved, (drive.tick[0] * pi, drive.tick[1] * pi), drive.truth)
