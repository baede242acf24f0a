"""Motion from rest to rest: shortest times, approach speeds, and prediction of the motion."""

from collections.abc import Iterable
from math import atan2, copysign, exp, hypot, pi, sqrt
from typing import NamedTuple

from diffbotctl.messages import Odometry
from diffbotctl.time import SECOND


class MotionLimits(NamedTuple):
    """Limits: m/s, rad/s, acceleration and braking of each wheel in m/s2, track in m."""

    speed: float
    turn_rate: float
    acceleration: float
    braking: float
    track: float


def ramp_time(distance: float, speed: float, acceleration: float, braking: float) -> float:
    """Time (s) from rest to rest over `distance` with a trapezoidal or triangular profile."""
    distance = abs(distance)
    slopes = 1.0 / acceleration + 1.0 / braking
    if speed * speed * slopes >= 2.0 * distance:
        return sqrt(2.0 * distance * slopes)
    return distance / speed + 0.5 * speed * slopes


def turn_time(angle: float, limits: MotionLimits) -> float:
    """Time (s) to turn on the spot by `angle` (rad): each wheel travels half the track times it."""
    arm = 0.5 * limits.track
    return ramp_time(
        angle * arm,
        min(limits.speed, limits.turn_rate * arm),
        limits.acceleration,
        limits.braking,
    )


def drive_time(distance: float, limits: MotionLimits) -> float:
    """Time (s) to drive `distance` (m) straight."""
    return ramp_time(distance, limits.speed, limits.acceleration, limits.braking)


def shortest_turn(angle: float) -> float:
    """`angle` wrapped to (-pi, pi]."""
    turned = (angle + pi) % (2.0 * pi) - pi
    return pi if turned == -pi else turned


def legs(x: float, y: float, heading: float | None, backwards: bool) -> tuple[float, float, float]:
    """First turn (rad), distance (m, negative backwards), last turn (rad) to a goal in base_link.

    Without a heading the last turn is 0.
    """
    way = hypot(x, y)
    bearing = atan2(y, x) if way > 0.0 else 0.0
    first = shortest_turn(bearing + pi if backwards else bearing) if way > 0.0 else 0.0
    last = 0.0 if heading is None else shortest_turn(heading - first)
    return first, -way if backwards else way, last


def rest_to_rest_time(
    x: float, y: float, heading: float | None, limits: MotionLimits, reverse: bool = True
) -> float:
    """Shortest time (s) to a goal in base_link; `reverse`: it may also be driven to backwards."""
    times = []
    for backwards in (False, True)[: 1 + reverse]:
        first, way, last = legs(x, y, heading, backwards)
        times.append(turn_time(first, limits) + drive_time(way, limits) + turn_time(last, limits))
    return min(times)


def stopping_turn(commanded: float, turned: float, lag: float, acceleration: float) -> float:
    """Angle (rad) by which a robot turns on, whose turn rate is to become 0.

    The `commanded` rate (rad/s) is reduced by at most `acceleration` (rad/s2); the rate `turned`
    (rad/s) follows it as a first-order system with the time constant `lag` (s), and so turns the
    robot by the integral of the command, and by its own rate times the lag.
    """
    return commanded * abs(commanded) / (2.0 * acceleration) + turned * lag


class SpeedBounds(NamedTuple):
    """Minimum and maximum speed to command (m/s), and the braking to plan with (m/s2)."""

    minimum: float
    maximum: float
    braking: float


def approach_speed(
    remaining: float, speed: float, coast_time: float, step: float, bounds: SpeedBounds
) -> float:
    """Speed (m/s) to command with `remaining` metres to go at `speed` (m/s); 0: release the motor.

    A released motor coasts by its speed times `coast_time` (s), so only the rest must be driven.
    `step` (s) is the time until the next command.
    """
    direction = copysign(1.0, remaining)
    rolling = max(direction * speed, 0.0)
    distance = abs(remaining) - rolling * coast_time
    if distance <= 0.5 * bounds.minimum * step:
        return 0.0
    target = sqrt(2.0 * bounds.braking * distance)
    if step > 0.0:
        target = min(target, rolling + distance / (step + coast_time))
    return direction * min(max(target, bounds.minimum), bounds.maximum)


class Motion(NamedTuple):
    """Predicted motion: distance and angle covered, and the speeds at the end."""

    travel: float  # m
    turn: float  # rad
    linear: float  # m/s
    angular: float  # rad/s


def predict_motion(
    odometry: Odometry, end: int, commands: Iterable[tuple[int, float, float]], lag: float
) -> Motion:
    """Predict the motion from the time of `odometry` to `end` (ns).

    `commands`: (time at which it takes effect in ns, m/s, rad/s), in order of time. The speeds
    follow the commands as a first-order system with time constant `lag` (s).
    """
    start, linear, angular = odometry.time, odometry.linear, odometry.angular
    travel = turn = linear_target = angular_target = 0.0
    for time, next_linear, next_angular in (*commands, (end, 0.0, 0.0)):
        until = min(max(time, start), end)
        seconds = (until - start) / SECOND
        decay = exp(-seconds / lag)
        travel += linear_target * seconds + (linear - linear_target) * lag * (1.0 - decay)
        turn += angular_target * seconds + (angular - angular_target) * lag * (1.0 - decay)
        linear = linear_target + (linear - linear_target) * decay
        angular = angular_target + (angular - angular_target) * decay
        start, linear_target, angular_target = until, next_linear, next_angular
    return Motion(travel, turn, linear, angular)
