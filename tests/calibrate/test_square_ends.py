"""Answers that do not change from square to square as odometry does."""

from math import nan

import pytest

from diffbotctl.calibrate.dead_reckoning import EndError
from diffbotctl.calibrate.square_ends import SquareEnd, end_place, square_errors
from diffbotctl.errors import RunError

NOISE = (0.004, -0.006, 0.002, -0.003, 0.003)  # m, of slip and reading


def driven(error, forward=1.0, left=1.0, noise=1.0, runs=5):
    """Squares of 1 m with this end error (m), noted with these factors."""
    ends = []
    for number in range(runs):
        x, y = end_place(number, 1.0)
        odd = noise * NOISE[number]
        measured = EndError(forward * (x + error[0] + odd), left * (y + error[1] - odd), nan)
        ends.append(SquareEnd(measured, EndError(x, y, 0.0)))
    return ends


@pytest.mark.parametrize(
    ("how", "words"),
    [
        ({}, None),
        ({"forward": 1.02, "left": 1.02}, None),  # a tape that is wrong by 2 % spoils nothing
        ({"noise": 4.0}, None),  # a robot that slips much more than usual
        ({"noise": 4.0, "forward": -1.0, "left": -1.0}, "in front change by -"),
        ({"forward": -1.0, "left": -1.0}, "in front change by -"),
        ({"left": -1.0}, "to the left change by -"),
        ({"forward": 0.1, "left": 0.1}, "in front change by 0.1"),  # 3.5 for 35 mm
        ({"forward": 1 / 25.4, "left": 1 / 25.4}, "in front change by 0.0"),  # inches
        ({"forward": nan, "left": nan}, None),  # headings alone were read
        ({"runs": 1, "forward": -1.0}, None),  # nothing to compare
        ({"runs": 2, "forward": -1.0, "left": -1.0, "noise": 0.3}, "in front change by -"),
    ],
)
def test_answers_against_the_odometry_of_the_same_squares(how, words):
    ends = driven((-0.05, 0.03), **how), driven((0.02, -0.06), **how)
    if words is None:
        square_errors(1.0, *ends)
        return
    with pytest.raises(RunError, match="E-CALIBRATE-ANSWER") as raised:
        square_errors(1.0, *ends)
    assert words in " ".join(str(raised.value).split())
