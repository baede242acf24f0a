"""Speed against duty of both motors on a battery whose voltage drops under load.

A wheel that friction brakes with the duty `static` settles at

    speed = gain * (duty * (1 - sag * duty) - static)

if both motors run at the same duty: the current, and with it the drop of the battery, grows with
the duty. A straight line through such points hits the axis too low, and ends too low at full duty:
at a sag of 4 % by 9 % of `static` and 4 % of the full speed. So the sag, which both motors share,
is fitted with the rest.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np

from diffbotctl.calibrate.dead_reckoning import Floats

SAG_MIN, SAG_MAX = -0.02, 0.30  # beyond, the motors follow another law: a line is as good
SAG_STEP = 0.001
SPEED_SD_RATIO_MIN = 0.0007  # of a mean speed: ripple of the gears over the last, unfinished turn
DERIVATIVE_STEP = 1e-5


class MotorCurve(NamedTuple):
    """One motor, without the drop of the battery."""

    static: float
    """duty at which friction just stops it"""
    rated: float
    """rad/s at full duty and the battery's voltage at rest"""
    static_sd: float
    rated_sd: float


def fit_curves(points: Mapping[str, Sequence[tuple[float, float]]]) -> dict[str, MotorCurve]:
    """The curves of all motors, from (duty, rad/s) by motor, at equal duties of both.

    Empty if these motors follow another law.
    """
    tables = [np.abs(np.array(rows, dtype=float)) for rows in points.values()]
    tables = [table[table[:, 1] > 0.0] for table in tables]
    sags = np.arange(SAG_MIN, SAG_MAX + SAG_STEP, SAG_STEP)
    errors = [sum(float(_line(table, sag)[1]) for table in tables) for sag in sags]
    best = int(np.argmin(errors))
    if best in (0, len(sags) - 1):
        return {}
    sag = float(sags[best])
    covariance = _covariance(tables, sag, errors[best])
    curves = {}
    for number, (name, table) in enumerate(zip(points, tables, strict=True)):
        gain, offset = (float(value) for value in _line(table, sag)[0])
        rows = [1 + 2 * number, 2 + 2 * number]
        # static = -offset / gain, rated = gain + offset
        block = covariance[np.ix_(rows, rows)]
        by_static = np.array([offset / gain**2, -1 / gain])
        by_rated = np.ones(2)
        curves[name] = MotorCurve(
            -offset / gain,
            gain + offset,
            float(np.sqrt(by_static @ block @ by_static)),
            float(np.sqrt(by_rated @ block @ by_rated)),
        )
    return curves


def _line(table: Floats, sag: float) -> tuple[Floats, float]:
    """Gain and offset (rad/s) for a given sag, and the sum of the squared relative errors."""
    matrix, speeds = _system(table, sag)
    solution = np.linalg.lstsq(matrix, speeds, rcond=None)[0]
    residuals = speeds - matrix @ solution
    return np.asarray(solution), float(residuals @ residuals)


def _system(table: Floats, sag: float) -> tuple[Floats, Floats]:
    """Rows are divided by the speed: its error is relative."""
    duty, speed = table.T
    matrix = np.stack([duty * (1 - sag * duty), np.ones_like(duty)], axis=1)
    return np.asarray(matrix / speed[:, None]), np.ones_like(speed)


def _covariance(tables: Sequence[Floats], sag: float, error: float) -> Floats:
    """Of the sag, and of gain and offset of each motor."""
    count = sum(len(table) for table in tables)
    size = 1 + 2 * len(tables)
    jacobian = np.zeros((count, size))
    first = 0
    for number, table in enumerate(tables):
        matrix, _ = _system(table, sag)
        solution = _line(table, sag)[0]
        changed = _system(table, sag + DERIVATIVE_STEP)[0]
        rows = slice(first, first + len(table))
        jacobian[rows, 0] = (changed - matrix) @ solution / DERIVATIVE_STEP
        jacobian[rows, 1 + 2 * number : 3 + 2 * number] = matrix
        first += len(table)
    variance = max(error / max(count - size, 1), SPEED_SD_RATIO_MIN**2)
    return np.asarray(np.linalg.inv(jacobian.T @ jacobian) * variance)
