"""Where dead reckoning ends beside where the robot did: what a geometry is judged by."""

from __future__ import annotations

from collections.abc import Sequence
from math import hypot, pi

from diffbotctl.calibrate.drive import Drive, whole
from diffbotctl.calibrate.geometry import Geometry
from diffbotctl.calibrate.reckoning import reckon
from diffbotctl.calibrate.umbmark import EndError


def end_error(drive: Drive, geometry: Geometry) -> EndError:
    """True end less the dead-reckoned one; its heading is nan when the true one is not known."""
    piece = whole(drive)
    x, y, heading = (float(each) for each in piece.moved - reckon(piece, geometry).end)
    return EndError(x, y, (heading + pi) % (2 * pi) - pi)


def mean_distance(drives: Sequence[Drive], geometry: Geometry) -> float:
    """Mean distance in m of the reckoned ends from the true ones."""
    ends = [end_error(drive, geometry) for drive in drives]
    return sum(hypot(end.x, end.y) for end in ends) / len(ends)
