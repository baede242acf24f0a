"""Missing edges of coarse encoders, from the intervals between edges."""

from math import ceil
from random import Random

import pytest

from diffbotctl.estimation.edge_intervals import EdgeIntervals

MS = 1_000_000


def turned(turns, slots=12, covered=(), speed=lambda time: 1.0, jitter=0.0, seed=1, frame=0):
    """A wheel that turns at `speed` (turns/s); its slots are cut with `jitter` (pitches). Without
    edge times the board sends a frame each `frame` (s)."""
    rng = Random(seed)
    intervals = EdgeIntervals()
    places = [slot + rng.gauss(0.0, jitter) for slot in range(slots)]
    angle, time, following = 0.0, 0.0, 1
    while angle < turns:
        time += 0.0005
        angle += 0.0005 * speed(time)
        turn, slot = divmod(following, slots)
        if angle * slots >= turn * slots + places[slot]:
            if slot not in covered:
                at = ceil(time / frame) * frame if frame else time
                intervals.add(round(at * 1e9), 1, round(frame * 1e9))
            following += 1
    return intervals


def test_an_even_wheel_misses_nothing():
    assert turned(10).share == 0.0 and turned(10).text == ""


@pytest.mark.parametrize("seed", range(5))
def test_slots_with_errors_and_a_speed_that_changes_are_no_fault(seed):
    assert turned(10, jitter=0.05, seed=seed).share == 0.0
    assert turned(10, speed=lambda time: min(0.1 + time, 2.0)).share == 0.0
    assert turned(10, speed=lambda time: 1.0 if time % 2 < 1 else 0.5).share == 0.0


@pytest.mark.parametrize(
    ("covered", "missing"),
    [((3,), 1 / 11), ((3, 8), 2 / 10), ((3, 4), 2 / 10)],
)
def test_a_covered_slot_is_missing_once_per_turn(covered, missing):
    intervals = turned(10, covered=covered, jitter=0.03)
    assert intervals.share == pytest.approx(missing, rel=0.2)
    assert intervals.text == f"edges are missing: about {intervals.share:.0%}"


@pytest.mark.parametrize("frame", [0.005, 0.02])
def test_without_edge_times_short_frames_show_missing_edges(frame):
    """12 edges/s: one each 83 ms, which is four frames of 20 ms."""
    assert turned(20, jitter=0.05, frame=frame).share == 0.0
    assert turned(20, covered=(3,), frame=frame).share == pytest.approx(1 / 11, rel=0.3)


def test_without_edge_times_intervals_of_few_frames_are_not_judged():
    assert turned(20, covered=(3,), frame=0.1).judged == 0


def test_a_reversal_and_several_edges_in_a_frame_begin_anew():
    intervals = EdgeIntervals()
    for number in range(40):
        intervals.add(number * 50 * MS, 1 if number % 2 else -1)
    assert intervals.judged == 0
    for number in range(40, 80):
        intervals.add(number * 50 * MS, 2)
    assert intervals.judged == 0


def test_one_long_interval_is_a_seam_of_the_floor():
    intervals, time = EdgeIntervals(), 0
    for number in range(60):
        time += (100 if number == 30 else 50) * MS
        intervals.add(time, 1)
    assert intervals.long == 1 and intervals.share == 0.0
