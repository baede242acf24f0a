"""Speed against duty of both motors, of either kind of PWM driver, for one battery.

The laws are those of `control/motor_curve.py`. Where the driver shorts the windings between two
pulses (slow decay), a wheel that friction brakes with the duty `static` settles at

    speed = gain * (duty * (1 - sag * duty) - static)

if both motors run at the same duty: the current, and with it the drop of the battery, grows with
the duty. So the sag, which both motors share, is fitted with the rest. A sag that no battery has is
the bend of another law, such as of a bridge that takes a voltage of its own: then a line is as
good, and its residuals and an unknown sag are parts of the standard deviations.

Where the driver opens between two pulses (fast decay, as an L298N with the PWM on its enable pin),
no current brakes the motor there, and it settles at

    speed = gain * (duty - static) / (duty + viscous)

There the current does not grow with the duty: it balances friction, which hardly depends on the
speed. So the battery drops by about the same at all duties, which divides `static` and multiplies
`gain` by the share that is left, and no speed shows it: a usual drop is assumed. What it changes,
and what a `viscous` of each motor's own would, are parts of the standard deviations.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from math import hypot
from typing import NamedTuple

import numpy as np

from diffbotctl.calibrate.dead_reckoning import Floats
from diffbotctl.config.robot import Decay
from diffbotctl.control.motor_curve import LAG_DUTY, MotorCurve

# The parameter that both motors share: sag or viscous friction. Beyond these limits the motors
# follow another law: a line is as good, unless the law of fast decay is far better even at a limit.
# The inductance of the windings takes duty at low speeds and makes `viscous` look negative.
SHARED_MIN, SHARED_MAX = -0.02, {"slow": 0.14, "fast": 0.30}
SHARED_STEP = 0.001
SPEED_SD_RATIO_MIN = 0.0007  # of a mean speed: ripple of the gears over the last, unfinished turn
DERIVATIVE_STEP = 1e-5
# Of the battery's voltage at rest that both stalled motors would take, assumed for small robots
# where no speed shows it: motors of 1 A and batteries of 0.2 to 0.5 ohm at 6 V.
USUAL_STALL_DROP = 0.10
UNKNOWN_SAG_SD = 0.05  # relative, of the speed at full duty, where the sag is not seen
# The law of fast decay is simpler than a motor: of six simulated ones its friction was wrong by up
# to 0.012, 0.006 in the mean square.
FAST_STATIC_SD_MIN = 0.006
# Lag of the speed that the loop gives a wheel with fast decay: that of usual motors. Simulated ones
# with few slots started in bursts without, and 8 of 52 goals were not reached; with it, one.
LOOP_LAG_S = 0.09
# The sum of the squared errors of the law that is chosen, over that of the other one, at most. The
# simulated motors of both kinds are below 0.1.
CERTAIN_RATIO_MAX = 0.25


class FittedMotor(NamedTuple):
    """One motor, without the drop of the battery."""

    static: float  # duty at which friction just stops it
    rated: float  # rad/s at full duty and the battery's voltage at rest
    static_sd: float
    rated_sd: float
    decay: Decay | None = None  # of the current between two pulses; None: the speeds do not show it
    viscous: float = 0.0
    """with fast decay: friction that grows with the speed, in stall torques at the no-load speed"""
    loaded: float | None = None
    """rad/s at full duty under the load of both motors, where that is not a line's"""

    def law(self, lag: float = 1.0) -> MotorCurve:
        """Its motion by the duty, with the stated `lag` (s)."""
        viscous = self.viscous if self.decay == "fast" else None
        return MotorCurve(self.static, self.rated, lag, viscous)

    def gain_for(self, lag: float) -> float:
        """Proportional gain (duty per rad/s) that a motor with the stated `lag` (s) needs; 0 where
        the slope of its feed-forward is enough.

        With fast decay nothing but friction brakes a wheel at a low duty, so that its speed is the
        integral of the duty beyond friction: the loop alone gives it a lag, this one.
        """
        return LAG_DUTY * lag / (self.rated * LOOP_LAG_S) if self.decay == "fast" else 0.0

    def wider(self, static_sd: float, rated_sd: float) -> FittedMotor:
        """The motor with further errors of these standard deviations."""
        return self._replace(
            static_sd=hypot(self.static_sd, static_sd), rated_sd=hypot(self.rated_sd, rated_sd)
        )

    def with_duty_sd(self, sd: float) -> FittedMotor:
        """The motor if all duties share an error of this standard deviation."""
        return self.wider(sd, sd * self.rated / (1 - self.static))


class _CurveFit(NamedTuple):
    """Both motors by one law."""

    decay: Decay
    shared: float
    error: float  # sum of the squared relative errors

    @property
    def is_within(self) -> bool:
        """Whether the shared parameter is between its limits."""
        margin = SHARED_STEP / 2
        return SHARED_MIN + margin < self.shared < SHARED_MAX[self.decay] - margin


def fit_curves(
    points: Mapping[str, Sequence[tuple[float, float]]], is_shorted: bool = False
) -> dict[str, FittedMotor]:
    """The curves of all motors, from (duty, rad/s) by motor, at equal duties of both.

    `is_shorted`: the driver shorts the windings between two pulses; else the speeds decide. Empty
    if these motors follow another law, of which a line is as good a description.
    """
    tables = [np.abs(np.array(rows, dtype=float)) for rows in points.values()]
    tables = [table[table[:, 1] > 0.0] for table in tables]
    slow, fast = _best_fit(tables, "slow"), _best_fit(tables, "fast")
    is_fast = not is_shorted and fast.error < CERTAIN_RATIO_MAX * slow.error
    is_slow = is_shorted or slow.error < CERTAIN_RATIO_MAX * fast.error
    if is_fast:
        curves = _fast_curves(tables)
    elif slow.is_within:
        # Of motors that show no difference the simpler law is as good.
        curves = _curves(tables, slow, "slow" if is_slow else None)
    elif is_shorted:
        line = _CurveFit("slow", 0.0, _error(tables, 0.0, "slow"))
        curves = [
            curve.wider(0.0, UNKNOWN_SAG_SD * curve.rated)
            for curve in _curves(tables, line, "slow")
        ]
    else:
        return {}
    return dict(zip(points, curves, strict=True))


def _fast_curves(tables: Sequence[Floats]) -> list[FittedMotor]:
    """Those for a usual drop of the battery; with none of it, and of each motor alone, they show
    what is not known."""
    loaded = _curves(tables, _best_fit(tables, "fast"), "fast")
    alone = [_curves([table], _best_fit([table], "fast"), "fast")[0] for table in tables]
    # The current over the stall current balances friction at full duty.
    currents = [
        curve.static + curve.viscous * (1 - curve.static) / (1 + curve.viscous) for curve in loaded
    ]
    supply = 1 - USUAL_STALL_DROP * sum(currents) / len(currents)
    curves = []
    for curve, own in zip(loaded, alone, strict=True):
        best = _at_rest(curve, supply)
        statics, rateds = (
            [getattr(other, name) - getattr(best, name) for other in (curve, _at_rest(own, supply))]
            for name in ("static", "rated")
        )
        curves.append(best.wider(hypot(FAST_STATIC_SD_MIN, *statics), hypot(*rateds)))
    return curves


def _at_rest(curve: FittedMotor, supply: float) -> FittedMotor:
    """`curve` at the battery's voltage at rest, of which it was measured at the share `supply`."""
    static = curve.static * supply
    rated = curve.rated / supply * (1 - static) / (1 - curve.static)
    return curve._replace(static=static, rated=rated, loaded=curve.rated)


def _best_fit(tables: Sequence[Floats], decay: Decay) -> _CurveFit:
    grid = np.arange(SHARED_MIN, SHARED_MAX[decay] + SHARED_STEP, SHARED_STEP)
    fits = (_CurveFit(decay, float(each), _error(tables, each, decay)) for each in grid)
    return min(fits, key=lambda fit: fit.error)


def _error(tables: Sequence[Floats], shared: float, decay: Decay) -> float:
    """Sum of the squared relative errors of all motors."""
    return sum(_line(table, shared, decay)[1] for table in tables)


def _curves(tables: Sequence[Floats], fit: _CurveFit, decay: Decay | None) -> list[FittedMotor]:
    covariance = _covariance(tables, fit)
    full = 1.0 if fit.decay == "slow" else 1.0 + fit.shared
    curves = []
    for number, table in enumerate(tables):
        gain, offset = (float(value) for value in _line(table, fit.shared, fit.decay)[0])
        rows = [0, 1 + 2 * number, 2 + 2 * number]
        # static = -offset / gain, rated = (gain + offset) / full
        block = covariance[np.ix_(rows, rows)]
        rated = (gain + offset) / full
        by_static = np.array([0.0, offset / gain**2, -1 / gain])
        by_rated = np.array([0.0 if fit.decay == "slow" else -rated / full, 1 / full, 1 / full])
        curves.append(
            FittedMotor(
                -offset / gain,
                rated,
                float(np.sqrt(by_static @ block @ by_static)),
                float(np.sqrt(by_rated @ block @ by_rated)),
                decay,
                fit.shared if fit.decay == "fast" else 0.0,
            )
        )
    return curves


def _line(table: Floats, shared: float, decay: Decay) -> tuple[Floats, float]:
    """Gain and offset (rad/s) for a given shared parameter, and the sum of the squared relative
    errors."""
    matrix, speeds = _system(table, shared, decay)
    solution = np.linalg.lstsq(matrix, speeds, rcond=None)[0]
    residuals = speeds - matrix @ solution
    return np.asarray(solution), float(residuals @ residuals)


def _system(table: Floats, shared: float, decay: Decay) -> tuple[Floats, Floats]:
    """Rows are divided by the speed: its error is relative."""
    duty, speed = table.T
    if decay == "slow":
        columns = [duty * (1 - shared * duty), np.ones_like(duty)]
    else:
        columns = [duty / (duty + shared), 1 / (duty + shared)]
    return np.asarray(np.stack(columns, axis=1) / speed[:, None]), np.ones_like(speed)


def _covariance(tables: Sequence[Floats], fit: _CurveFit) -> Floats:
    """Of the shared parameter, and of gain and offset of each motor."""
    count = sum(len(table) for table in tables)
    size = 1 + 2 * len(tables)
    jacobian = np.zeros((count, size))
    first = 0
    for number, table in enumerate(tables):
        matrix, _ = _system(table, fit.shared, fit.decay)
        solution = _line(table, fit.shared, fit.decay)[0]
        changed = _system(table, fit.shared + DERIVATIVE_STEP, fit.decay)[0]
        rows = slice(first, first + len(table))
        jacobian[rows, 0] = (changed - matrix) @ solution / DERIVATIVE_STEP
        jacobian[rows, 1 + 2 * number : 3 + 2 * number] = matrix
        first += len(table)
    variance = max(fit.error / max(count - size, 1), SPEED_SD_RATIO_MIN**2)
    return np.asarray(np.linalg.inv(jacobian.T @ jacobian) * variance)
