"""Edges of a wheel that no command explains."""

import pytest

from diffbotctl.estimation.unexplained_edges import UndrivenEdges

FRAME = 0.02  # s


def rested(pitches_per_rad=3.0):
    undriven = UndrivenEdges(pitches_per_rad)
    undriven.add(FRAME, 2, True)
    for _ in range(20):
        undriven.add(FRAME, 0, False)
    return undriven


def test_three_edges_at_rest_may_be_in_either_direction():
    """Counted on by 3, and as probable 3 the other way, 6 from there: (0 + 6**2) / 2 = 18."""
    undriven = rested()
    undriven.add(FRAME, 2, False)
    assert undriven.take_variance() == 0.0 and undriven.text == ""
    undriven.add(FRAME, 1, False)
    assert undriven.take_variance() == pytest.approx(18.0)
    assert undriven.sd == pytest.approx(18.0**0.5)
    assert undriven.text.startswith("turned by 3 edges without a command")
    undriven.pose_is_set()
    assert undriven.text == "" and undriven.sd == 0.0


def test_a_wheel_that_rolls_out_is_not_pushed():
    undriven = UndrivenEdges(3.0)
    undriven.add(FRAME, 2, True)
    for _ in range(10):
        undriven.add(FRAME, 1, False)
    assert undriven.take_variance() == 0.0 and undriven.text == ""


def test_two_edges_while_the_other_wheel_is_driven_are_of_a_wheel_that_is_dragged():
    undriven = rested()
    undriven.is_other_driven = True
    undriven.add(FRAME, 1, False)
    assert undriven.take_variance() == pytest.approx(0.25)
    undriven.add(FRAME, 1, False)
    assert undriven.take_variance() == pytest.approx(2.0 * (4 - 1))
    assert "turned by 2 edges" in undriven.text


def test_a_fine_encoder_that_trembles_is_not_pushed():
    undriven = rested(pitches_per_rad=200.0)
    undriven.add(FRAME, 15, False)  # 0.075 rad
    assert undriven.text == ""
