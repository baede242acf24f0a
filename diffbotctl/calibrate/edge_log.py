"""What the encoder of one wheel told over time: places on its disc, and when they were passed."""

from __future__ import annotations

from collections.abc import Sequence
from math import pi
from typing import TYPE_CHECKING

import numpy as np

from diffbotctl.calibrate.recorded_drive import Floats
from diffbotctl.messages import Encoders

if TYPE_CHECKING:
    from numpy.typing import NDArray

SECONDS = 1e-9
HALF = 0.5  # of a pitch: between two edges a wheel is on average so far beyond the last one
LEAST_EDGES = 3  # of a speed


def passed(frames: Sequence[Encoders], left: bool) -> tuple[Floats, NDArray[np.int64]]:
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
        times.append(edge * SECONDS)
        counts.append(count)
    return np.array(times), np.array(counts, dtype=np.int64)


def sampled(frames: Sequence[Encoders], left: bool) -> tuple[Floats, Floats]:
    """Times (s) of the frames and the place (counts) where the wheel probably stood."""
    counts = np.array([frame.left if left else frame.right for frame in frames], dtype=float)
    sign = np.sign(counts[-1] - counts[0]) if len(counts) else 1.0
    return np.array([frame.time for frame in frames]) * SECONDS, counts + HALF * sign


def has_edges(frames: Sequence[Encoders]) -> bool:
    """Whether the board tells when edges came."""
    return any(frame.left_edge is not None or frame.right_edge is not None for frame in frames)


def speed(frames: Sequence[Encoders], left: bool, slots: int) -> float:
    """Mean speed in rad/s over whole turns of the wheel, so that uneven slots cancel.

    Less than a turn is fitted by a line. 0 when there were too few edges to tell one.
    """
    pitch = 2 * pi / slots
    if not has_edges(frames):
        times, places = sampled(frames, left)
        if len(times) < LEAST_EDGES or abs(places[-1] - places[0]) < LEAST_EDGES:
            return 0.0
        return float(np.polyfit(times - times[0], places, 1)[0]) * pitch
    times, counts = passed(frames, left)
    if len(times) < LEAST_EDGES:
        return 0.0
    whole = np.flatnonzero((counts[-1] - counts) % slots == 0)
    first = int(whole[0])
    if first < len(times) - 1:
        return float((counts[-1] - counts[first]) / (times[-1] - times[first])) * pitch
    return float(np.polyfit(times - times[0], counts.astype(float), 1)[0]) * pitch
