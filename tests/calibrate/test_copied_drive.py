"""Copies of one drive that lack some rows, and drives that only look alike."""

import numpy as np
import pytest

from diffbotctl.calibrate.copied_drive import copied_ratio
from diffbotctl.calibrate.log_reader import CountLog, refuse_repeated
from diffbotctl.errors import UsageError
from tests.support.trials.foreign_drives import draw_foreign_set

ROWS = 400


def log(seed, rows=ROWS):
    """Times (s) and counts of a drive whose speeds change all the time."""
    draw = np.random.default_rng(seed)
    steps = draw.integers(0, 4, size=(rows, 2)).cumsum(axis=0)
    return np.arange(rows) * 0.02 + draw.integers(0, 3, size=rows) / 1000, steps.astype(float)


def part(drive, rows):
    """A copy of these rows whose clock and counters begin at 0."""
    times, counts = drive[0][rows], drive[1][rows]
    return times - times[0], counts - counts[0]


@pytest.mark.parametrize(
    ("rows", "ratio"),
    [
        (np.arange(20, ROWS), 1.0),
        (np.arange(0, ROWS - 20), 1.0),
        (np.r_[0:150, 190:ROWS], 1.0),  # 40 rows in the middle were deleted
        (np.arange(0, ROWS, 2), 1.0),
        (np.arange(0, ROWS // 10), 1.0),
        (np.arange(0, 25), 0.0),  # too few to prove anything
    ],
)
def test_a_copy_without_some_rows(rows, ratio):
    whole = log(1)
    assert copied_ratio(whole, part(whole, rows)) == pytest.approx(ratio, abs=0.02)
    assert copied_ratio(part(whole, rows), whole) == pytest.approx(ratio, abs=0.02)


def test_a_copy_with_another_clock_whose_times_have_more_decimals():
    # Halves of a ms are rounded up or down as the clock decides.
    times, counts = log(1)
    whole = times + 0.0005 * (np.arange(ROWS) % 2), counts
    assert copied_ratio(whole, (whole[0] + 77.7, counts + 1000)) == pytest.approx(1.0, abs=0.02)
    assert copied_ratio(whole, part((whole[0] + 77.7, counts), np.arange(20, ROWS))) > 0.98


def test_two_parts_of_one_drive_share_the_rows_that_both_contain():
    # Rows 0 to 299, and 100 to 399: 200 of 300.
    whole = log(1)
    ratio = copied_ratio(part(whole, np.arange(300)), part(whole, np.arange(100, ROWS)))
    assert ratio == pytest.approx(2 / 3, abs=0.02)
    halves = part(whole, np.arange(200)), part(whole, np.arange(200, ROWS))
    assert copied_ratio(*halves) == 0.0


def test_other_drives_are_no_copies():
    assert copied_ratio(log(1), log(2)) == 0.0
    times = np.arange(ROWS) * 0.02
    even = np.floor(np.outer(times, (30.0, 30.0)))
    assert copied_ratio((times, even), (times[:300], even[:300])) == 0.0  # constant speeds
    drives = draw_foreign_set("copies 5").drives
    for number, one in enumerate(drives):
        for other in drives[:number]:
            assert copied_ratio((one.times, one.counts), (other.times, other.counts)) == 0.0


def test_a_copy_is_named():
    whole = log(1)
    drives = [
        CountLog(name, times, counts / 20, (0.05, 0.05), None)
        for name, (times, counts) in (
            ("one", whole),
            ("two", log(2)),
            ("cut", part(whole, np.arange(30, ROWS))),
        )
    ]
    refuse_repeated(drives[:2])
    with pytest.raises(UsageError, match="E-CALIBRATE-LOG") as raised:
        refuse_repeated(drives)
    said = " ".join(str(raised.value).split())
    assert "contains the same drive as one, of which rows are missing: 100 % of the rows" in said
    assert said.startswith("cut E-CALIBRATE-LOG")
