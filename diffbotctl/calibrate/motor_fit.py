"""What the encoder of one wheel told over time: places on its disc, and when they were passed.

A motor's line from duty to speed, and how late its wheel follows.
"""

from __future__ import annotations

from collections.abc import Sequence
from math import pi, sqrt
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

from diffbotctl.calibrate.dead_reckoning import Floats
from diffbotctl.messages import Encoders

if TYPE_CHECKING:
    from numpy.typing import NDArray

NS = 1e-9
MEAN_POSITION_PITCHES = (
    0.5  # of a pitch: between two edges a wheel is on average so far beyond the last one
)
SPEED_EDGES_MIN = 3  # of a speed


def wheel_edges(frames: Sequence[Encoders], left: bool) -> tuple[Floats, NDArray[np.int64]]:
    """Times (s) and counts (edges,) of one wheel, both rising in time.

    With edge times, one entry for each edge that was told; without, one a frame, half a count on.
    """
    times, counts = [], []
    last = None
    for frame in frames:
        edge = frame.left_edge if left else frame.right_edge
        count = frame.left if left else frame.right
        if edge is None:
            continue
        if last is not None and (count == last[0] or edge <= last[1]):
            continue
        last = (count, edge)
        times.append(edge * NS)
        counts.append(count)
    return np.array(times), np.array(counts, dtype=np.int64)


def frame_positions(frames: Sequence[Encoders], left: bool) -> tuple[Floats, Floats]:
    """Times (s) of the frames and the place (counts) where the wheel probably stood."""
    counts = np.array([frame.left if left else frame.right for frame in frames], dtype=float)
    sign = np.sign(counts[-1] - counts[0]) if len(counts) else 1.0
    return np.array([frame.time for frame in frames]) * NS, counts + MEAN_POSITION_PITCHES * sign


def has_edge_times(frames: Sequence[Encoders]) -> bool:
    """Whether the board tells when edges came."""
    return any(frame.left_edge is not None or frame.right_edge is not None for frame in frames)


def mean_speed(frames: Sequence[Encoders], left: bool, slots: int) -> float:
    """Mean speed in rad/s over whole turns of the wheel, so that uneven slots cancel.

    Less than a turn is fitted by a line. 0 when there were too few edges to tell one.
    """
    pitch = 2 * pi / slots
    if not has_edge_times(frames):
        times, places = frame_positions(frames, left)
        if len(times) < SPEED_EDGES_MIN or abs(places[-1] - places[0]) < SPEED_EDGES_MIN:
            return 0.0
        return float(np.polyfit(times - times[0], places, 1)[0]) * pitch
    times, counts = wheel_edges(frames, left)
    if len(times) < SPEED_EDGES_MIN:
        return 0.0
    whole = np.flatnonzero((counts[-1] - counts) % slots == 0)
    first = int(whole[0])
    if first < len(times) - 1:
        return float((counts[-1] - counts[first]) / (times[-1] - times[first])) * pitch
    return float(np.polyfit(times - times[0], counts.astype(float), 1)[0]) * pitch


Bools = NDArray[np.bool_]
SLOT_ERROR_SD_PITCHES = (
    0.03  # pitches, sd: what a cutter leaves; holds back the slots' errors while few edges tell
)
SETTLED_LAGS = 6.0  # lags after which a step has faded to a quarter per cent
LAG_MAX_S = 0.2  # s; the lag that is allowed for before it is known
BEFORE_STEP_S = 0.7  # s of the run before a step that is taken in
DEAD_TIME_STEP_S, DEAD_TIME_MAX_S = 0.002, 0.060  # s; dead times that are tried
DEAD_TIME_CHI2_GAIN = (
    12.0  # how much better, by chi squared, a dead time must explain the transition
)


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
    times, places, which, slot = gather_edges(steps, left, slots)
    settled = (times <= 0.0) | (times >= SETTLED_LAGS * LAG_MAX_S)
    ups = np.array([step.up for step in steps])[which]
    solution, spread, matrix = _solve_lines(
        times, places, which, slot, ups, settled, len(steps), slots
    )
    count = len(steps)
    slow, fast, bend = solution[count], solution[count + 1], solution[count + 2]
    if fast <= slow:
        raise ValueError("more duty did not turn it faster")
    both = float(bend / (fast - slow))
    sd = float(spread[count + 2] / (fast - slow))
    moving = (times > 0.0) & (times < SETTLED_LAGS * LAG_MAX_S)
    model = matrix @ solution
    # The matrix holds the late line for all edges after a step: what is missing yet is the bend.
    change = np.where(ups, fast - slow, slow - fast)
    rest, after, change = (places - model)[moving], times[moving], change[moving]
    return LagFit(
        *_split_delay(
            after, change, rest, both, sqrt(2.0) * SLOT_ERROR_SD_PITCHES * 2 * pi / slots
        ),
        sd,
    )


def gather_edges(
    steps: Sequence[StepResponse], left: bool, slots: int
) -> tuple[Floats, Floats, Floats, Floats]:
    """Time since its step (s), angle (rad), number of the step, and slot, of every edge.

    Raises ValueError when there are too few.
    """
    pitch = 2 * pi / slots
    rows: list[tuple[float, float, int, int]] = []
    for number, step in enumerate(steps):
        if has_edge_times(step.frames):
            times, counts = wheel_edges(step.frames, left)
            places: Floats = counts.astype(float)
        else:
            times, places = frame_positions(step.frames, left)
        rows += [
            (float(time) - step.at, float(place) * pitch, number, int(place) % slots)
            for time, place in zip(times, places, strict=True)
            if time - step.at >= -BEFORE_STEP_S
        ]
    if len(rows) < 8 * len(steps):
        raise ValueError("too few edges around the steps")
    table = np.array(rows)
    return table[:, 0], table[:, 1], table[:, 2].astype(int), table[:, 3].astype(int)


def _solve_lines(
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
    error = SLOT_ERROR_SD_PITCHES * 2 * pi / slots
    prior = np.zeros((slots, count + 3 + slots))
    prior[:, count + 3 :] = np.eye(slots)
    chosen = np.concatenate([matrix[settled], prior])
    wanted = np.concatenate([places[settled], np.zeros(slots)])
    solution, *_ = np.linalg.lstsq(chosen, wanted, rcond=None)
    rest = wanted - chosen @ solution
    variance = max(float(rest @ rest) / max(settled.sum() - count - 3, 1), (error / 10) ** 2)
    spread = np.sqrt(np.diag(np.linalg.pinv(chosen.T @ chosen)) * variance)
    return solution, spread, matrix


def _split_delay(
    after: Floats, change: Floats, rest: Floats, both: float, error: float
) -> tuple[float, float]:
    """Lag and dead time whose sum is `both`, by how the wheel goes from one line to the other."""
    tried = np.arange(
        0.0, min(DEAD_TIME_MAX_S, 0.6 * both) + DEAD_TIME_STEP_S / 2, DEAD_TIME_STEP_S
    )
    costs = []
    for dead in tried:
        slow = both - dead
        since = np.maximum(after - dead, 0.0)
        # The late line lies (v2 - v1) * both below the early one; the bend is what is left of it.
        bend = np.where(after < dead, both - after, slow * np.exp(-since / slow))
        costs.append(float((((rest - change * bend) / error) ** 2).sum()))
    best = int(np.argmin(costs))
    dead = float(tried[best]) if costs[0] - costs[best] > DEAD_TIME_CHI2_GAIN else 0.0
    return both - dead, dead
