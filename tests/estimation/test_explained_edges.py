"""Times of edges of which frames tell the number only."""

from __future__ import annotations

from itertools import pairwise
from math import floor

import pytest

from diffbotctl.estimation.explained_edges import EdgeTracker

FRAME = 20_000_000  # ns


def edge_times(rate: float, frames: int = 200) -> list[int]:
    """Of the last edge of each frame with one, of a wheel that makes `rate` edges/s."""
    tracker, times, before = EdgeTracker(), [], 0
    for frame in range(1, frames + 1):
        time = frame * FRAME
        count = floor(rate * time * 1e-9)
        edge = tracker.last_edge(time, count - before, FRAME * 1e-9)
        if count > before:
            assert time - FRAME <= edge <= time
            times.append(edge)
        before = count
    return times


@pytest.mark.parametrize("rate", [26.0, 33.3, 41.0, 47.0])
def test_steady_edges_have_steady_times(rate: float) -> None:
    """With one edge in two frames at most, an interval in whole frames would be wrong by up to half
    of it, and the mean of the speeds too fast."""
    intervals = [1e-9 * (b - a) for a, b in pairwise(edge_times(rate)[50:])]
    speeds = [1.0 / interval for interval in intervals]
    assert sum(speeds) / len(speeds) == pytest.approx(rate, rel=0.06)
    assert max(speeds) < 1.6 * rate


def test_many_edges_in_each_frame() -> None:
    times = edge_times(1000.0)[50:]
    assert all(abs((b - a) - FRAME) < 1_000_000 for a, b in pairwise(times))
