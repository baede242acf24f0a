"""Limits of a body velocity and of its rate of change."""

from __future__ import annotations


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
