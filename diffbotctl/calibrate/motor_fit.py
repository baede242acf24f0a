"""A motor's line from duty to speed, and how late its wheel follows."""

from __future__ import annotations

from collections.abc import Sequence
from math import pi, sqrt
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from diffbotctl.calibrate import edge_log
from diffbotctl.calibrate.recorded_drive import Floats
from diffbotctl.messages import Encoders

Bools = NDArray[np.bool_]
SLOT = 0.03  # pitches, sd: what a cutter leaves; holds back the slots' errors while few edges tell
FADED = 6.0  # lags after which a step has faded to a quarter per cent
LONGEST = 0.2  # s; the lag that is allowed for before it is known
BEFORE = 0.7  # s of the run before a step that is taken in
DEAD_STEP, DEAD_MOST = 0.002, 0.060  # s; dead times that are tried
BELIEVED = 12.0  # how much better, by chi squared, a dead time must explain the transition


class SpeedDutyLine(NamedTuple):
    """duty = static + slope * speed, for one wheel; duty 0 to 1, speed in rad/s."""

    static: float
    slope: float
    static_sd: float
    slope_sd: float

    @property
    def rated(self) -> float:
        """Speed at full duty, rad/s."""
        return (1.0 - self.static) / self.slope


class StepResponse(NamedTuple):
    """One step between two duties: frames around it, and when it took hold (s)."""

    frames: Sequence[Encoders]
    at: float
    up: bool


class LagFit(NamedTuple):
    """How late a wheel follows, s."""

    lag: float
    dead: float
    sd: float
    """of their sum"""
    parted: float = 0.0
    """sd of how the sum is divided between them"""


def fit_line(duties: Sequence[float], speeds: Sequence[float]) -> SpeedDutyLine:
    """The feed-forward through (duty, speed) points, by least squares; signs are left out.

    Raises ValueError when fewer than three wheels' speeds are known.
    """
    duty, speed = np.abs(np.array(duties)), np.abs(np.array(speeds))
    turning = speed > 0.0
    duty, speed = duty[turning], speed[turning]
    if len(duty) < 3:
        raise ValueError("the wheel turned at fewer than three of the duties")
    matrix = np.stack([np.ones_like(speed), speed], axis=1)
    (static, slope), *_ = np.linalg.lstsq(matrix, duty, rcond=None)
    if slope <= 0.0:
        raise ValueError("more duty did not turn it faster")
    rest = duty - matrix @ (static, slope)
    variance = float(rest @ rest) / (len(duty) - 2)
    spread = np.sqrt(np.diag(np.linalg.inv(matrix.T @ matrix)) * variance)
    return SpeedDutyLine(float(static), float(slope), float(spread[0]), float(spread[1]))


def fit_lag(steps: Sequence[StepResponse], left: bool, slots: int) -> LagFit:
    """The wheel's lag from steps up and down between the same two duties.

    Long after a step the wheel runs on a line that crosses the one from before a lag (and a dead
    time) after the command took hold: angle = A + v1 t before, A + v2 t - (v2 - v1) (lag + dead)
    after. All steps share v1, v2, the slots' errors and the delay, so it is one linear least
    squares. How the wheel goes from one line to the other tells dead time from lag.
    Raises ValueError when there are too few edges.
    """
    times, places, which, slot = gathered(steps, left, slots)
    settled = (times <= 0.0) | (times >= FADED * LONGEST)
    ups = np.array([step.up for step in steps])[which]
    solution, spread, matrix = _solved(times, places, which, slot, ups, settled, len(steps), slots)
    count = len(steps)
    slow, fast, bend = solution[count], solution[count + 1], solution[count + 2]
    if fast <= slow:
        raise ValueError("more duty did not turn it faster")
    both = float(bend / (fast - slow))
    sd = float(spread[count + 2] / (fast - slow))
    moving = (times > 0.0) & (times < FADED * LONGEST)
    model = matrix @ solution
    # The matrix holds the late line for all edges after a step: what is missing yet is the bend.
    change = np.where(ups, fast - slow, slow - fast)
    rest, after, change = (places - model)[moving], times[moving], change[moving]
    return LagFit(*_parted(after, change, rest, both, sqrt(2.0) * SLOT * 2 * pi / slots), sd)


def gathered(
    steps: Sequence[StepResponse], left: bool, slots: int
) -> tuple[Floats, Floats, Floats, Floats]:
    """Time since its step (s), angle (rad), number of the step, and slot, of every edge.

    Raises ValueError when there are too few.
    """
    pitch = 2 * pi / slots
    rows: list[tuple[float, float, int, int]] = []
    for number, step in enumerate(steps):
        if edge_log.has_edges(step.frames):
            times, counts = edge_log.passed(step.frames, left)
            places: Floats = counts.astype(float)
        else:
            times, places = edge_log.sampled(step.frames, left)
        rows += [
            (float(time) - step.at, float(place) * pitch, number, int(place) % slots)
            for time, place in zip(times, places, strict=True)
            if time - step.at >= -BEFORE
        ]
    if len(rows) < 8 * len(steps):
        raise ValueError("too few edges around the steps")
    table = np.array(rows)
    return table[:, 0], table[:, 1], table[:, 2].astype(int), table[:, 3].astype(int)


def _solved(
    times: Floats,
    places: Floats,
    which: Floats,
    slot: Floats,
    ups: Bools,
    settled: Bools,
    count: int,
    slots: int,
) -> tuple[Floats, Floats, Floats]:
    """Solution, standard deviations and the whole matrix of the joint least squares."""
    rows = len(times)
    matrix = np.zeros((rows, count + 3 + slots))
    matrix[np.arange(rows), which] = 1.0
    late = times > 0.0
    fast = late == ups  # after a step up, before one down
    matrix[:, count] = np.where(fast, 0.0, times)
    matrix[:, count + 1] = np.where(fast, times, 0.0)
    matrix[:, count + 2] = np.where(late, np.where(ups, -1.0, 1.0), 0.0)
    matrix[np.arange(rows), count + 3 + slot] = 1.0
    error = SLOT * 2 * pi / slots
    prior = np.zeros((slots, count + 3 + slots))
    prior[:, count + 3 :] = np.eye(slots)
    chosen = np.concatenate([matrix[settled], prior])
    wanted = np.concatenate([places[settled], np.zeros(slots)])
    solution, *_ = np.linalg.lstsq(chosen, wanted, rcond=None)
    rest = wanted - chosen @ solution
    variance = max(float(rest @ rest) / max(settled.sum() - count - 3, 1), (error / 10) ** 2)
    spread = np.sqrt(np.diag(np.linalg.pinv(chosen.T @ chosen)) * variance)
    return solution, spread, matrix


def _parted(
    after: Floats, change: Floats, rest: Floats, both: float, error: float
) -> tuple[float, float]:
    """Lag and dead time whose sum is `both`, by how the wheel goes from one line to the other."""
    tried = np.arange(0.0, min(DEAD_MOST, 0.6 * both) + DEAD_STEP / 2, DEAD_STEP)
    costs = []
    for dead in tried:
        slow = both - dead
        since = np.maximum(after - dead, 0.0)
        # The late line lies (v2 - v1) * both below the early one; the bend is what is left of it.
        bend = np.where(after < dead, both - after, slow * np.exp(-since / slow))
        costs.append(float((((rest - change * bend) / error) ** 2).sum()))
    best = int(np.argmin(costs))
    dead = float(tried[best]) if costs[0] - costs[best] > BELIEVED else 0.0
    return both - dead, dead
