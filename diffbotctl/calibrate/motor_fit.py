"""Speeds of one motor from frames, and the line from duty to speed."""

from __future__ import annotations

from collections.abc import Sequence
from math import pi
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
    return float(np.polyfit(times - times[0], positions, 1)[0])


class StepResponse(NamedTuple):
    """One step between two duties: the frames around it, and the time (s) at which it occurred."""

    frames: Sequence[Encoders]
    time: float
    is_up: bool


Points = Sequence[tuple[float, float]]  # (duty, rad/s)


def fit_line(points: Points) -> FittedMotor:
    """The line from speed to duty by least squares, as the curve of a motor whose battery does not
    sag; signs are ignored.

    Raises ValueError if fewer than three points have a speed.
    """
    duty, speed = _turning(points)
    if len(duty) < SPEED_POINTS_MIN:
        raise ValueError("it turned at fewer than three of the duties")
    matrix = np.stack([np.ones_like(speed), speed], axis=1)
    (static, slope), *_ = np.linalg.lstsq(matrix, duty, rcond=None)
    if slope <= 0.0:
        raise ValueError("its speed did not increase with the duty")
    residuals = duty - matrix @ (static, slope)
    variance = float(residuals @ residuals) / (len(duty) - 2)
    static_sd, slope_sd = np.sqrt(np.diag(np.linalg.inv(matrix.T @ matrix)) * variance)
    rated = (1.0 - float(static)) / float(slope)
    return FittedMotor(float(static), rated, float(static_sd), rated * float(slope_sd / slope))


def slope_above(points: Points, static: float) -> tuple[float, float]:
    """Duty per rad/s above `static` that fits the points best, and its standard deviation."""
    duty, speed = _turning(points)
    slope = float(speed @ (duty - static) / (speed @ speed))
    residuals = duty - static - slope * speed
    variance = float(residuals @ residuals) / max(len(duty) - 1, 1) / float(speed @ speed)
    return slope, variance**0.5


def _turning(points: Points) -> tuple[Floats, Floats]:
    """Duties and speeds, without signs, of the points at which the wheel turned."""
    duty, speed = np.abs(np.array(points, dtype=float)).reshape(-1, 2).T
    return duty[speed > 0.0], speed[speed > 0.0]
