"""UMBmark: wheel ratio and track from squares driven both ways round.

Source: Borenstein & Feng, "Measurement and correction of systematic odometry errors in mobile
robots", IEEE Trans. Robotics and Automation 12(6), 1996, 869-880; headings after Jung & Chung,
Int. J. Advanced Robotic Systems 8(6), 2011. Frame: the start pose, first side along +x, x forward,
y left, heading counter-clockwise. An error is what is true minus what odometry says.

Two angles carry it: alpha is what a quarter turn misses (rad, above 0 when the true track is larger
than the one in use), beta is the heading gained along a side (rad, above 0 when the right wheel is
larger than in use). To first order they move the end of a square with side L by
    clockwise          (-2 L alpha - 2 L beta, -2 L alpha - 2 L beta)
    counter-clockwise  (-2 L alpha + 2 L beta, +2 L alpha - 2 L beta)
so they are told apart only by driving both ways.
"""

from __future__ import annotations

from collections.abc import Sequence
from math import copysign, cos, hypot, pi, sin
from typing import NamedTuple

from diffbotctl.calibrate.geometry import Geometry

SIDES = 4
QUARTER = pi / 2  # rad; one turn on the spot


class EndError(NamedTuple):
    """Where one square ended, true minus odometry, in the frame of its start."""

    x: float
    """m"""
    y: float
    """m"""
    heading: float = 0.0
    """rad, counter-clockwise; only the heading rule reads it"""


class Angles(NamedTuple):
    """What the squares came to, rad."""

    alpha: float
    """missed by each quarter turn"""
    beta: float
    """gained along each side, to the left"""


def mean(ends: Sequence[EndError]) -> EndError:
    """Centre of gravity of one direction's ends. Raises ValueError when there are none."""
    if not ends:
        raise ValueError("UMBmark needs at least one run in each direction")
    count = len(ends)
    return EndError(*(sum(column) / count for column in zip(*ends, strict=True)))


def systematic_error(clockwise: Sequence[EndError], counter: Sequence[EndError]) -> float:
    """E_max,syst in m: the further of the two centres of gravity from no error at all."""
    return max(hypot(end.x, end.y) for end in (mean(clockwise), mean(counter)))


def from_positions(side: float, clockwise: EndError, counter: EndError) -> Angles:
    """Angles from where two mean ends lie; `side` in m.

    The x and the y equations are averaged: their second-order errors have opposite signs.
    """
    along, across = _by_x(side, clockwise, counter), _by_y(side, clockwise, counter)
    return Angles((along.alpha + across.alpha) / 2, (along.beta + across.beta) / 2)


def from_headings(clockwise: EndError, counter: EndError) -> Angles:
    """Angles from how two mean ends are turned; better than positions when sides are long."""
    return Angles(
        (clockwise.heading - counter.heading) / (2 * SIDES),
        (clockwise.heading + counter.heading) / (2 * SIDES),
    )


def look_swapped(side: float, clockwise: EndError, counter: EndError) -> bool:
    """Whether the two directions were probably taken for each other.

    Exchanging them leaves alpha by x and beta by y as they are, and turns the signs of the other
    two; so the rules contradict each other where they should agree.
    """
    along, across = _by_x(side, clockwise, counter), _by_y(side, clockwise, counter)
    agree = hypot(along.alpha - across.alpha, along.beta - across.beta)
    oppose = hypot(along.alpha + across.alpha, along.beta + across.beta)
    return agree > 2 * oppose


def corrected(geometry: Geometry, side: float, angles: Angles) -> Geometry:
    """The geometry that would have driven the square right; mean diameter kept.

    `geometry` is what odometry used during the runs. The ratio found multiplies the one in use: a
    second round that began again from equal wheels would undo the first. Raises ValueError when the
    angles are beyond what a square can tell.
    """
    # The side is the chord of an arc with radius r: half of it is r sin(beta / 2). The wheels run
    # at r + b/2 and r - b/2; both are multiplied by sin(beta / 2) here, since r may be infinite.
    chord, half = side / 2, geometry.track / 2 * sin(angles.beta / 2)
    if angles.alpha >= QUARTER or abs(half) >= chord:
        raise ValueError("these end points are too far off for squares of that size")
    track_ratio = QUARTER / (QUARTER - angles.alpha)
    wheel_ratio = (chord + half) / (chord - half)
    return geometry.reshaped(geometry.ratio * wheel_ratio, geometry.track * track_ratio)


def square_end(side: float, used: Geometry, true: Geometry, clockwise: bool) -> EndError:
    """Exact end error of a square that odometry with `used` geometry thinks it drove perfectly.

    Every side is a true arc, every turn a true turn about a point near the middle; `side` in m.
    """
    right, left = true.right / used.right, true.left / used.left
    turn = copysign(QUARTER * used.track / 2, -1 if clockwise else 1)
    x = y = heading = 0.0
    for _ in range(SIDES):
        for right_way, left_way in ((side * right, side * left), (turn * right, -turn * left)):
            turned = (right_way - left_way) / true.track
            chord = (right_way + left_way) / 2 * _chord_over_arc(turned)
            x += chord * cos(heading + turned / 2)
            y += chord * sin(heading + turned / 2)
            heading += turned
    return EndError(x, y, heading - copysign(2 * pi, turn))


def _chord_over_arc(turned: float) -> float:
    return sin(turned / 2) / (turned / 2) if turned else 1.0


def _by_x(side: float, clockwise: EndError, counter: EndError) -> Angles:
    scale = -4 * side
    return Angles((clockwise.x + counter.x) / scale, (clockwise.x - counter.x) / scale)


def _by_y(side: float, clockwise: EndError, counter: EndError) -> Angles:
    scale = -4 * side
    return Angles((clockwise.y - counter.y) / scale, (clockwise.y + counter.y) / scale)
