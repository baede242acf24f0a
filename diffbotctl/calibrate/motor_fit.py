"""Fits of one motor: the line from duty to speed, and how late the wheel follows a step."""

from __future__ import annotations

from collections.abc import Sequence
from math import pi, sqrt
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from diffbotctl.calibrate.dead_reckoning import Floats
from diffbotctl.calibrate.motor_curve import FittedMotor
from diffbotctl.messages import Encoders

NS = 1e-9  # s
MEAN_POSITION_PITCHES = 0.5  # mean distance of a wheel from the last edge
SPEED_EDGES_MIN = 3
SPEED_POINTS_MIN = 3
SLOT_ERROR_SD_PITCHES = 0.03  # of a cut disc; the prior of the slot errors
SETTLED_LAGS = 6.0  # lags after which the response to a step has decayed to 0.25 %
LAG_MAX_S = 0.2  # the lag assumed before it is known
BEFORE_STEP_TIME_S = 0.7  # of the motion before a step
STEP_EDGES_MIN = 8  # per step
DEAD_TIME_STEP_S, DEAD_TIME_MAX_S = 0.002, 0.060
DEAD_TIME_CHI2_GAIN_MIN = 12.0  # decrease of chi-squared that justifies a dead time

Ints = NDArray[np.int64]


def wheel_edges(frames: Sequence[Encoders], left: bool) -> tuple[Floats, Ints]:
    """Times (s) and counts (edges,) of the reported edges of one wheel, in order."""
    times, counts = [], []
    last = None
    for frame in frames:
        edge = frame.left_edge if left else frame.right_edge
        count = frame.left if left else frame.right
        if edge is None or (last is not None and (count == last[0] or edge <= last[1])):
            continue
        last = (count, edge)
        times.append(edge * NS)
        counts.append(count)
    return np.array(times), np.array(counts, dtype=np.int64)


def frame_positions(frames: Sequence[Encoders], left: bool) -> tuple[Floats, Floats]:
    """Times (s) of the frames and the most likely positions (counts) of one wheel."""
    counts = np.array([frame.left if left else frame.right for frame in frames], dtype=float)
    sign = np.sign(counts[-1] - counts[0]) if len(counts) else 1.0
    return np.array([frame.time for frame in frames]) * NS, counts + MEAN_POSITION_PITCHES * sign


def has_edge_times(frames: Sequence[Encoders]) -> bool:
    """Whether the board reports the times of edges."""
    return any(frame.left_edge is not None or frame.right_edge is not None for frame in frames)


def mean_speed(frames: Sequence[Encoders], left: bool, slots: int) -> float:
    """Mean speed in rad/s over whole turns of the wheel, so that slot errors cancel.

    Less than one turn is fitted by a line. 0 if there are too few edges.
    """
    pitch = 2 * pi / slots
    if not has_edge_times(frames):
        times, positions = frame_positions(frames, left)
        if len(times) < SPEED_EDGES_MIN or abs(positions[-1] - positions[0]) < SPEED_EDGES_MIN:
            return 0.0
        return line_slope(times, positions) * pitch
    times, counts = wheel_edges(frames, left)
    if len(times) < SPEED_EDGES_MIN:
        return 0.0
    first = int(np.flatnonzero((counts[-1] - counts) % slots == 0)[0])
    if first < len(times) - 1:
        return float((counts[-1] - counts[first]) / (times[-1] - times[first])) * pitch
    return line_slope(times, counts.astype(float)) * pitch


def line_slope(times: Floats, positions: Floats) -> float:
    """Slope of the least-squares line."""
    return float(np.polyfit(times - times[0], positions, 1)[0])


class SpeedDutyLine(NamedTuple):
    """duty = static + slope * speed, for one wheel; duty 0 to 1, speed in rad/s."""

    static: float
    slope: float
    static_sd: float
    slope_sd: float
    points: tuple[tuple[float, float], ...] = ()
    """(duty, rad/s)"""

    def curve(self) -> FittedMotor:
        """The line as the curve of a motor whose battery does not sag."""
        sd = self.rated * self.slope_sd / self.slope
        return FittedMotor(self.static, self.rated, self.static_sd, sd)

    def slope_above(self, static: float) -> tuple[float, float]:
        """Duty per rad/s above `static` that fits the points best, and its standard deviation."""
        if static == self.static or len(self.points) < SPEED_POINTS_MIN:
            return self.slope, self.slope_sd
        duty, speed = np.array(self.points).T
        slope = float(speed @ (duty - static) / (speed @ speed))
        residuals = duty - static - slope * speed
        variance = float(residuals @ residuals) / (len(duty) - 1) / float(speed @ speed)
        return slope, variance**0.5

    @property
    def rated(self) -> float:
        """Speed at full duty, rad/s."""
        return (1.0 - self.static) / self.slope


class StepResponse(NamedTuple):
    """One step between two duties: the frames around it, and the time (s) at which it occurred."""

    frames: Sequence[Encoders]
    time: float
    is_up: bool


class LagFit(NamedTuple):
    """How late a wheel follows a command, s: a dead time and then a first-order lag."""

    lag: float
    dead_time: float
    sd: float
    """of their sum"""
    split_sd: float = 0.0
    """standard deviation of the dead time, and of the lag given the sum of both"""


class StepEdges(NamedTuple):
    """All edges around the steps, (edges,) each."""

    times: Floats
    """s since the step"""
    angles: Floats
    """rad"""
    steps: Ints
    """number of the step"""
    slots: Ints
    """number of the slot"""
    is_up: NDArray[np.bool_]
    """whether the step is up"""


def fit_line(points: Sequence[tuple[float, float]]) -> SpeedDutyLine:
    """The feed-forward line through points (duty, speed) by least squares; signs are ignored.

    Raises ValueError if fewer than three points have a speed.
    """
    duty, speed = np.abs(np.array(points, dtype=float)).reshape(-1, 2).T
    turning = speed > 0.0
    duty, speed = duty[turning], speed[turning]
    if len(duty) < SPEED_POINTS_MIN:
        raise ValueError("it turned at fewer than three of the duties")
    matrix = np.stack([np.ones_like(speed), speed], axis=1)
    (static, slope), *_ = np.linalg.lstsq(matrix, duty, rcond=None)
    if slope <= 0.0:
        raise ValueError("its speed did not increase with the duty")
    residuals = duty - matrix @ (static, slope)
    variance = float(residuals @ residuals) / (len(duty) - 2)
    sd = np.sqrt(np.diag(np.linalg.inv(matrix.T @ matrix)) * variance)
    kept = tuple(zip(duty.tolist(), speed.tolist(), strict=True))
    return SpeedDutyLine(float(static), float(slope), float(sd[0]), float(sd[1]), kept)


def fit_lag(steps: Sequence[StepResponse], left: bool, slots: int) -> LagFit:
    """The lag of a wheel from steps up and down between the same two duties.

    Long after a step the wheel runs on a line that crosses the line from before the step one lag
    (and one dead time) after the command took effect: angle = A + v1 t before,
    A + v2 t - (v2 - v1) (lag + dead time) after. All steps share v1, v2, the slot errors and the
    delay, so this is one linear least-squares problem. The shape of the transition from one line to
    the other separates dead time from lag. Raises ValueError if there are too few edges.
    """
    edges = gather_edges(steps, left, slots)
    times = edges.times
    solution, sd, matrix = solve_lines(edges, len(steps), slots)
    count = len(steps)
    slow, fast, offset = solution[count], solution[count + 1], solution[count + 2]
    if fast <= slow:
        raise ValueError("its speed did not increase with the duty")
    delay = float(offset / (fast - slow))
    delay_sd = float(sd[count + 2] / (fast - slow))
    moving = (times > 0.0) & (times < SETTLED_LAGS * LAG_MAX_S)
    # The matrix holds the late line for all edges after a step: the residual is the transition.
    residuals = (edges.angles - matrix @ solution)[moving]
    change = np.where(edges.is_up, fast - slow, slow - fast)[moving]
    error = sqrt(2.0) * SLOT_ERROR_SD_PITCHES * 2 * pi / slots
    dead_time, split_sd = _dead_time(times[moving], change, residuals, delay, error)
    return LagFit(delay - dead_time, dead_time, delay_sd, split_sd)


def gather_edges(steps: Sequence[StepResponse], left: bool, slots: int) -> StepEdges:
    """The edges of one wheel around all steps. Raises ValueError if there are too few."""
    pitch = 2 * pi / slots
    rows: list[tuple[float, float, int, int]] = []
    for number, step in enumerate(steps):
        if has_edge_times(step.frames):
            times, counts = wheel_edges(step.frames, left)
            positions: Floats = counts.astype(float)
        else:
            times, positions = frame_positions(step.frames, left)
        rows += [
            (float(time) - step.time, float(position) * pitch, number, int(position) % slots)
            for time, position in zip(times, positions, strict=True)
            if time - step.time >= -BEFORE_STEP_TIME_S
        ]
    if len(rows) < STEP_EDGES_MIN * len(steps):
        raise ValueError("too few edges around the steps")
    table = np.array(rows)
    numbers = table[:, 2].astype(int)
    is_up = np.array([step.is_up for step in steps])[numbers]
    return StepEdges(table[:, 0], table[:, 1], numbers, table[:, 3].astype(int), is_up)


def solve_lines(
    edges: StepEdges,
    count: int,
    slots: int,
    shares: tuple[float, float] = (1.0, 1.0),
    dead_time: float | None = 0.0,
) -> tuple[Floats, Floats, Floats]:
    """Solution, standard deviations and the whole matrix of the joint least squares.

    The unknowns are the angle of each of `count` steps, the two speeds, the offset of the late
    lines by the lag, that by the dead time where `dead_time` (s) is None, and the error of each
    slot. Only edges before a step and long after it are used. `shares`: of the lag, those after a
    step up and after a step down.
    """
    settled = (edges.times <= 0.0) | (edges.times >= SETTLED_LAGS * LAG_MAX_S)
    times, is_up = edges.times, edges.is_up
    rows = np.arange(len(times))
    lines = count + (4 if dead_time is None else 3)
    matrix = np.zeros((len(times), lines + slots))
    matrix[rows, edges.steps] = 1.0
    is_late = times > 0.0
    is_fast = is_late == is_up  # after a step up, before a step down
    late = np.where(is_late, dead_time or 0.0, 0.0)
    matrix[:, count] = np.where(is_fast, late, times - late)
    matrix[:, count + 1] = np.where(is_fast, times - late, late)
    matrix[:, count + 2] = np.where(is_late, np.where(is_up, -shares[0], shares[1]), 0.0)
    if dead_time is None:
        matrix[:, count + 3] = np.where(is_late, np.where(is_up, -1.0, 1.0), 0.0)
    matrix[rows, lines + edges.slots] = 1.0
    error = SLOT_ERROR_SD_PITCHES * 2 * pi / slots
    prior = np.zeros((slots, lines + slots))
    prior[:, lines:] = np.eye(slots)
    system = np.concatenate([matrix[settled], prior])
    angles = np.concatenate([edges.angles[settled], np.zeros(slots)])
    solution, *_ = np.linalg.lstsq(system, angles, rcond=None)
    residuals = angles - system @ solution
    freedom = max(settled.sum() - lines, 1)
    variance = max(float(residuals @ residuals) / freedom, (error / 10) ** 2)
    sd = np.sqrt(np.diag(np.linalg.pinv(system.T @ system)) * variance)
    return solution, sd, matrix


def _dead_time(
    times: Floats, change: Floats, residuals: Floats, delay: float, error: float
) -> tuple[float, float]:
    """The part of `delay` that is a dead time, from the shape of the transition, and its standard
    deviation. A dead time that the shape does not prove is 0, and may be what it was found to be.
    """
    candidates = np.arange(
        0.0, min(DEAD_TIME_MAX_S, 0.6 * delay) + DEAD_TIME_STEP_S / 2, DEAD_TIME_STEP_S
    )
    sums = []
    for dead_time in candidates:
        lag = delay - dead_time
        since = np.maximum(times - dead_time, 0.0)
        # The late line lies (v2 - v1) * delay below the early one.
        transition = np.where(times < dead_time, delay - times, lag * np.exp(-since / lag))
        sums.append(float((((residuals - change * transition) / error) ** 2).sum()))
    chi2 = np.array(sums)
    probability = np.exp(0.5 * (chi2.min() - chi2))
    probability /= probability.sum()
    best = int(np.argmin(chi2))
    is_justified = chi2[0] - chi2[best] > DEAD_TIME_CHI2_GAIN_MIN
    dead_time = float(candidates[best]) if is_justified else 0.0
    variance = float(probability @ (candidates - dead_time) ** 2)
    return dead_time, sqrt(variance + DEAD_TIME_STEP_S**2 / 12)
