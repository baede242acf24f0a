"""Limits of a body velocity and of its rate of change."""

from __future__ import annotations

from typing import NamedTuple

# Ratio of the forward speed to the speed of a wheel in a turn on the spot at the same rate. With 1
# the robot turns about its inner wheel.
TURN_RATIO_MAX = 1.2


def is_turn(linear: float, angular: float, track: float) -> bool:
    """Whether a velocity (m/s, rad/s) is a turn: on the spot, or about the inner wheel.

    `track` in m. In a curve, the inner wheel goes forward with the outer one.
    """
    return abs(linear) <= TURN_RATIO_MAX * 0.5 * track * abs(angular)


def brake_limited(
    linear: float, angular: float, speed: float, turn_rate: float
) -> tuple[float, float]:
    """The velocity scaled by one factor to |linear| <= speed and |angular| <= turn_rate."""
    scale = 1.0
    if abs(linear) > speed:
        scale = speed / abs(linear)
    if abs(angular) * scale > turn_rate:
        scale = turn_rate / abs(angular)
    return linear * scale, angular * scale


def acceleration_limited(before: float, target: float, increase: float, decrease: float) -> float:
    """The speed nearest to `target` within one step of at most `increase` away from zero or
    `decrease` towards it.

    A change of sign takes one step at zero.
    """
    if before < 0.0:
        return -acceleration_limited(-before, -target, increase, decrease)
    if target >= before:
        return min(target, before + increase)
    lowest = before - decrease
    if before > 0.0 and target < 0.0:
        return max(lowest, 0.0)
    return max(target, -increase if before == 0.0 else lowest)


class VelocityRate(NamedTuple):
    """Limits of the rate of change of a velocity: m/s2 of each wheel, and the track in m."""

    acceleration: float
    braking: float
    track: float

    def limited(
        self, before: tuple[float, float], target: tuple[float, float], step: float
    ) -> tuple[float, float]:
        """The velocity (m/s, rad/s) nearest to `target` that is reached in `step` seconds."""
        arm = 2.0 / self.track  # angular acceleration per acceleration of the wheels
        return (
            acceleration_limited(
                before[0], target[0], self.acceleration * step, self.braking * step
            ),
            acceleration_limited(
                before[1], target[1], self.acceleration * arm * step, self.braking * arm * step
            ),
        )
