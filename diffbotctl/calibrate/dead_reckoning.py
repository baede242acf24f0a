"""Where dead reckoning ends beside where the robot did: what a geometry is judged by.

Dead reckoning of a stretch, how its end depends on the geometry, and how unsure it is.

Steps are chords at the middle heading. The wheels' slip is a random walk: its variance grows with
the way rolled, so each bit of way moves the end independently, and the covariance is the sum of
those movements (Chong & Kleeman, "Accurate odometry and error modelling for a mobile robot", ICRA
1997). Counting and the true poses themselves add theirs.
"""

from __future__ import annotations

from collections.abc import Sequence
from math import hypot, pi
from typing import NamedTuple

import numpy as np

from diffbotctl.calibrate.geometry import Geometry
from diffbotctl.calibrate.recorded_drive import Floats, RecordedDrive, Segment, whole_drive
from diffbotctl.calibrate.umbmark import EndError


def end_error(drive: RecordedDrive, geometry: Geometry) -> EndError:
    """True end less the dead-reckoned one; its heading is nan when the true one is not known."""
    piece = whole_drive(drive)
    x, y, heading = (float(each) for each in piece.moved - dead_reckon(piece, geometry).end)
    return EndError(x, y, (heading + pi) % (2 * pi) - pi)


def mean_distance(drives: Sequence[RecordedDrive], geometry: Geometry) -> float:
    """Mean distance in m of the reckoned ends from the true ones."""
    ends = [end_error(drive, geometry) for drive in drives]
    return sum(hypot(end.x, end.y) for end in ends) / len(ends)


SLIP = 0.0005  # m per square root of m, each wheel on a hard floor: only shares out the weights
UNIFORM = 1 / 12  # variance of an error spread evenly over one tick, in ticks squared


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
    covariance = _truth(stretch, end)
    for which, bit in enumerate((right, left)):
        covariance += SLIP**2 * (bit * np.abs(ways[:, which])) @ bit.T
        phase = UNIFORM * (stretch.tick[which] * geometry[which]) ** 2
        covariance += phase * (np.outer(bit[:, 0], bit[:, 0]) + np.outer(bit[:, -1], bit[:, -1]))
    return DeadReckoned(end, slope, covariance)


def _truth(stretch: Segment, end: Floats) -> Floats:
    """Covariance that the two true poses bring; the first one's heading swings the whole."""
    position, heading = stretch.truth.position**2, stretch.truth.heading**2
    swing = np.array([-end[1], end[0], 1.0])
    return np.diag([2 * position, 2 * position, heading]) + heading * np.outer(swing, swing)
