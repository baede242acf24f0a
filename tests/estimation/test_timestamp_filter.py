"""Frames' times from scattering arrivals."""

from random import Random
from statistics import pstdev

from diffbotctl.estimation.timestamp_filter import TimestampFilter

MS = 1_000_000
PERIOD = 60_606_061  # ns


def arrivals(seed: int, frames: int, pace: float = 1.0):
    chance = Random(seed)
    for frame in range(1, frames):
        true = int(frame * PERIOD * pace)
        yield true, true + int(min(max(chance.gauss(0.0, 8.0), -16.0), 16.0) * MS)


def errors(pairs):
    times, told, out = TimestampFilter(0.008, 16.5), 0, []
    for true, stamp in pairs:
        told = times.sampled(stamp, told)
        out.append((told - true) / MS)
    return out


def test_a_scatter_of_8_ms_becomes_one_of_2():
    settled = [error for seed in range(20) for error in errors(arrivals(seed, 200))[20:]]
    assert 0.5 < pstdev(settled) < 2.5


def test_a_board_that_is_a_percent_slower_is_followed():
    late = [errors(arrivals(seed, 600, pace=1.01))[-1] for seed in range(20)]
    assert abs(sum(late) / len(late)) < 6.0


def test_after_a_pause_the_pace_begins_anew():
    times = TimestampFilter(0.008, 16.5)
    told = 0
    for frame in range(1, 30):
        told = times.sampled(frame * PERIOD, told)
    later = 30 * PERIOD + 700 * MS
    assert times.sampled(later, told) == later


def test_time_never_goes_back_and_a_board_that_stamps_its_frames_is_believed():
    told = [0]
    times = TimestampFilter(0.008, 16.5)
    for _, stamp in arrivals(3, 400):
        told.append(times.sampled(stamp, told[-1]))
    assert told == sorted(told)
    assert TimestampFilter(0.0, 40.0).sampled(123, 100) == 123
