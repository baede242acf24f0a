"""Encoders that lose every second edge, or count each one twice, beside working ones."""

from __future__ import annotations

from types import SimpleNamespace

import pytest

from diffbotctl.estimation.encoder_faults import (
    PRIORS,
    PROBABILITY_MIN,
    EncoderFaults,
    PossibleFaults,
    change_probabilities,
    fault_probabilities,
)
from diffbotctl.estimation.explained_edges import EdgeRatio, ExplainedEdges

FRAME = 0.02  # s
RATE = 318.3  # edges/s, of a duty of 0.55


def side():
    loop = SimpleNamespace(static=0.1, speed=None, proportional=None, integral=None)
    motor = SimpleNamespace(rated=10.0, lag=0.1, loop=loop, decay="slow", friction=None)
    return SimpleNamespace(motor=motor, encoder=SimpleNamespace(counts=400))


def ratio(counted, friction=0.1, load=1.1):
    """By default at nearly full duty, where a load of all of the duty takes little more than all of
    the edges."""
    return EdgeRatio(1000.0 * counted, 1000.0, 1000.0 * friction, 1000.0 * load)


@pytest.mark.parametrize(
    ("left", "right", "fault"),
    [
        (1.0, 1.0, None),
        (0.9, 1.05, None),  # motors differ
        (0.7, 0.7, None),  # a flat battery
        (1.0, 0.5, 1),  # half of the edges on the right
        (0.45, 0.95, 0),
        (2.1, 1.0, 2),  # each edge counted twice on the left
    ],
)
def test_half_and_twice_differ_from_other_motors_and_batteries(left, right, fault):
    faults = fault_probabilities([([ratio(left)], [ratio(right)])])
    if fault is None:
        assert sum(faults) < 0.03
    else:
        assert faults.index(max(faults)) == fault and max(faults) > 0.3


@pytest.mark.parametrize("share", [0.7, 0.4, 0.2])
def test_a_robot_that_is_heavy_for_its_motors_has_working_encoders(share):
    """At a duty of 0.4 friction takes 0.1 and a load another 0.2: a third of the edges is left."""
    heavy = ratio(share, friction=0.25, load=3.3)
    assert sum(fault_probabilities([([heavy], [heavy])])) < PROBABILITY_MIN


def test_where_friction_takes_nearly_all_of_the_duty_a_ratio_proves_nothing():
    faults = fault_probabilities([([ratio(0.5, 3.0, 5.0)], [ratio(1.0, 3.0, 5.0)])])
    assert sum(faults) < 2.0 * sum(PRIORS)


def test_half_of_the_edges_at_all_duties_is_both_encoders_and_at_low_duties_a_load():
    """At a small duty (a load of all of the duty takes six times the edges explained) and at nearly
    full duty (1.5 times): a load of 0.14 leaves 1 - 6 x 0.14 = 0.16 and 1 - 1.5 x 0.14 = 0.79."""
    low, full = {"friction": 0.5, "load": 6.0}, {"friction": 0.03, "load": 1.5}
    halved = [ratio(0.5, **low), ratio(0.5, **full)]
    faults = fault_probabilities([(halved, halved)])
    assert faults[4] > 0.1 and faults[4] == pytest.approx(sum(faults), rel=0.01)
    heavy = [ratio(0.16, **low), ratio(0.79, **full)]
    assert sum(fault_probabilities([(heavy, heavy)])) < 0.01


def change(left, right):
    """From ratios of 1 to these."""
    return sum(change_probabilities((ratio(1.0), ratio(1.0)), (ratio(left), ratio(right))))


def test_a_wheel_that_counts_half_of_what_it_did_is_likelier_faulty_than_loaded():
    assert change(1.0, 0.5) > 0.1
    assert change(1.0, 0.67) < 0.05
    assert change(0.9, 1.05) == 0.0
    assert change(0.7, 0.75) < 0.05  # another floor


def wheel():
    return SimpleNamespace(explained=ExplainedEdges(side()), lost_share=0.0, lost_text="")


class Drive:
    """Both wheels with duty 0.55, of which each counts a share of its edges."""

    def __init__(self, left_share, right_share, seconds=4.0, pulses=(0.0, 0.0)) -> None:
        self.faults = EncoderFaults()
        self.faults.pulse_log_ratios = pulses
        self.left, self.right = wheel(), wheel()
        self.speed = self.travel = 0.0
        self.go_on(left_share, right_share, seconds)

    def go_on(self, left_share, right_share, seconds):
        for _ in range(round(seconds / FRAME)):
            self.speed += (RATE - self.speed) * 0.18  # a lag of 0.1 s
            before, self.travel = self.travel, self.travel + self.speed * FRAME
            for each, share in ((self.left, left_share), (self.right, right_share)):
                edges = int(share * self.travel) - int(share * before)
                each.explained.add(FRAME, edges, 0.55)
            self.faults.update(self.left, self.right)


def test_a_wheel_that_counts_half_is_named_and_its_travel_is_uncertain():
    drive = Drive(1.0, 0.5)
    assert drive.left.lost_share == 0.0 and 0.4 < drive.right.lost_share < 1.0
    assert drive.left.lost_text == "" and "every second one is missing" in drive.right.lost_text
    assert drive.faults.probability == pytest.approx(drive.right.lost_share**2)


def test_a_wheel_that_counts_twice_is_named():
    drive = Drive(2.0, 1.0)
    assert 0.2 < drive.left.lost_share < 0.5 and drive.right.lost_share == 0.0
    assert "each is counted twice" in drive.left.lost_text


@pytest.mark.parametrize("share", [1.0, 0.75])
def test_equal_wheels_are_not_suspected(share):
    drive = Drive(share, share)
    assert drive.faults.probability == 0.0 and drive.left.lost_text == ""


def test_both_wheels_that_count_half_are_named_with_all_that_looks_alike():
    drive = Drive(0.5, 0.5, pulses=(2.0, 2.0))
    assert drive.left.lost_share == drive.right.lost_share > 0.2
    for text in (drive.left.lost_text, drive.right.lost_text):
        assert "half of the edges" in text and "`slots`" in text and "heavy" in text


def test_pulses_of_half_a_pitch_refute_a_missing_pulse():
    refuted = Drive(1.0, 0.5, pulses=(-4.0, -4.0)).faults.probability
    assert refuted < 0.5 * Drive(1.0, 0.5).faults.probability


@pytest.mark.parametrize(("left", "right"), [(1.0, 0.5), (2.0, 1.0)])
def test_whole_pulses_beside_a_ratio_that_stays_are_those_of_an_unequal_motor(left, right):
    drive = Drive(left, right)
    assert drive.faults.probability > 0.15
    drive.faults.pulse_log_ratios = (-4.0, -4.0)
    drive.go_on(left, right, 2.0)
    assert drive.faults.probability < PROBABILITY_MIN and not drive.right.lost_text
    ended = Drive(left, right)
    ended.faults.pulse_log_ratios = (-4.0, -4.0)
    ended.go_on(1.0, 1.0, 4.0)  # a fault that ended has whole pulses too, but other edges
    assert ended.faults.probability > 0.1


def test_a_fault_that_begins_is_found_within_two_seconds():
    drive = Drive(1.0, 1.0, seconds=6.0)
    assert drive.faults.probability == 0.0
    drive.go_on(1.0, 0.5, 2.0)
    assert drive.faults.probability > PROBABILITY_MIN and drive.right.lost_text


def test_a_wheel_that_counts_again_stays_uncertain_until_the_pose_is_set():
    """After 4 s of half of the edges come 20 s of all of them: the travel of before is wrong."""
    drive = Drive(1.0, 0.5)
    probability = drive.faults.probability
    drive.go_on(1.0, 1.0, 20.0)
    assert drive.faults.probability >= probability
    assert drive.right.lost_text.startswith("at times counts")
    drive.faults.pose_is_set()
    drive.faults.update(drive.left, drive.right)
    assert drive.right.lost_text == ""


def test_the_first_edges_prove_nothing():
    assert Drive(1.0, 0.5, seconds=0.2).faults.probability == 0.0


def test_what_something_else_rules_out_is_not_considered():
    """A gyro whose turns agree with those of the wheels, for example."""
    drive = Drive(1.0, 0.5)
    drive.faults.possible = PossibleFaults(of_one=False)
    drive.go_on(1.0, 0.5, 1.0)
    assert drive.faults.probability < 1e-3 and drive.right.lost_text == ""
