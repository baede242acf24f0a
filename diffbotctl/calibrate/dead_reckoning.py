"""Dead reckoning of recorded drives, and where it ends beside where the robot really was.

Steps are chords at the middle heading. The wheels' slip is a random walk: its variance grows with
the way rolled, so each bit of way moves the end independently, and the covariance is the sum of
those movements (Chong & Kleeman, "Accurate odometry and error modelling for a mobile robot", ICRA
1997). Counting and the true poses themselves add theirs.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from math import ceil, hypot, pi
from typing import NamedTuple, TypeAlias

import numpy as np
from numpy.typing import NDArray


class Geometry(NamedTuple):
    """Wheel diameters and track, all in m (or all in one other unit of length)."""

    right: float
    """effective diameter of the right wheel"""
    left: float
    """effective diameter of the left wheel"""
    track: float
    """distance between the places where the two wheels touch the ground"""

    @property
    def mean(self) -> float:
        """Mean wheel diameter, which sets the scale of distances."""
        return (self.right + self.left) / 2

    @property
    def ratio(self) -> float:
        """Right diameter over left, Borenstein and Feng's E_d: above 1 the robot curves left."""
        return self.right / self.left

    def reshaped(self, ratio: float, track: float) -> Geometry:
        """The same mean diameter split in another `ratio`, with another `track`."""
        left = 2 * self.mean / (ratio + 1)
        return Geometry(ratio * left, left, track)


Floats: TypeAlias = NDArray[np.float64]
SEGMENT_OVERLAP = 20  # pieces begun in the length of one: where the first begins must not matter


def wrap_angle(angle: float) -> float:
    """`angle` (rad) in -pi to pi."""
    return (angle + pi) % (2 * pi) - pi


class EndError(NamedTuple):
    """Where one square ended, true minus odometry, in the frame of its start."""

    x: float
    """m"""
    y: float
    """m"""
    heading: float = 0.0
    """rad, counter-clockwise; only the heading rule reads it"""


@dataclass(frozen=True, slots=True)
class GroundTruth:
    """How well the true poses are known: standard deviations of one of them."""

    position: float
    """m, along each axis"""
    heading: float
    """rad"""


MOTION_CAPTURE = GroundTruth(
    position=0.001, heading=0.0035
)  # motion capture of a robot: 1 mm, 0.2 degrees
TAPE_MEASURE = GroundTruth(
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
    return [_segment(drive, first, last) for first, last in _segment_rows(drive, nominal, length)]


def whole_drive(drive: RecordedDrive) -> Segment:
    """The drive from its first known pose to its last."""
    return _segment(drive, 0, len(drive.rows) - 1)


def _segment_rows(drive: RecordedDrive, nominal: Geometry, length: float) -> list[tuple[int, int]]:
    steps = np.abs(np.diff(drive.turns, axis=0)).mean(axis=1) * pi * nominal.mean
    rolled = np.concatenate(([0.0], np.cumsum(steps)))[drive.rows]
    spare = float(rolled[-1] - rolled[0]) - length
    if spare <= 0:
        return [(0, len(rolled) - 1)]
    begins = rolled[0] + np.linspace(0, spare, 1 + ceil(spare * SEGMENT_OVERLAP / length))
    first = np.searchsorted(rolled, begins)
    last = np.minimum(np.searchsorted(rolled, begins + length), len(rolled) - 1)
    return sorted({(int(a), int(b)) for a, b in zip(first, last, strict=True) if a < b})


def _segment(drive: RecordedDrive, first: int, last: int) -> Segment:
    ways = np.diff(drive.turns[drive.rows[first] : drive.rows[last] + 1], axis=0) * pi
    began, ended = drive.poses[first], drive.poses[last]
    cosine, sine = np.cos(began[2]), np.sin(began[2])
    x, y, heading = ended - began
    moved = np.array([cosine * x + sine * y, cosine * y - sine * x, heading])
    return Segment(ways, moved, (drive.tick[0] * pi, drive.tick[1] * pi), drive.truth)


SLIP_SD = 0.0005  # m per square root of m, each wheel on a hard floor: only shares out the weights
QUANTIZATION_VARIANCE = 1 / 12  # variance of an error spread evenly over one tick, in ticks squared


class DeadReckoned(NamedTuple):
    """The end of a stretch in the frame of its beginning."""

    end: Floats
    """(3,): x, y in m, heading in rad"""
    slope: Floats
    """(3, 3): end by right diameter, left diameter and track, all in m"""
    covariance: Floats
    """(3, 3): of the end less the true end"""


def dead_reckon(stretch: Segment, geometry: Geometry) -> DeadReckoned:
    """Dead-reckon `stretch` with `geometry`."""
    ways = stretch.ways * (geometry.right, geometry.left)
    turned = (ways[:, 0] - ways[:, 1]) / geometry.track
    after = np.cumsum(turned)
    middle = after - turned / 2
    chord = ways.mean(axis=1) * np.sinc(turned / (2 * np.pi))
    x, y = np.cumsum(chord * np.cos(middle)), np.cumsum(chord * np.sin(middle))
    end = np.array([x[-1], y[-1], after[-1]])
    # What a small turn at the middle of each step does to the end: it swings all that follows.
    x_middle, y_middle = x - chord * np.cos(middle) / 2, y - chord * np.sin(middle) / 2
    swing = np.stack([y_middle - y[-1], x[-1] - x_middle, np.ones_like(x)])
    push = np.stack([np.cos(middle), np.sin(middle), np.zeros_like(x)]) / 2
    right, left = push + swing / geometry.track, push - swing / geometry.track
    slope = np.stack(
        [
            right @ stretch.ways[:, 0],
            left @ stretch.ways[:, 1],
            -(swing @ turned) / geometry.track,
        ],
        axis=1,
    )
    covariance = _truth_covariance(stretch, end)
    for which, bit in enumerate((right, left)):
        covariance += SLIP_SD**2 * (bit * np.abs(ways[:, which])) @ bit.T
        phase = QUANTIZATION_VARIANCE * (stretch.tick[which] * geometry[which]) ** 2
        covariance += phase * (np.outer(bit[:, 0], bit[:, 0]) + np.outer(bit[:, -1], bit[:, -1]))
    return DeadReckoned(end, slope, covariance)


def _truth_covariance(stretch: Segment, end: Floats) -> Floats:
    """Covariance that the two true poses bring; the first one's heading swings the whole."""
    position, heading = stretch.truth.position**2, stretch.truth.heading**2
    swing = np.array([-end[1], end[0], 1.0])
    return np.diag([2 * position, 2 * position, heading]) + heading * np.outer(swing, swing)


def end_error(drive: RecordedDrive, geometry: Geometry) -> EndError:
    """True end less the dead-reckoned one; its heading is nan when the true one is not known."""
    piece = whole_drive(drive)
    x, y, heading = (float(each) for each in piece.moved - dead_reckon(piece, geometry).end)
    return EndError(x, y, wrap_angle(heading))


def mean_distance(drives: Sequence[RecordedDrive], geometry: Geometry) -> float:
    """Mean distance in m of the reckoned ends from the true ones."""
    ends = [end_error(drive, geometry) for drive in drives]
    return sum(hypot(end.x, end.y) for end in ends) / len(ends)
