"""The law from the duty of a motor to its speed, for both ways in which its current decays.

Where the driver shorts the windings between two pulses (slow decay), the speed is linear in the
duty beyond the dead band, and the lag is constant. Where it opens them (fast decay, as an L298N
with the PWM on its enable pin), no current brakes the motor between the pulses: with the duty u the
torque, in units of the stall torque, is u * (1 - speed / no-load speed) - friction. With `viscous`,
the friction that grows with the speed in shares of the stall torque at the no-load speed, the motor
settles at

    speed = rated * (1 + viscous) / (1 - static) * (u - static) / (u + viscous)

with a lag that is inversely proportional to u + viscous. Duties are 0 to 1, speeds rad/s.
"""

from __future__ import annotations

from math import copysign, exp, log
from typing import NamedTuple

# Of small brushed gear motors, which draw 5 to 10 % of their stall current without load; and the
# duty at which the lag of a motor with fast decay is the stated one.
VISCOUS, LAG_DUTY = 0.05, 0.6


def settled_speed(duty: float, static: float, rated: float) -> float:
    """Speed (rad/s) at which a motor with slow decay settles: dead band, then linear."""
    beyond = abs(duty) - static
    return copysign(beyond / (1.0 - static) * rated, duty) if beyond > 0.0 else 0.0


def lagged_motion(speed: float, settled: float, lag: float, span: float) -> tuple[float, float]:
    """Speed after `span` (s) of a wheel that approaches the speed `settled` with the time constant
    `lag` (s), and its travel. Speeds in any unit per second."""
    decay = exp(-span / lag)
    travel = settled * span + (speed - settled) * lag * (1.0 - decay)
    return settled + (speed - settled) * decay, travel


class MotorCurve(NamedTuple):
    """Motion of a motor by its duty, as far as the robot file states it."""

    static: float  # duty that just overcomes the friction
    rated: float  # rad/s at full duty
    lag: float  # s; with fast decay that at LAG_DUTY
    viscous: float | None = None  # with fast decay; None: slow decay

    def speed(self, duty: float) -> float:
        """Speed (rad/s) at which it settles with `duty`, 0 to 1."""
        return settled_speed(duty, self.static, self.rated) * self.steepness(duty)

    def duty(self, speed: float) -> float:
        """Duty at which it settles at `speed` (rad/s, 0 to `rated`)."""
        share = speed / self.rated * (1.0 - self.static)
        if self.viscous is None:
            return self.static + share
        full = 1.0 + self.viscous
        return (full * self.static + self.viscous * share) / (full - share)

    def steepness(self, duty: float) -> float:
        """Speed over that of a motor with slow decay."""
        return 1.0 if self.viscous is None else (1.0 + self.viscous) / (duty + self.viscous)

    def slowness(self, duty: float) -> float:
        """Lag over the stated one."""
        return 1.0 if self.viscous is None else LAG_DUTY / (duty + self.viscous)

    def moved(self, speed: float, duty: float, span: float) -> tuple[float, float]:
        """Speed (rad/s) after `span` (s) with a signed `duty`, and its travel (rad)."""
        size = abs(duty)
        lag = self.lag * self.slowness(size)
        if self.viscous is None or (size >= self.static and speed * duty >= 0.0):
            return lagged_motion(speed, copysign(self.speed(size), duty), lag, span)
        if not speed:
            return 0.0, 0.0
        # Hardly damped, it is stopped by the part of friction that the duty does not overcome.
        left = self.static - copysign(size, speed * duty)
        settled = copysign(left / (1.0 - self.static) * self.rated * self.steepness(size), -speed)
        span = min(span, lag * log((speed - settled) / -settled))
        after, travel = lagged_motion(speed, settled, lag, span)
        return (after if after * speed > 0.0 else 0.0), travel
