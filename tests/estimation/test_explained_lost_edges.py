"""Encoders that lose every second edge, from the edges that their motors' duties explain."""

from __future__ import annotations

from math import log
from types import SimpleNamespace

import pytest

from diffbotctl.estimation.edge_residual import MEASURED_MOTORS, MOTORS, EdgeLogRatio
from diffbotctl.estimation.explained_edges import EdgeRatio, ExplainedEdges
from diffbotctl.estimation.explained_lost_edges import (
    EXPLAINED_PROBABILITY_MIN,
    RATIO_LOG_MIN,
    ExplainedLostEdges,
    ratio_probabilities,
)
from diffbotctl.estimation.lost_edges import SHIFT_PRIORS, FaultProbabilities, suspicion
from diffbotctl.messages import Encoders

FRAME = 20_000_000  # ns
COUNTS = 400
RATED, STATIC = 10.0, 0.1  # rad/s, duty


def side(decay=None):
    loop = SimpleNamespace(static=STATIC, speed=None, proportional=None, integral=None)
    motor = SimpleNamespace(
        rated=RATED, lag=0.1, loop=loop, decay=decay, friction=None, is_shorted=False
    )
    return SimpleNamespace(motor=motor, encoder=SimpleNamespace(counts=COUNTS))


def ratio(counted, friction=0.1, load=1.1):
    """By default at nearly full duty, where a load of all of the duty takes little more than all of
    the edges."""
    edges = EdgeRatio(1000.0 * counted, 1000.0, 1000.0 * friction, 1000.0 * load, 50.0)
    return EdgeLogRatio.of(edges)


def probabilities(left, right, motors=MOTORS):
    """Of the faults, by one ratio of each wheel or one for each class of duties."""
    left, right = (each if isinstance(each, list) else [each] for each in (left, right))
    means = [sum(one.value for one in each) / len(each) for each in (left, right)]
    is_even = abs(means[0] - means[1]) < RATIO_LOG_MIN
    return ratio_probabilities(left, right, is_even, motors)


@pytest.mark.parametrize(
    ("left", "right", "named"),
    [
        (1.0, 1.0, None),
        (0.9, 1.05, None),  # motors differ
        (0.7, 0.7, None),  # a flat battery
        (3.0, 3.2, None),  # motors that are faster than typical at small duties
        (1.0, 0.5, 1),  # half of the edges on the right
        (0.45, 0.95, 0),
        (2.1, 1.0, 2),  # each edge counted twice on the left
        (0.3, 0.6, 0),  # half of them on the left of a robot that is heavy for its motors
    ],
)
def test_half_and_twice_are_told_from_other_motors_and_batteries(left, right, named):
    faults = probabilities(ratio(left), ratio(right))
    if named is None:
        assert sum(faults) < 0.02
    else:
        assert faults.index(max(faults)) == named and max(faults) > 0.3


@pytest.mark.parametrize(("left", "right"), [(0.5, 0.5), (0.42, 0.48)])
def test_half_of_the_edges_on_both_is_likelier_a_heavy_robot_but_may_be_both_encoders(left, right):
    faults = probabilities(ratio(left), ratio(right))
    assert faults.index(max(faults)) == 4
    assert EXPLAINED_PROBABILITY_MIN < sum(faults) < 0.2


@pytest.mark.parametrize("share", [0.7, 0.4, 0.15])
def test_a_robot_that_is_heavy_for_its_motors_has_working_encoders(share):
    """At a duty of 0.4 friction takes 0.1 and a load another 0.2: a third of the edges is left, and
    at the same duty of both wheels no fault is as likely."""
    heavy = ratio(share, friction=0.25, load=3.3)
    assert sum(probabilities(heavy, heavy)) < EXPLAINED_PROBABILITY_MIN


def test_both_motors_may_be_faster_than_typical_where_friction_matters_most():
    """The right one runs at a small duty: it counts three times what a linear motor would."""
    assert sum(probabilities(ratio(1.1, 0.05), ratio(3.0, 1.0, 3.0))) < 0.02
    faults = probabilities(ratio(0.55, 0.05), ratio(3.0, 1.0, 3.0))
    assert faults.index(max(faults)) == 0 and max(faults) > 0.1


def test_half_of_the_edges_at_all_duties_is_both_encoders_and_at_low_duties_a_load():
    """At a small duty (a load of all of the duty takes six times the edges explained) and at nearly
    full duty (1.5 times): a load of 0.14 leaves 1 - 6 x 0.14 = 0.16 and 1 - 1.5 x 0.14 = 0.79."""
    low, full = {"friction": 0.5, "load": 6.0}, {"friction": 0.03, "load": 1.5}
    halved = [ratio(0.5, **low), ratio(0.5, **full)]
    faults = probabilities(halved, halved, MEASURED_MOTORS)
    assert faults.both_lost > 0.15 and sum(faults) == pytest.approx(faults.both_lost)
    heavy = [ratio(0.16, **low), ratio(0.79, **full)]
    assert sum(probabilities(heavy, heavy, MEASURED_MOTORS)) < 0.01


def test_a_measured_curve_leaves_no_doubt_about_a_motor_at_a_small_duty():
    """Of an unknown curve the right wheel may well be as fast as that; of a measured one it counts
    each edge twice."""
    left, right = ratio(1.0, 0.05), ratio(2.0, 0.4, 4.0)
    assert sum(probabilities(left, right)) < 0.05
    faults = probabilities(left, right, MEASURED_MOTORS)
    assert faults.index(max(faults)) == 3 and max(faults) > 0.1


def test_where_friction_takes_nearly_all_of_the_duty_a_ratio_proves_nothing():
    faults = probabilities(ratio(0.5, 3.0, 5.0), ratio(1.0, 3.0, 5.0))
    assert sum(faults) < EXPLAINED_PROBABILITY_MIN
    assert sum(faults) == pytest.approx(sum(SHIFT_PRIORS), rel=0.1)


def test_the_explained_edges_of_a_constant_duty_are_those_of_its_settled_speed():
    """Duty 0.55 settles at (0.55 - 0.1) / 0.9 x 10 = 5 rad/s: 400 / 2 pi x 5 = 318.3 edges/s."""
    explained = ExplainedEdges(side())
    explained.restart(0, 0)
    for frame in range(1, 101):
        explained.update(frame * FRAME, 6 * frame, None, [(0, 0.55)], True)
    first = explained.state.whole
    for frame in range(101, 103):
        explained.update(frame * FRAME, 6 * frame, None, [(0, 0.55)], True)
    second = explained.state.whole
    forgotten = (1.0 - 0.008) * first.explained  # two frames of a memory of 5 s
    assert second.explained - forgotten == pytest.approx(2 * 0.02 * 318.3, rel=1e-3)
    assert second.counted - (1.0 - 0.008) * first.counted == pytest.approx(12.0, rel=1e-3)


def test_open_windings_between_the_pulses_turn_the_motor_faster_at_a_small_duty():
    """Duty 0.55 settles at 10 x 1.05 / 0.9 x (0.55 - 0.1) / (0.55 + 0.05) = 8.75 rad/s."""
    curve = ExplainedEdges(side("fast")).curve
    assert curve.speed(0.55) == pytest.approx(8.75)
    assert curve.speed(1.0) == pytest.approx(10.0)
    assert curve.speed(0.05) == 0.0
    assert ExplainedEdges(side("slow")).curve.speed(0.55) == pytest.approx(5.0)


def test_the_sums_since_a_state_are_those_of_the_frames_after_it():
    explained = ExplainedEdges(side())
    for frame in range(1, 101):
        explained.update(frame * FRAME, 6 * frame, None, [(0, 0.55)], True)
    before = explained.state
    for frame in range(101, 106):
        explained.update(frame * FRAME, 600 + 3 * (frame - 100), None, [(0, 0.55)], True)
    since = explained.state.since(before)
    assert sum(edges.counted for edges in since) == pytest.approx(15.0, rel=0.01)
    assert sum(edges.explained for edges in since) == pytest.approx(5 * 0.02 * 318.3, rel=0.01)
    assert [edges.explained > 0.1 for edges in since] == [False, False, True, False]


@pytest.mark.parametrize(("edges", "share"), [(0, 1.0), (1, 1.0), (3, 0.5), (30, 0.05)])
def test_the_loop_of_a_board_is_less_certain_where_few_edges_come_without_times(edges, share):
    """From 1.5 edges in a frame on, in inverse proportion."""
    explained = ExplainedEdges(side())
    for frame in range(1, 51):
        explained.update(frame * FRAME, edges * frame, None, [(0, 5.0)], False)
    assert explained.state.whole.untimed == pytest.approx(share * explained.state.whole.explained)
    timed = ExplainedEdges(side())
    for frame in range(1, 51):
        timed.update(frame * FRAME, 3 * frame, frame * FRAME - 1_000_000, [(0, 5.0)], False)
    assert timed.state.whole.explained > 0.0 and timed.state.whole.untimed == 0.0


def test_a_standing_wheel_explains_one_edge_until_its_first_one():
    """Its duty does not overcome static friction: it stands for a second with a duty of 0.3."""
    explained = ExplainedEdges(side())
    for frame in range(1, 51):
        explained.update(frame * FRAME, 0, None, [(0, 0.3)], True)
    assert explained.state.whole.explained <= 1.0


def test_friction_stops_a_motor_with_open_windings():
    """From 8 rad/s with lag 0.1 s at 0.6: at duty 0 the damping is 0.05, the lag 1.2 s and the
    friction 10 x 1.05 / 0.9 x 0.1 / 0.05 = 23.3 rad/s against it: 1.2 ln(31.3 / 23.3) = 0.35 s."""
    curve = ExplainedEdges(side("fast")).curve
    speed, travel = curve.moved(8.0, 0.0, 0.34)
    assert 0.0 < speed < 0.4
    assert curve.moved(8.0, 0.0, 1.0) == (0.0, pytest.approx(travel, abs=0.01))


def test_frames_without_a_command_or_near_friction_do_not_count():
    explained = ExplainedEdges(side())
    explained.restart(0, 0)
    assert not explained.update(FRAME, 5, None, [(0, 0.0)], True)
    assert not explained.update(2 * FRAME, 10, None, [(0, 0.11)], True)
    assert not explained.update(2 * FRAME + 130_000_000, 15, None, [(0, 0.5)], True)  # too long
    assert explained.state.whole == EdgeRatio(0.0, 0.0, 0.0, 0.0, 0.0)
    explained.restart(2 * FRAME, 10)
    assert explained.update(3 * FRAME, 15, None, [(0, 0.5)], True)


def take(lost, frame, left, right):
    """Frame number `frame` of wheels with duty 0.55."""
    commands = {"left_command": 0.55, "right_command": 0.55, "command_kind": "duty"}
    lost.update(Encoders(frame * FRAME, left, right, **commands), 0)


def drive(left_share, right_share, seconds=4.0):
    """Both wheels with duty 0.55; each counts a share of its edges."""
    lost = ExplainedLostEdges(side(), side())
    lost.restart(Encoders(0, 0, 0))
    rate, speed, travel = 318.3, 0.0, 0.0
    for frame in range(1, round(seconds / 0.02)):
        speed += (rate - speed) * 0.18  # a lag of 0.1 s
        travel += speed * 0.02
        counts = int(left_share * travel), int(right_share * travel)
        take(lost, frame, *counts)
    return lost


def go_on(lost, seconds):
    """Both wheels go on with duty 0.55 and count all of their edges."""
    first, left, right = lost.left.time // FRAME, lost.left.count, lost.right.count
    for frame in range(1, round(seconds / 0.02)):
        since = int(frame * 0.02 * 318.3)
        take(lost, first + frame, left + since, right + since)


def test_a_wheel_that_counts_half_is_told_and_its_travel_is_uncertain():
    lost = drive(1.0, 0.5)
    left, right = lost.shares
    assert left == 0.0 and 0.4 < right < 1.0
    assert lost.texts[0] == "" and "every second one is missing" in lost.texts[1]
    assert lost.probability == pytest.approx(right * right)


def test_a_wheel_that_counts_twice_is_told():
    lost = drive(2.0, 1.0)
    assert 0.2 < lost.shares[0] < 0.5 and lost.shares[1] == 0.0
    assert "each is counted twice" in lost.texts[0]


def test_equal_wheels_are_not_suspected():
    lost = drive(1.0, 1.0)
    assert lost.probability == 0.0 and lost.shares == (0.0, 0.0)


def test_both_wheels_that_count_half_may_have_to_move_a_heavy_robot():
    lost = drive(0.5, 0.5)
    assert lost.probability == 0.0 and lost.shares == (0.0, 0.0)


def test_both_encoders_are_told_with_all_that_looks_alike():
    told = suspicion(FaultProbabilities(both_lost=0.16))
    assert told.shares == pytest.approx((0.4, 0.4))
    for text in told.texts:
        assert text.startswith("half of the edges") and "`slots`" in text and "battery" in text
        assert "heavy" in text


def test_a_battery_at_60_percent_is_likelier_than_two_encoders_that_fail_alike():
    assert 0.0 < sum(probabilities(ratio(0.6), ratio(0.6))) < 0.1


def test_a_wheel_that_counts_again_stays_told_until_the_pose_is_set():
    """After 4 s of half of the edges come 20 s of all of them: the travel of before is wrong."""
    lost = drive(1.0, 0.5)
    damage, probability = lost.shares, lost.probability
    go_on(lost, seconds=20.0)
    assert lost.present.probability == 0.0
    assert lost.shares[1] >= damage[1] and lost.probability >= probability
    assert lost.texts[1].startswith("at times counts half")
    lost.pose_is_set()
    assert lost.probability == 0.0 and lost.shares == (0.0, 0.0) and lost.texts == ("", "")


def test_the_first_edges_prove_nothing():
    assert drive(1.0, 0.5, seconds=0.2).probability == 0.0


def test_a_ratio_is_the_logarithm_of_counted_over_explained():
    assert ratio(0.5).value == pytest.approx(log(0.5))
