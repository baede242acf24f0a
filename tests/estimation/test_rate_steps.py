"""Rates of edges that halve or double at once, and motions that a motor can make."""

from __future__ import annotations

from math import exp

import pytest

from diffbotctl.estimation.rate_steps import (
    FOUND_TEXT,
    LOST_TEXT,
    PROBABILITY,
    RateSteps,
)

FRAME_S = 0.02


def counted(rates: list[float], period: float = FRAME_S) -> list[int]:
    """Whole edges of frames in which a wheel makes `rates` (edges/s)."""
    counts, place = [], 0.0
    for rate in rates:
        before, place = place, place + rate * period
        counts.append(int(place) - int(before))
    return counts


def seen(
    counts: list[int], commanded: list[float] | float, has_edge_times: bool = False
) -> RateSteps:
    """What is seen of the counts of frames."""
    steps = RateSteps(has_edge_times)
    demands = [commanded] * len(counts) if isinstance(commanded, float) else commanded
    for edges, demand in zip(counts, demands, strict=True):
        steps.add(FRAME_S, edges, demand)
    return steps


def test_halved_rate() -> None:
    # The loop drives the wheel faster after the step.
    after = [200.0 + 8.0 * frame for frame in range(15)]
    steps = seen(counted([400.0] * 20 + after), 400.0)
    assert steps.text == LOST_TEXT
    assert steps.share == pytest.approx(PROBABILITY**0.5)


def test_doubled_rate_of_a_wheel_whose_edges_were_lost() -> None:
    # The wheel turned faster than commanded, or at its limit below that.
    after = [max(200.0 + 200.0 * exp(-frame / 6.0), 210.0) for frame in range(15)]
    for commanded in (200.0, 300.0):
        assert seen(counted([200.0] * 20 + after), commanded).text == FOUND_TEXT


@pytest.mark.parametrize(
    ("what", "rates"),
    [
        ("steady", [400.0] * 35),
        ("speeding up", [8.0 * frame for frame in range(10, 60)]),
        ("a start", [0.0] * 5 + [400.0 * (1.0 - exp(-frame / 5.0)) for frame in range(40)]),
        ("braking", [400.0 * exp(-frame / 8.0) for frame in range(40)]),
        ("a load", [400.0] * 20 + [200.0 + 200.0 * exp(-frame / 3.0) for frame in range(20)]),
        ("a greater load", [400.0] * 20 + [400.0 * exp(-frame / 3.0) for frame in range(20)]),
        ("blocked", [400.0] * 20 + [0.0] * 15),
        ("a jolt of one frame", [400.0] * 20 + [200.0] + [400.0] * 15),
        ("a third of the edges lost", [400.0] * 20 + [267.0] * 15),
        ("a third more edges", [400.0] * 20 + [533.0] * 15),
    ],
)
def test_other_motions_are_no_steps(what: str, rates: list[float]) -> None:
    assert seen(counted(rates), 400.0).text == "", what


def test_a_command_that_halves() -> None:
    commanded = [400.0] * 20 + [200.0] * 20
    assert seen(counted(commanded), commanded).text == ""


def test_few_edges_show_nothing() -> None:
    """At 60 edges/s and 50 frames/s five edges take longer than a motor's lag."""
    assert seen(counted([60.0] * 30 + [30.0] * 30), 60.0).text == ""


def test_times_of_edges() -> None:
    steps = RateSteps(has_edge_times=True)
    for interval in [0.006] * 40 + [0.012] * 15:
        steps.add(interval, 1, 166.0)
    assert steps.text == LOST_TEXT


def test_a_reversal_in_between() -> None:
    steps = RateSteps(has_edge_times=False)
    for edges in counted([400.0] * 20):
        steps.add(FRAME_S, edges, 400.0)
    steps.restart()
    for edges in counted([200.0] * 10):
        steps.add(FRAME_S, edges, 400.0)
    assert steps.text == ""


def test_setting_the_pose_ends_it() -> None:
    steps = seen(counted([400.0] * 20 + [200.0] * 15), 400.0)
    assert steps.text == LOST_TEXT
    steps.pose_is_set()
    assert (steps.text, steps.share) == ("", 0.0)
