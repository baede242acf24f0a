"""Missing pulses of an encoder, by the level of its pin between two edges."""

from math import exp, log

import pytest

from diffbotctl.estimation.pin_level import LOG_RATIO_MAX, PulseWidth

INTERVAL = 100_000_000  # ns, between two counted edges
FRAME = 7_000_000  # ns, no divisor of the interval


def turned(share, seconds=20.0, interval=INTERVAL):
    """An even turn; the pin has the counted level for that `share` of the way between two edges."""
    width = PulseWidth()
    time = 0
    while time < seconds * 1e9:
        time += FRAME
        count, since = divmod(time, interval)
        width.update(time, count, time - since, since < share * interval)
    return width


@pytest.mark.parametrize("share", [0.42, 0.5, 0.58])
def test_pulses_of_half_a_pitch_show_that_none_is_missing(share):
    # Both possible widths are excluded as far as the widths of the slots allow.
    assert turned(share).lost_log_ratio == pytest.approx(-LOG_RATIO_MAX)


@pytest.mark.parametrize("share", [0.2, 0.25, 0.75, 0.8])
def test_pulses_of_a_quarter_or_three_show_that_every_second_one_is_missing(share):
    # Of both widths, which are as probable, one explains it.
    expected = log(0.5 * (exp(LOG_RATIO_MAX) + exp(-LOG_RATIO_MAX)))
    assert turned(share).lost_log_ratio == pytest.approx(expected)


def test_a_few_pulses_show_little():
    assert abs(turned(0.25, seconds=0.2).lost_log_ratio) < 1.5
    assert PulseWidth().lost_log_ratio == 0.0


def test_a_fault_that_begins_shows_within_a_few_levels():
    width = turned(0.5)
    time = 20_000_000_000
    edge = time // (2 * INTERVAL)
    while width.lost_log_ratio < 1.0:
        time += FRAME
        count, since = divmod(time, 2 * INTERVAL)
        width.update(time, count - edge + 200, time - since, since < 0.5 * INTERVAL)
    assert time < 30_000_000_000


def test_levels_of_a_wheel_that_does_not_turn_evenly_are_not_used():
    """It stops behind each edge: a wheel that is kicked from edge to edge."""
    width = PulseWidth()
    time, edge = 0, 0
    for count in range(1, 200):
        edge = time
        time += (1 + count % 2) * INTERVAL
        width.update(edge + INTERVAL // 3, count, edge, False)
    assert width.lost_log_ratio == 0.0


def test_without_edge_times_and_after_a_gap_nothing_is_known():
    width = PulseWidth()
    for count in range(100):
        width.update(count * INTERVAL + INTERVAL // 3, count, None, False)
    assert width.lost_log_ratio == 0.0
    turning = turned(0.5)
    turning.restart()
    assert not turning.is_steady
