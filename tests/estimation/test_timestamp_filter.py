"""Sampling times from jittered arrival times."""

from random import Random
from statistics import pstdev

from diffbotctl.estimation.timestamp_filter import TimestampFilter

MS = 1_000_000
PERIOD = 60_606_061  # ns


def arrivals(seed: int, frames: int, pace: float = 1.0):
    rng = Random(seed)
    for frame in range(1, frames):
        true = int(frame * PERIOD * pace)
        yield true, true + int(min(max(rng.gauss(0.0, 8.0), -16.0), 16.0) * MS)


def errors(pairs):
    times, sampled, out = TimestampFilter(0.008, 16.5), 0, []
    for true, stamp in pairs:
        sampled = times.sampled(stamp, sampled)
        out.append((sampled - true) / MS)
    return out


def test_jitter_of_8_ms_is_reduced_to_2_ms():
    settled = [error for seed in range(20) for error in errors(arrivals(seed, 200))[20:]]
    assert 0.5 < pstdev(settled) < 2.5


def test_a_board_that_is_one_percent_slower_is_tracked():
    late = [errors(arrivals(seed, 600, pace=1.01))[-1] for seed in range(20)]
    assert abs(sum(late) / len(late)) < 6.0


def test_the_filter_restarts_after_a_pause():
    times = TimestampFilter(0.008, 16.5)
    sampled = 0
    for frame in range(1, 30):
        sampled = times.sampled(frame * PERIOD, sampled)
    later = 30 * PERIOD + 700 * MS
    assert times.sampled(later, sampled) == later


def test_sampling_times_are_monotonic_and_unchanged_without_jitter():
    sampled = [0]
    times = TimestampFilter(0.008, 16.5)
    for _, stamp in arrivals(3, 400):
        sampled.append(times.sampled(stamp, sampled[-1]))
    assert sampled == sorted(sampled)
    assert TimestampFilter(0.0, 40.0).sampled(123, 100) == 123
