"""Encoders that begin to lose every second edge: the edges after a step against those before it."""

from __future__ import annotations

import pytest

from diffbotctl.estimation.edge_ratio_steps import EdgeRatioSteps
from diffbotctl.estimation.edge_residual import MEASURED_MOTORS, MOTORS
from diffbotctl.estimation.explained_edges import EdgeRatio, EdgeState, whole

NOTHING = EdgeRatio(0.0, 0.0, 0.0, 0.0, 0.0)


def edges(share, explained=100.0, friction=0.2, load=3.0):
    """Of a motor with `share` of the gain that its calibration states, in one class of duties."""
    return EdgeRatio(share * explained, explained, friction * explained, load * explained, 2.0)


def after(left, right, was=(1.0, 1.0), motors=MEASURED_MOTORS, **duty):
    """Probabilities after both shares became `left` and `right`, in one comparison."""
    steps = EdgeRatioSteps(motors)
    before = [edges(share) for share in was]
    steps.compare(*(EdgeState(0.0, [each, NOTHING], each) for each in before))
    shares = zip(before, (left, right), strict=True)
    now = [[then, edges(share, **duty)] for then, share in shares]
    return steps.compare(*(EdgeState(0.0, classes, whole(classes)) for classes in now))


@pytest.mark.parametrize(
    ("was", "left", "right", "named"),
    [
        ((1.0, 1.0), 0.5, 1.0, 0),
        ((1.0, 1.0), 1.02, 0.52, 1),
        ((0.9, 1.1), 1.8, 1.1, 2),  # all of the edges again
        ((0.7, 0.7), 0.7, 0.35, 1),  # of a robot whose motors are weaker than calibrated
    ],
)
def test_a_factor_of_two_on_one_wheel_is_told(was, left, right, named):
    faults = after(left, right, was)
    assert faults.index(max(faults)) == named and 0.15 < max(faults) < 0.9


@pytest.mark.parametrize(
    ("was", "left", "right"),
    [
        ((1.0, 1.0), 1.0, 1.0),
        ((0.5, 1.0), 0.5, 1.0),  # whatever is wrong, it was so before
        ((1.0, 1.0), 0.8, 0.82),  # a battery that gives way
        ((1.0, 1.0), 1.0, 0.8),  # a load on one of the wheels
    ],
)
def test_what_was_so_before_and_what_a_battery_or_a_load_does_is_not_told(was, left, right):
    assert sum(after(left, right, was)) < 0.025


def test_both_wheels_are_likelier_on_another_floor():
    faults = after(0.5, 0.5)
    assert faults.both_lost == pytest.approx(sum(faults)) and 0.05 < sum(faults) < 0.25
    assert sum(after(0.65, 0.65)) < 0.05


def test_few_edges_show_nothing():
    assert sum(after(0.5, 1.0, explained=7.0)) == 0.0
    assert 0.0 < sum(after(0.5, 1.0, explained=9.0)) < sum(after(0.5, 1.0))


def test_an_unknown_curve_explains_more_edges_at_a_small_duty():
    """After a change to a duty at which friction takes twice of the edges that are left."""
    small = {"friction": 2.0, "load": 12.0}
    assert sum(after(2.0, 1.0, motors=MOTORS, **small)) < sum(after(2.0, 1.0, motors=MOTORS))


def test_the_states_of_the_last_seconds_are_compared():
    """Twelve comparisons without a fault, then the left wheel counts half."""
    steps, counted, told = EdgeRatioSteps(MEASURED_MOTORS), 0.0, []
    for number in range(1, 25):
        counted += 10.0 if number <= 12 else 5.0
        full = 10.0 * number
        sums = [EdgeRatio(each, 10.0 * number, number, number, 0.1) for each in (counted, full)]
        left, right = (EdgeState(0.0, [NOTHING, each], each) for each in sums)
        told.append(steps.compare(left, right).left_lost)
    assert max(told[:12]) < 0.005
    assert max(told[13:18]) > 0.15
    steps.restart()
    assert sum(steps.compare(left, right)) == 0.0
