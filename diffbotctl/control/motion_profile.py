"""The least time from rest to rest: turn, drive, turn, each as fast as the limits allow."""

from __future__ import annotations

from math import atan2, hypot, pi, sqrt
from typing import NamedTuple


class MotionLimits(NamedTuple):
    """What bounds a motion: m/s, rad/s, and each wheel's acceleration and braking in m/s2."""

    speed: float
    turn_rate: float
    acceleration: float
    braking: float
    track: float


def ramp_time(distance: float, speed: float, acceleration: float, braking: float) -> float:
    """Time to cover `distance` from rest to rest: a trapezoid, or a triangle when it is short."""
    distance = abs(distance)
    slopes = 1.0 / acceleration + 1.0 / braking
    if speed * speed * slopes >= 2.0 * distance:
        return sqrt(2.0 * distance * slopes)
    return distance / speed + 0.5 * speed * slopes


def turn_time(angle: float, limits: MotionLimits) -> float:
    """Time to turn on the spot by `angle` (rad): each wheel rolls half the track times it."""
    arm = 0.5 * limits.track
    return ramp_time(
        angle * arm,
        min(limits.speed, limits.turn_rate * arm),
        limits.acceleration,
        limits.braking,
    )


def drive_time(distance: float, limits: MotionLimits) -> float:
    """Time to drive `distance` (m) straight."""
    return ramp_time(distance, limits.speed, limits.acceleration, limits.braking)


def shortest_turn(angle: float) -> float:
    """`angle` brought into -pi (excluded) to pi: the short way round."""
    turned = (angle + pi) % (2.0 * pi) - pi
    return pi if turned == -pi else turned


def legs(x: float, y: float, heading: float | None, backwards: bool) -> tuple[float, float, float]:
    """First turn (rad), way (m, negative backwards) and last turn to the goal (x, y, heading) seen
    from the robot. Without a heading the last turn is 0."""
    way = hypot(x, y)
    bearing = atan2(y, x) if way > 0.0 else 0.0
    first = shortest_turn(bearing + pi if backwards else bearing) if way > 0.0 else 0.0
    last = 0.0 if heading is None else shortest_turn(heading - first)
    return first, -way if backwards else way, last


def rest_to_rest_time(
    x: float, y: float, heading: float | None, limits: MotionLimits, reverse: bool = True
) -> float:
    """The bound in seconds, the better of forwards and (with `reverse`) backwards."""
    times = []
    for backwards in (False, True)[: 1 + reverse]:
        first, way, last = legs(x, y, heading, backwards)
        times.append(turn_time(first, limits) + drive_time(way, limits) + turn_time(last, limits))
    return min(times)
