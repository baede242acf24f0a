"""Slip of the wheels, from how far the ends of equal squares scatter.

The squares of one direction are equal but for slip, for the reading of their ends and for what
odometry does not know of its own end. Slip is a random walk of each wheel, so that its covariance
at the end of a square is known but for one factor. How well the ends are read is known roughly;
slip of 0.5 mm after a metre already moves the end of a square of 1 m by twice as much.
"""

from __future__ import annotations

from collections.abc import Sequence
from math import log, sqrt
from typing import NamedTuple

import numpy as np

from diffbotctl.calibrate.dead_reckoning import (
    EndError,
    Floats,
    Geometry,
    Segment,
    dead_reckon,
)
from diffbotctl.calibrate.end_noise import HEADING, POSITION, NoisePrior
from diffbotctl.calibrate.umbmark import QUARTER_TURN, SQUARE_SIDES, SquareErrors, mean_end

SIDE_STEPS, TURN_STEPS = 20, 8  # into which a side and a turn are divided
# Of an end, read by a person and estimated by odometry.
POSITION_SD, HEADING_SD = POSITION.typical, HEADING.typical
SLIP_MIN, SLIP_MAX, GRID = 0.0001, 0.1, 110
# Of 15 simulated robots with ten squares the logarithms of the slip had errors of 0.34, and the
# scatter states 0.19: odometry does not end each square alike.
MODEL_SD_RATIO = 0.3
SLIP_USABLE = 0.05  # m; `drive.slip` is less
# Before the squares: floors and tyres of small robots have 0.5 to 2 mm after a metre.
PRIOR = NoisePrior(
    0.001, 2.5, tuple(np.exp(np.linspace(log(SLIP_MIN), log(SLIP_MAX), GRID)).tolist())
)


class SlipFit(NamedTuple):
    """Standard deviation (m) of a wheel's slip after one metre, and its own."""

    value: float
    sd: float


def fit_slip(squares: SquareErrors, geometry: Geometry) -> SlipFit | None:
    """The slip that explains the scatter of `squares`, driven with `geometry`; None if no direction
    has two squares with a known place."""
    if not squares.has_positions:
        return None
    known = 3 if squares.has_headings else 2
    scatters = []
    for ends, clockwise in ((squares.clockwise, True), (squares.counter, False)):
        if len(ends) > 1:
            unit = square_covariance(squares.side, geometry, clockwise)[:known, :known]
            scatters.append((_scatter(ends)[:known, :known], len(ends) - 1, unit))
    if not scatters:
        return None
    reading = np.diag([POSITION_SD**2, POSITION_SD**2, HEADING_SD**2])[:known, :known]
    grid, logs = np.array(PRIOR.values), np.array(PRIOR.log_weights())
    for index, slip in enumerate(grid):
        for scatter, freedom, unit in scatters:
            covariance = slip**2 * unit + reading
            explained = float(np.trace(np.linalg.solve(covariance, scatter)))
            logs[index] -= 0.5 * (freedom * np.linalg.slogdet(covariance)[1] + explained)
    weights = np.exp(logs - logs.max())
    weights /= weights.sum()
    value = sqrt(float(weights @ grid**2))
    variance = max(float(weights @ (grid - value) ** 2), 0.0)
    return SlipFit(value, sqrt(variance + (MODEL_SD_RATIO * value) ** 2))


def square_covariance(side: float, geometry: Geometry, clockwise: bool) -> Floats:
    """(3, 3): covariance of the end of a square with `side` (m) if each wheel slips by 1 m per
    square root of a metre."""
    turn = (-1.0 if clockwise else 1.0) * QUARTER_TURN * geometry.track / 2
    steps = [
        *[(side, side)] * SIDE_STEPS,
        *[(turn * SIDE_STEPS / TURN_STEPS, -turn * SIDE_STEPS / TURN_STEPS)] * TURN_STEPS,
    ] * SQUARE_SIDES
    rolled = np.array(steps) / SIDE_STEPS / (geometry.right, geometry.left)
    segment = Segment(rolled, np.zeros(3), (0.0, 0.0))
    return dead_reckon(segment, geometry).slip


def _scatter(ends: Sequence[EndError]) -> Floats:
    """(3, 3): sum of the products of the deviations from their mean."""
    deviations = np.nan_to_num(np.array(ends) - np.array(mean_end(ends)))
    return np.asarray(deviations.T @ deviations)
