"""Counts beyond what the motors allow: which ratios are named."""

from types import SimpleNamespace

import pytest

from diffbotctl.estimation.explained_edges import FEW, MANY, CountMismatch, EdgeRatio, is_linear


def sums(counted, load=1.2):
    """Of a wheel whose duties explain 1,000 edges; the rest relative to them."""
    return EdgeRatio(1000.0 * counted, 1000.0, 100.0, 1000.0 * load)


@pytest.mark.parametrize(
    ("left", "right", "named"),
    [
        (sums(1.0), sums(0.9), ""),
        (sums(1.2), sums(1.25), ""),  # a full battery and good motors
        (sums(1.8), sums(2.0), MANY),  # half of the slots
        (sums(2.0), sums(1.0), ""),  # one wheel: not the slots of both
        (sums(0.5), sums(0.5), ""),  # motors at half of their rated speed
        (sums(0.25), sums(0.25), FEW),  # four times the slots
        (sums(0.25, load=4.0), sums(0.25, load=4.0), ""),  # a heavy robot at a small duty
        (sums(0.25), sums(0.9), ""),  # one wheel rubs
    ],
)
def test_counts_beyond_what_both_motors_allow_are_named(left, right, named):
    mismatch = CountMismatch(is_linear=True)
    mismatch.compare(left, right)
    assert mismatch.text == ""
    mismatch.compare(left, right)
    assert mismatch.text == named
    assert (mismatch.probability > 0.0) is bool(named) and mismatch.probability < 0.5


def test_open_windings_may_explain_any_number_of_counts():
    mismatch = CountMismatch(is_linear=False)
    for _ in range(3):
        mismatch.compare(sums(4.0), sums(4.0))
    assert mismatch.text == ""
    for _ in range(2):
        mismatch.compare(sums(0.25), sums(0.25))
    assert mismatch.text == FEW


@pytest.mark.parametrize(
    ("decay", "is_shorted", "linear"),
    [(None, True, True), (None, False, False), ("slow", False, True), ("fast", True, False)],
)
def test_what_was_measured_counts_more_than_the_data_sheet_of_the_driver(decay, is_shorted, linear):
    assert is_linear(SimpleNamespace(decay=decay, is_shorted=is_shorted)) is linear
