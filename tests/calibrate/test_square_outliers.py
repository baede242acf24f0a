"""Squares that end far from the others."""

from math import nan
from random import Random

import pytest

from diffbotctl.calibrate.dead_reckoning import EndError
from diffbotctl.calibrate.square_outliers import without_outliers
from diffbotctl.calibrate.umbmark import SquareErrors


def ends(seed, sd, count=5):
    rng = Random(seed)
    return [EndError(0.06 + rng.gauss(0, sd), -0.06 + rng.gauss(0, sd)) for _ in range(count)]


def test_an_end_of_a_missed_slot_is_left_out_and_named():
    counter = [*ends(1, 0.002, 4), EndError(-0.016, 0.071)]
    squares, lines = without_outliers(SquareErrors(1.0, ends(2, 0.002), counter))
    assert len(squares.clockwise) == 5
    assert list(squares.counter) == counter[:4]
    assert len(lines) == 1 and lines[0].startswith("square 5 counter-clockwise left out")


@pytest.mark.parametrize("sd", [0.001, 0.004, 0.02])
def test_the_scatter_of_a_floor_is_kept(sd):
    left_out = 0
    for seed in range(200):
        _, lines = without_outliers(SquareErrors(1.0, ends(seed, sd), ends(seed + 1000, sd)))
        left_out += len(lines)
    assert left_out <= 20  # one in a hundred of 2,000


def test_headings_alone_and_too_few_squares_are_left_as_they_are():
    headings = [EndError(nan, nan, 0.01)] * 5
    assert without_outliers(SquareErrors(1.0, headings, headings))[1] == []
    few = [EndError(0.0, 0.0), EndError(0.0, 0.0), EndError(0.2, 0.0)]
    assert without_outliers(SquareErrors(1.0, few, few))[0].clockwise == few
