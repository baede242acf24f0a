"""Unwrapping of ticks: wraps, outliers, restarts."""

import pytest

from diffbotctl.links.rosserial_wheels import TickUnwrapper

RATE = 100 / 60 * 20  # counts/s: 100 rpm, 20 slots
STEP = 60_000_000  # ns between two values; reach: floor(33.3 * 1.5 * 0.11) + 2 = 7 counts


def run(values: list[int]) -> tuple[list[str], TickUnwrapper]:
    """Verdicts on values that arrive every STEP."""
    count = TickUnwrapper(RATE)
    return [count.take(index * STEP, raw) for index, raw in enumerate(values)], count


S, C, A = "suspect", "counted", "anew"


@pytest.mark.parametrize(
    ("values", "verdicts", "value"),
    [
        ([5, 5], [S, C], 5),  # the first one needs a second
        ([0, 0, 2, 4], [S, C, C, C], 4),
        ([0, 0, -2], [S, C, C], -2),  # counts are signed
        ([0, 0, 7], [S, C, C], 7),  # at the reach
        ([0, 0, 8], [S, C, S], 0),  # beyond it
        ([1000000, 3, 4], [S, S, C], 4),  # damaged at the very start
        ([9, 10, 1000000, 12], [S, C, S, C], 12),  # an outlier, then the truth
        ([9, 10, 1000000, -77777, 12], [S, C, S, S, C], 12),  # two that do not agree
        ([500, 500, 0, 1], [S, C, S, A], 1),  # the board has restarted
        ([32766, 32766, -32768, -32766], [S, C, C, C], 32770),  # 16 bits: 32767 + 1 = -32768
        ([-32767, -32767, 32767], [S, C, C], -32769),
        ([10, 10, 10 + 65536], [S, C, S], 10),  # no counter of 16 bits sends this
        ([2147483647, 2147483647, -2147483647], [S, C, C], 2147483649),  # 32 bits
    ],
)
def test_verdicts(values, verdicts, value):
    actual, count = run(values)
    assert (actual, count.value) == (verdicts, value)


def test_more_may_have_been_counted_after_a_pause():
    _, count = run([0, 0])
    later = STEP + 1_000_000_000
    assert count.take(later, 33) == "suspect", "in a second, damage can pass for 33 counts"
    assert count.take(later + STEP, 34) == "counted"
    assert count.value == 34


def test_damage_after_a_pause_is_not_counted():
    _, count = run([0, 0])
    later = STEP + 1_000_000_000
    assert count.take(later, 44) == "suspect"
    assert count.take(later + STEP, 3) == "suspect"  # 41 back in 60 ms: these two do not agree
    assert count.take(later + 2 * STEP, 4) == "counted"
    assert count.value == 4


def test_after_twenty_minutes_a_wrap_could_hide():
    _, count = run([0, 0])
    # 33.3 * 1.5 * 1200 s = 60,000 counts, more than half a wrap of 16 bits
    assert count.take(1_200_000_000_000, 1) == "suspect"
