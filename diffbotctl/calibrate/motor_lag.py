"""Lag and dead time of the wheels, from steps between two duties.

The angle of a wheel continues at the previous speed until the dead time after the step has passed,
then approaches the new speed with the lag: long after, it lies on a line that crosses the earlier
one a lag and a dead time after the step. All unknowns (lags, dead time, angle and lateness of each
step, both speeds, slot errors) are found at once by Gauss-Newton least squares.

What distinguishes the dead time from the lag depends on board and driver:

- The transition from one line to the other, where the board reports when a duty took effect. A dead
  time that it does not prove is none.
- The steps up and down, where the driver opens between two pulses (fast decay): no current brakes
  such a motor in the pauses, so that its lag is longer the lower the duty, by a ratio that follows
  from the curve of the motor. The shape of such a transition is no exponential, and is not used.
- The transition again, where the board reports nothing. It applies each command to each wheel at a
  different moment, so every step has its own lateness, with a mean of zero; without these, the mean
  lateness of the sample would be fitted as lag, four times as large. Both motors have one lag.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from math import hypot, pi, sqrt
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from diffbotctl.calibrate.dead_reckoning import Floats
from diffbotctl.calibrate.motor_fit import (
    StepResponse,
    frame_positions,
    has_edge_times,
    line_slope,
    wheel_edges,
)
from diffbotctl.control.motor_curve import LAG_DUTY

SLOT_ERROR_SD_PITCHES = 0.03  # of a cut disc; the prior of the slot errors
EDGE_SD_PITCHES = 0.003  # of what the slot errors leave, at a constant speed
TRANSITION_SD_PITCHES = 0.04  # of a motor whose response is no exponential
COUNT_SD_PITCHES = 0.29  # of a position anywhere within one slot: 1 / sqrt(12)
EFFECT_SD_S = 1e-4  # of when a duty took effect, as a board reports it
SETTLED_TIME_S = 1.2  # after a step: six lags of 0.2 s, after which 0.25 % are left
BEFORE_STEP_TIME_S = 0.7  # of the motion before a step
STEP_EDGES_MIN = 8  # per step
ITERATIONS_MAX = 20
CONVERGENCE_TOLERANCE_S = 1e-5
INITIAL_LAG_S = 0.1
LAG_MIN_S, LAG_MAX_S = 0.01, 0.5
PROVEN_SDS = 3.5  # of a dead time that is not 0
# s, of a battery that drops by a tenth with both motors stalled, and recovers for half a second
# after a step: that delays the speed as a dead time does. Of simulated ones that drop by 8 and
# 20 %: 4 and 12 ms.
BATTERY_DELAY_S, BATTERY_DELAY_SD_S = 0.006, 0.006
VISCOUS_SD = 0.02  # of one motor from that of both, in stall torques at the no-load speed
KNOWN_SD_S = 1e-6  # of a dead time that is given

Shares = tuple[float, float]  # of the stated lag, those after a step up and after a step down
SAME_LAG: Shares = (1.0, 1.0)


class LagFit(NamedTuple):
    """How late a wheel follows a command, s: a dead time and then a first-order lag."""

    lag: float
    dead_time: float
    sd: float  # of their sum, or of the lag alone where it depends on the duty
    split_sd: float = 0.0
    """standard deviation of the dead time, and of the lag given the sum of both"""


def fit_lags(
    steps: Sequence[StepResponse],
    slots: Mapping[str, int],
    shares: Mapping[str, Shares],
    jitter: float | None = None,
) -> dict[str, LagFit]:
    """The lag of each wheel, as a robot file states it (at LAG_DUTY), and the dead time of both.

    `slots`: counts per turn, `shares`: SAME_LAG where it does not depend on the duty, by side.
    `jitter` (s, standard deviation): scatter of when a command takes effect, if the time of a step
    is when it was sent; None where it is when it took effect. Raises ValueError if there are too
    few edges, or they do not determine the lag.
    """
    if jitter is not None:
        wheels = [_wheel(steps, side, count, SAME_LAG) for side, count in slots.items()]
        noise = StepNoise(COUNT_SD_PITCHES, COUNT_SD_PITCHES, jitter)
        mean = _solve(wheels, noise, is_common=True)[0]
        return {side: _stated_lag(mean, shares[side]) for side in slots}
    wheels = [_wheel(steps, side, count, shares[side]) for side, count in slots.items()]
    if all(up == down for up, down in shares.values()):
        noise = StepNoise(EDGE_SD_PITCHES, TRANSITION_SD_PITCHES, EFFECT_SD_S)
        fits = _solve(wheels, noise)
        if fits[0].dead_time < PROVEN_SDS * fits[0].split_sd:
            split_sd = hypot(fits[0].dead_time, fits[0].split_sd)
            fits = [fit._replace(split_sd=split_sd) for fit in _solve(wheels, noise, dead_time=0.0)]
        return dict(zip(slots, fits, strict=True))
    noise = StepNoise(EDGE_SD_PITCHES, None, EFFECT_SD_S)
    first = _solve(wheels, noise)[0]
    dead_time = max(first.dead_time - BATTERY_DELAY_S, 0.0)
    split_sd = hypot(first.split_sd, BATTERY_DELAY_SD_S)
    fits = _solve(wheels, noise, dead_time=dead_time + BATTERY_DELAY_S)
    return {
        side: LagFit(fit.lag, dead_time, hypot(fit.sd, fit.lag * VISCOUS_SD / LAG_DUTY), split_sd)
        for side, fit in zip(slots, fits, strict=True)
    }


def _stated_lag(mean: LagFit, shares: Shares) -> LagFit:
    """The stated lag from the `mean` one of steps up and down. Where it depends on the duty, it is
    known to half of the difference."""
    stated = mean.lag * len(shares) / sum(shares)
    return mean._replace(lag=stated, sd=hypot(mean.sd, 0.5 * (stated - mean.lag)))


class StepNoise(NamedTuple):
    """Standard deviations."""

    settled: float  # pitches, of an edge at a constant speed
    transition: float | None  # pitches, of an edge between; None: these are not used
    lateness: float  # s, of a step


@dataclass
class SteppedWheel:
    """The edges of one wheel around all steps, and its own unknowns."""

    shares: Shares
    times: Floats  # (edges,): s since the step
    angles: Floats  # (edges,): rad
    steps: NDArray[np.int64]  # (edges,): number of the step
    slots: NDArray[np.int64]  # (edges,): number of the slot
    is_up: NDArray[np.bool_]  # (edges,): whether the step is up
    step_count: int
    slot_count: int
    unknowns: Floats
    """angle (rad) at each step, lateness (s) of each, speed (rad/s) at the lower and at the higher
    duty, error (rad) of each slot"""

    def predict(self, lag: float, dead_time: float) -> tuple[Floats, Floats]:
        """Angles (edges,) in rad, and their Jacobian by lag, dead time and the unknowns."""
        count = self.step_count
        start, lateness = self.unknowns[:count], self.unknowns[count : 2 * count]
        speeds, errors = self.unknowns[2 * count : 2 * count + 2], self.unknowns[2 * count + 2 :]
        sign = np.where(self.is_up, 1.0, -1.0)
        share = np.where(self.is_up, *self.shares)
        change, own = sign * (speeds[1] - speeds[0]), lag * share
        since = np.maximum(self.times - dead_time - lateness[self.steps], 0.0)
        decay = np.exp(-since / own)
        transition = since - own * (1.0 - decay)
        before = np.where(self.is_up, speeds[0], speeds[1])
        angles = start[self.steps] + before * self.times + change * transition + errors[self.slots]
        rows = np.arange(len(self.times))
        jacobian = np.zeros((len(rows), 2 + len(self.unknowns)))
        jacobian[:, 0] = change * share * (decay - 1.0 + since / own * decay)
        jacobian[:, 1] = -change * (1.0 - decay)
        jacobian[rows, 2 + self.steps] = 1.0
        jacobian[rows, 2 + count + self.steps] = jacobian[:, 1]
        jacobian[:, 2 + 2 * count] = np.where(self.is_up, self.times, 0.0) - sign * transition
        jacobian[:, 3 + 2 * count] = np.where(self.is_up, 0.0, self.times) + sign * transition
        jacobian[rows, 4 + 2 * count + self.slots] = 1.0
        return angles, jacobian

    def system(self, lag: float, dead_time: float, noise: StepNoise) -> tuple[Floats, Floats, int]:
        """The linear least squares of one iteration, each row divided by its standard deviation:
        first the edges, then the priors; and the number of edges."""
        pitch = 2 * pi / self.slot_count
        angles, jacobian = self.predict(lag, dead_time)
        is_settled = (self.times <= 0.0) | (self.times >= SETTLED_TIME_S)
        sd = pitch * np.where(is_settled, noise.settled, noise.transition or np.inf)
        used = np.isfinite(sd)
        rows, residuals = jacobian[used] / sd[used, None], (self.angles - angles)[used] / sd[used]
        prior = np.full(len(self.unknowns), np.inf)
        prior[self.step_count : 2 * self.step_count] = noise.lateness
        prior[2 * self.step_count + 2 :] = SLOT_ERROR_SD_PITCHES * pitch
        prior_rows = np.concatenate([np.zeros((len(prior), 2)), np.diag(1 / prior)], axis=1)
        return (
            np.concatenate([rows, prior_rows]),
            np.concatenate([residuals, -self.unknowns / prior]),
            len(rows),
        )


def _wheel(steps: Sequence[StepResponse], side: str, slots: int, shares: Shares) -> SteppedWheel:
    """The edges of one wheel, and first guesses from lines before and long after each step.

    Raises ValueError if there are too few edges.
    """
    is_left, pitch = side == "left", 2 * pi / slots
    rows: list[tuple[float, float, int, int, bool]] = []
    for number, step in enumerate(steps):
        if has_edge_times(step.frames):
            times, counts = wheel_edges(step.frames, is_left)
            positions: Floats = counts.astype(float)
        else:
            times, positions = frame_positions(step.frames, is_left)
        rows += [
            (time - step.time, position * pitch, number, int(position) % slots, step.is_up)
            for time, position in zip(times.tolist(), positions.tolist(), strict=True)
            if time - step.time >= -BEFORE_STEP_TIME_S
        ]
    if len(rows) < STEP_EDGES_MIN * len(steps):
        raise ValueError("too few edges around the steps")
    times, angles, numbers, places, ups = (np.array(column) for column in zip(*rows, strict=True))
    slopes: dict[bool, list[float]] = {False: [], True: []}
    start = []
    for number, step in enumerate(steps):
        own = numbers == number
        late, early = own & (times > SETTLED_TIME_S), own & (times <= 0.0)
        if late.sum() < 2 or not early.any():
            raise ValueError("too few edges around the steps")
        slopes[step.is_up].append(line_slope(times[late], angles[late]))
        start.append(early)
    speeds = [float(np.mean(slopes[up])) for up in (False, True)]
    if speeds[1] <= speeds[0]:
        raise ValueError("its speed did not increase with the duty")
    lines = angles - np.where(ups, speeds[0], speeds[1]) * times
    starts = [float(lines[early].mean()) for early in start]
    unknowns = np.array([*starts, *[0.0] * len(steps), *speeds, *[0.0] * slots])
    return SteppedWheel(shares, times, angles, numbers, places, ups, len(steps), slots, unknowns)


def _solve(
    wheels: Sequence[SteppedWheel],
    noise: StepNoise,
    is_common: bool = False,
    dead_time: float | None = None,
) -> list[LagFit]:
    """The lag of each wheel, and the dead time of both. `is_common`: both have one lag.

    `dead_time` (s): if it is known. Raises ValueError if the fit does not converge.
    """
    lag_of = [0 if is_common else number for number in range(len(wheels))]
    lags = np.full(max(lag_of) + 1, INITIAL_LAG_S)
    dead, at = dead_time or 0.0, len(lags)
    begins = at + 1 + np.cumsum([0, *(len(wheel.unknowns) for wheel in wheels)])
    for _ in range(ITERATIONS_MAX):
        normal, gradient = np.zeros((begins[-1], begins[-1])), np.zeros(begins[-1])
        normal[at, at] = 0.0 if dead_time is None else KNOWN_SD_S**-2
        chi2, freedom = 0.0, -len(gradient)
        for wheel, index, begin, end in zip(wheels, lag_of, begins, begins[1:], strict=False):
            rows, residuals, edges = wheel.system(lags[index], dead, noise)
            columns = [index, at, *range(begin, end)]
            normal[np.ix_(columns, columns)] += rows.T @ rows
            gradient[columns] += rows.T @ residuals
            chi2 += float(residuals[:edges] @ residuals[:edges])
            freedom += len(rows)
        step = np.linalg.solve(normal, gradient)
        lags = np.clip(lags + step[:at], LAG_MIN_S, LAG_MAX_S)
        dead += float(step[at])
        for wheel, begin, end in zip(wheels, begins, begins[1:], strict=False):
            wheel.unknowns = wheel.unknowns + step[begin:end]
        if np.abs(step[: at + 1]).max() < CONVERGENCE_TOLERANCE_S:
            break
    else:
        raise ValueError("the lag could not be determined from the steps")
    covariance = np.linalg.inv(normal) * max(chi2 / max(freedom, 1), 1.0)
    split_sd = sqrt(float(covariance[at, at]))
    fits = []
    for index in lag_of:
        variance = covariance[index, index] + covariance[at, at] + 2 * covariance[index, at]
        fits.append(LagFit(float(lags[index]), max(dead, 0.0), sqrt(float(variance)), split_sd))
    return fits
