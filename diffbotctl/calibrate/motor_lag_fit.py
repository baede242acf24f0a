"""Lag and dead time of wheels whose board does not report when a command took effect.

The angle of each wheel is modelled from the time at which a duty step was sent: it continues at the
previous speed until the dead time has passed, then approaches the new speed with the lag. Such a
board applies each command to each wheel at a different moment, so every step has its own lateness
beside the dead time, with a mean of zero; without these, the mean lateness of the sample would be
fitted as lag, four times as large. All unknowns are found at once by Gauss-Newton least squares.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from math import pi

import numpy as np

from diffbotctl.calibrate.dead_reckoning import Floats
from diffbotctl.calibrate.motor_fit import (
    SLOT_ERROR_SD_PITCHES,
    LagFit,
    StepEdges,
    StepResponse,
    gather_edges,
    line_slope,
)

ITERATIONS_MAX = 12
CONVERGENCE_TOLERANCE_S = 1e-5
INITIAL_LAG_S = 0.1
LAG_MIN_S = 0.01
COUNT_SD_PITCHES = 0.29  # of a position anywhere within one slot: 1 / sqrt(12)


@dataclass
class LagModel:
    """The edges of one wheel and its unknowns, which `apply_step` changes."""

    edges: StepEdges
    start: Floats
    """(steps,): rad, angle at which each step was sent"""
    lateness: Floats
    """(steps,): s, additional delay of each step"""
    speeds: Floats
    """(2,): rad/s at the lower and at the higher duty"""
    slot_errors: Floats
    """(slots,): rad"""

    def predict(self, lag: float, dead_time: float) -> tuple[Floats, Floats]:
        """Angles (edges,) in rad, and their Jacobian (edges, 2 + 2 steps + 2 + slots).

        Columns: lag, dead time, start and lateness of each step, the two speeds, slot errors.
        """
        edges = self.edges
        steps, slots = len(self.start), len(self.slot_errors)
        initial_speed = np.where(edges.is_up, self.speeds[0], self.speeds[1])
        sign = np.where(edges.is_up, 1.0, -1.0)
        change = sign * (self.speeds[1] - self.speeds[0])
        since = np.maximum(edges.times - dead_time - self.lateness[edges.steps], 0.0)
        decay = np.exp(-since / lag)
        transition = since - lag * (1.0 - decay)
        angles = self.start[edges.steps] + initial_speed * edges.times + change * transition
        angles += self.slot_errors[edges.slots]
        jacobian = np.zeros((len(edges.times), 2 + 2 * steps + 2 + slots))
        rows = np.arange(len(edges.times))
        jacobian[:, 0] = change * (decay - 1.0 + since / lag * decay)
        jacobian[:, 1] = jacobian[rows, 2 + steps + edges.steps] = -change * (1.0 - decay)
        jacobian[rows, 2 + edges.steps] = 1.0
        low, high = 2 + 2 * steps, 3 + 2 * steps
        jacobian[:, low] = np.where(edges.is_up, edges.times, 0.0) - sign * transition
        jacobian[:, high] = np.where(edges.is_up, 0.0, edges.times) + sign * transition
        jacobian[rows, 4 + 2 * steps + edges.slots] = 1.0
        return angles, jacobian

    def apply_step(self, step: Floats) -> None:
        """Add one Gauss-Newton step to the unknowns of this wheel."""
        steps = len(self.start)
        self.start += step[:steps]
        self.lateness += step[steps : 2 * steps]
        self.speeds += step[2 * steps : 2 * steps + 2]
        self.slot_errors += step[2 * steps + 2 :]


def fit_common_lag(steps: Sequence[StepResponse], slots: int, jitter: float) -> LagFit:
    """The common lag and dead time of both wheels, whose motors are of one kind.

    The time of a step is when it was sent; `jitter` (s, standard deviation) is the scatter of when
    it took effect. Raises ValueError if there are too few edges, or the fit does not converge.
    """
    wheels = [_initial_model(steps, left, slots) for left in (True, False)]
    lag, dead_time, noise = INITIAL_LAG_S, INITIAL_LAG_S, COUNT_SD_PITCHES * 2 * pi / slots
    for _ in range(ITERATIONS_MAX):
        matrix, residuals = _normalized_system(wheels, lag, dead_time, noise, jitter)
        step: Floats = np.asarray(np.linalg.lstsq(matrix, residuals, rcond=None)[0], dtype=float)
        lag, previous = max(lag + float(step[0]), LAG_MIN_S), lag
        dead_time = max(dead_time + float(step[1]), 0.0)
        for wheel, part in zip(wheels, np.split(step[2:], len(wheels)), strict=True):
            wheel.apply_step(part)
        if abs(lag - previous) + abs(step[1]) < CONVERGENCE_TOLERANCE_S:
            break
    else:
        raise ValueError("the lag could not be determined from the steps")
    covariance = np.linalg.inv(matrix.T @ matrix)
    edges = sum(len(wheel.edges.times) for wheel in wheels)
    variance = float((residuals[:edges] ** 2).sum()) / (edges - len(step))
    sum_variance = covariance[0, 0] + covariance[1, 1] + 2.0 * covariance[0, 1]
    sd, split_sd = np.sqrt(sum_variance * variance), np.sqrt(covariance[0, 0] * variance)
    return LagFit(lag, dead_time, float(sd), float(split_sd))


def _initial_model(steps: Sequence[StepResponse], left: bool, slots: int) -> LagModel:
    """First guesses from lines before and long after each step. Raises ValueError."""
    edges = gather_edges(steps, left, slots)
    times, angles, is_up = edges.times, edges.angles, edges.is_up
    masks = [edges.steps == number for number in range(len(steps))]
    late = times > INITIAL_LAG_S * 10.0
    slopes: dict[bool, list[float]] = {False: [], True: []}
    for up, mask in ((up, mask & late & (is_up == up)) for up in slopes for mask in masks):
        if mask.any():
            slopes[up].append(line_slope(times[mask], angles[mask]))
    speeds = np.array([np.mean(slopes[up]) for up in (False, True)])
    lines = angles - np.where(is_up, speeds[0], speeds[1]) * times
    early = [mask & (times < 0.0) for mask in masks]
    start = np.array([np.mean(lines[mask]) for mask in early if mask.any()])
    if len(start) < len(steps) or speeds[1] <= speeds[0]:
        raise ValueError("its speed did not increase with the duty")
    return LagModel(edges, start, np.zeros(len(steps)), speeds, np.zeros(slots))


def _normalized_system(
    wheels: Sequence[LagModel], lag: float, dead_time: float, noise: float, jitter: float
) -> tuple[Floats, Floats]:
    """The linear least squares of one iteration: first the edges, then the priors.

    Each row is divided by its standard deviation: `noise` (rad) of an edge, `jitter` (s) of a
    lateness, and that of a slot error.
    """
    edge_rows, edge_residuals, prior_rows, prior_residuals = [], [], [], []
    steps, slots = len(wheels[0].start), len(wheels[0].slot_errors)
    size = 2 * steps + 2 + slots
    error = SLOT_ERROR_SD_PITCHES * 2 * pi / slots
    for number, wheel in enumerate(wheels):
        angles, jacobian = wheel.predict(lag, dead_time)
        first = 2 + number * size
        rows = np.zeros((len(jacobian), 2 + size * len(wheels)))
        rows[:, :2], rows[:, first : first + size] = jacobian[:, :2], jacobian[:, 2:]
        edge_rows.append(rows / noise)
        edge_residuals.append((wheel.edges.angles - angles) / noise)
        prior = np.zeros((steps + slots, rows.shape[1]))
        prior[np.arange(steps), first + steps + np.arange(steps)] = 1.0 / jitter
        prior[steps + np.arange(slots), first + 2 * steps + 2 + np.arange(slots)] = 1.0 / error
        prior_rows.append(prior)
        prior_residuals.append(
            np.concatenate([-wheel.lateness / jitter, -wheel.slot_errors / error])
        )
    return (
        np.concatenate([*edge_rows, *prior_rows]),
        np.concatenate([*edge_residuals, *prior_residuals]),
    )
