"""Dead reckoning of recorded drives, and its error relative to the true poses.

Each step is a chord at the mean heading. The slip of a wheel is a random walk whose variance grows
with the distance rolled, so each step moves the end independently, and the covariance is the sum
of these movements (Chong & Kleeman, "Accurate odometry and error modelling for a mobile robot",
ICRA 1997). The counts add errors at both ends of a drive and at each reversal of a wheel.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from enum import StrEnum
from math import ceil, hypot, pi
from typing import NamedTuple, TypeAlias

import numpy as np
from numpy.typing import NDArray

Floats: TypeAlias = NDArray[np.float64]
# In tracks. Shorter segments are dominated by the noise of the true headings, longer ones do not
# determine the mean diameter on small squares; found by cross-validation on a real session.
SEGMENT_LENGTH_TRACKS = 20.0
SEGMENT_OVERLAP = 20  # segments per length, so that the position of the first does not matter
QUANTIZATION_VARIANCE = 1 / 12  # ticks squared
# Ticks squared, of one reversal: the edge seen backward lies elsewhere than the one seen forward,
# and a wheel that coasts past the reversal is counted in the wrong direction.
REVERSAL_VARIANCE = 0.25
STEPS_MAX = 1500  # of a segment; more are merged


def wrap_angle(angle: float) -> float:
    """`angle` (rad) in -pi to pi."""
    return (angle + pi) % (2 * pi) - pi


class Geometry(NamedTuple):
    """Wheel diameters and track, all in m (or all in another unit of length)."""

    right: float  # effective diameter of the right wheel
    left: float  # effective diameter of the left wheel
    track: float  # distance between the points at which the wheels touch the ground

    @property
    def mean(self) -> float:
        """Mean wheel diameter, which determines the scale of distances."""
        return (self.right + self.left) / 2

    @property
    def ratio(self) -> float:
        """Right over left diameter, Borenstein and Feng's E_d: above 1 the robot turns left."""
        return self.right / self.left

    def reshaped(self, ratio: float, track: float) -> Geometry:
        """The same mean diameter with another `ratio` and `track`."""
        left = 2 * self.mean / (ratio + 1)
        return Geometry(ratio * left, left, track)


class EndError(NamedTuple):
    """True end minus that of odometry, in the frame of the start."""

    x: float  # m
    y: float  # m
    heading: float = 0.0  # rad, counter-clockwise; nan if not known


class GroundTruth(StrEnum):
    """How the true poses were measured."""

    MOTION_CAPTURE = "motion capture"
    TAPE_MEASURE = "tape measure"


MOTION_CAPTURE, TAPE_MEASURE = GroundTruth.MOTION_CAPTURE, GroundTruth.TAPE_MEASURE


@dataclass(frozen=True, slots=True)
class RecordedDrive:
    """One recorded drive. Rows may have any rate, and not every row needs a true pose."""

    name: str
    times: Floats  # (rows,): s, increasing
    turns: Floats
    """(rows, 2): turns of the right and left wheel since the first row, forward positive"""
    rows: NDArray[np.intp]  # (poses,): rows with a known true pose, increasing
    poses: Floats
    """(poses, 3): true x, y in m and unwrapped heading in rad; only the last heading of a drive
    with two poses may be nan"""
    tick: tuple[float, float]  # turns of the right and left wheel per count
    truth: GroundTruth

    def turns_at(self, times: Floats) -> Floats:
        """Interpolated turns (times, 2)."""
        return np.stack([np.interp(times, self.times, wheel) for wheel in self.turns.T], axis=1)


@dataclass(frozen=True, slots=True)
class Segment:
    """A part of a drive between two known poses."""

    rolled: Floats
    """(steps, 2): turns of each wheel times pi in each step; times the diameter it is m"""
    motion: Floats  # (3,): true x, y in m and heading in rad of the end, in the frame of the begin
    tick: tuple[float, float]  # turns times pi of one count
    weight: float = 1.0  # below 1 if it overlaps with others


def cut_segments(
    drive: RecordedDrive,
    diameter: float,
    length: float,
    overlap: int = SEGMENT_OVERLAP,
    count_max: int = 10**6,
) -> list[Segment]:
    """Segments in which wheels of mean `diameter` (m) roll about `length` m.

    `overlap`: segments that begin within one length; at most `count_max` in all. A shorter drive,
    or one without poses in between, is one segment. Raises ValueError if fewer than two poses are
    known.
    """
    if len(drive.rows) < 2:
        raise ValueError(f"{drive.name}: a start pose and an end pose are needed")
    steps = np.abs(np.diff(drive.turns, axis=0)).mean(axis=1) * pi * diameter
    rolled = np.concatenate(([0.0], np.cumsum(steps)))[drive.rows]
    excess = float(rolled[-1] - rolled[0]) - length
    if excess <= 0:
        return [whole_drive(drive)]
    count = min(1 + ceil(excess * overlap / length), max(count_max, 2))
    begins = rolled[0] + np.linspace(0, excess, count)
    first = np.searchsorted(rolled, begins)
    last = np.minimum(np.searchsorted(rolled, begins + length), len(rolled) - 1)
    ends = sorted({(int(a), int(b)) for a, b in zip(first, last, strict=True) if a < b})
    weight = min((excess + length) / length / max(len(ends), 1), 1.0)
    return [_segment(drive, begin, end, weight) for begin, end in ends] or [whole_drive(drive)]


def whole_drive(drive: RecordedDrive) -> Segment:
    """The drive from its first known pose to its last."""
    return _segment(drive, 0, len(drive.rows) - 1)


def _segment(drive: RecordedDrive, first: int, last: int, weight: float = 1.0) -> Segment:
    rolled = merged_steps(
        np.diff(drive.turns[drive.rows[first] : drive.rows[last] + 1], axis=0) * pi
    )
    begin, end = drive.poses[first], drive.poses[last]
    cosine, sine = np.cos(begin[2]), np.sin(begin[2])
    x, y, heading = end - begin
    motion = np.array([cosine * x + sine * y, cosine * y - sine * x, heading])
    return Segment(rolled, motion, (drive.tick[0] * pi, drive.tick[1] * pi), weight)


def merged_steps(rolled: Floats, count: int = STEPS_MAX) -> Floats:
    """The steps (steps, 2), merged into at most `count` of about the same motion."""
    if len(rolled) <= count:
        return rolled
    motion = np.cumsum(np.abs(rolled).sum(axis=1))
    parts = np.minimum((motion / max(motion[-1], 1e-12) * count).astype(int), count - 1)
    begins = np.flatnonzero(np.diff(parts, prepend=-1))
    return np.asarray(np.add.reduceat(rolled, begins, axis=0))


def drive_segments(
    drives: Sequence[RecordedDrive], geometry: Geometry, count_max: int, overlap: int
) -> list[list[Segment]]:
    """Segments of each drive; all of a drive whose end alone is known."""
    length = SEGMENT_LENGTH_TRACKS * geometry.track
    limit = max(count_max // len(drives), 1)
    return [cut_segments(drive, geometry.mean, length, overlap, limit) for drive in drives]


def flattened(groups: Sequence[Sequence[Segment]]) -> tuple[list[Segment], Floats]:
    """All segments, and weights that discount those which overlap."""
    segments = [segment for group in groups for segment in group]
    return segments, np.array([segment.weight for segment in segments])


class DeadReckoned(NamedTuple):
    """The end of a segment in the frame of its begin."""

    end: Floats  # (3,): x, y in m, heading in rad
    jacobian: Floats
    """(3, 3): derivatives of the end by right diameter, left diameter and track, all in m"""
    slip: Floats  # (3, 3): covariance of the end if each wheel slips by 1 m per square root of m
    counts: Floats  # (3, 3): covariance of the end due to the counts


def dead_reckon(segment: Segment, geometry: Geometry) -> DeadReckoned:
    """Dead-reckon `segment` with `geometry`."""
    distances = segment.rolled * (geometry.right, geometry.left)
    turned = (distances[:, 0] - distances[:, 1]) / geometry.track
    headings = np.cumsum(turned)
    middle = headings - turned / 2
    chord = distances.mean(axis=1) * np.sinc(turned / (2 * np.pi))
    x, y = np.cumsum(chord * np.cos(middle)), np.cumsum(chord * np.sin(middle))
    end = np.array([x[-1], y[-1], headings[-1]])
    # Derivatives of the end by a rotation at the middle of each step, which turns all later steps.
    x_middle, y_middle = x - chord * np.cos(middle) / 2, y - chord * np.sin(middle) / 2
    rotation = np.stack([y_middle - y[-1], x[-1] - x_middle, np.ones_like(x)])
    translation = np.stack([np.cos(middle), np.sin(middle), np.zeros_like(x)]) / 2
    wheels = (translation + rotation / geometry.track, translation - rotation / geometry.track)
    by_track = -(rotation @ turned) / geometry.track
    jacobian = np.stack(
        [
            *(wheel @ rolled for wheel, rolled in zip(wheels, segment.rolled.T, strict=True)),
            by_track,
        ],
        axis=1,
    )
    slip, counts = np.zeros((3, 3)), np.zeros((3, 3))
    for index, wheel in enumerate(wheels):
        slip += (wheel * np.abs(distances[:, index])) @ wheel.T
        variance = (segment.tick[index] * geometry[index]) ** 2
        ends = wheel[:, [0, -1]]
        reversals = wheel[:, _reversals(segment.rolled[:, index])]
        counts += QUANTIZATION_VARIANCE * variance * ends @ ends.T
        counts += REVERSAL_VARIANCE * variance * reversals @ reversals.T
    return DeadReckoned(end, jacobian, slip, counts)


def _reversals(rolled: Floats) -> NDArray[np.intp]:
    """The steps at which a wheel begins to turn in the other direction."""
    moving = np.flatnonzero(rolled)
    signs = np.sign(rolled[moving])
    return np.asarray(moving[1:][signs[1:] != signs[:-1]])


def end_error(drive: RecordedDrive, geometry: Geometry) -> EndError:
    """The end error of dead reckoning; its heading is nan if the true one is not known."""
    segment = whole_drive(drive)
    x, y, heading = map(float, segment.motion - dead_reckon(segment, geometry).end)
    return EndError(x, y, wrap_angle(heading))


def mean_distance(drives: Sequence[RecordedDrive], geometry: Geometry) -> float:
    """Mean distance in m of the dead-reckoned ends from the true ones."""
    errors = [end_error(drive, geometry) for drive in drives]
    return sum(hypot(error.x, error.y) for error in errors) / len(errors)
