"""Encoders that lose every second edge, from the gains of both motors."""

from __future__ import annotations

from math import exp
from types import SimpleNamespace

import pytest

from diffbotctl.estimation.lost_edges import (
    FRAMES_MIN,
    PROBABILITY_MIN,
    USUAL_LEVEL_MAX,
    USUAL_LEVEL_MIN,
    USUAL_RATIO_MAX,
    FaultProbabilities,
    LostEdges,
    MotorGain,
    PossibleFaults,
    are_usual,
    gain_probabilities,
)
from diffbotctl.estimation.wheel_odometer import compare_gains


def compared(left, right, sd=0.05, frames=FRAMES_MIN):
    lost = LostEdges()
    for _ in range(frames):
        lost.compare(MotorGain(left, sd * sd), MotorGain(right, sd * sd))
    return lost


@pytest.mark.parametrize(
    "left, right",
    [
        *[
            (1.0, 1.0),
            (0.8, 1.0),
            (0.6, 0.65),
            (1.1, 0.75),
            (0.74, 1.27),
            (0.45, 0.5),
            (0.35, 0.35),
        ],
        *[(0.22, 0.2), (0.42, 0.17)],  # a robot that is very heavy for its motors
    ],
)
def test_other_motors_a_flat_battery_and_a_heavy_robot_are_no_faults(left, right):
    lost = compared(left, right)
    assert lost.shares == (0.0, 0.0) and lost.texts == ("", "")


def test_half_of_the_gain_may_be_half_of_the_edges():
    lost = compared(1.05, 0.53)
    left, right = lost.shares
    assert left == 0.0 and 0.45 < right < 1.0
    assert lost.texts[0] == "" and "every second one is missing" in lost.texts[1]


def test_twice_the_gain_may_be_twice_the_edges():
    lost = compared(2.0, 1.0)
    left, right = lost.shares
    assert 0.25 < left < 0.5 and right == 0.0
    assert "each is counted twice" in lost.texts[0]


def test_both_gains_that_no_battery_explains_may_be_both_encoders():
    lost = compared(2.2, 2.1)
    assert lost.shares[0] == lost.shares[1] > 0.2
    assert all("the disc has twice the `slots`" in text for text in lost.texts)


def test_the_width_of_the_pulses_confirms_or_refutes_a_missing_pulse():
    """By hand: 0.2 is 1 to 4; with a likelihood ratio of e**-2 it is 1 to 29.6, with e**2 1.85 to
    1. Twice the edges have pulses as any others, as has a disc with half of the slots."""
    before = FaultProbabilities(left_lost=0.2)
    assert before.given_pulses(-2.0, 0.0, True).left_lost == pytest.approx(1 / 30.56, rel=1e-3)
    assert before.given_pulses(2.0, 0.0, True).left_lost == pytest.approx(1.847 / 2.847, rel=1e-3)
    assert before.given_pulses(0.0, 2.0, True).left_lost == pytest.approx(0.2)
    twice = FaultProbabilities(right_twice=0.2)
    assert twice.given_pulses(-2.0, -2.0, True).right_twice == pytest.approx(0.2)
    both = FaultProbabilities(both_lost=0.2)
    slots = both.given_pulses(-4.0, -4.0, True).both_lost
    assert slots == pytest.approx(0.5 / 4.5, rel=0.01)
    assert both.given_pulses(4.0, 4.0, True).both_lost > 0.99


def test_discs_whose_edges_measured_the_wheels_have_the_stated_slots():
    """By hand: half of the 0.2 is that every second pulse is missing, 0.1 to 0.8."""
    both = FaultProbabilities(both_lost=0.2)
    assert both.given_pulses(0.0, 0.0, False).both_lost == pytest.approx(1 / 9)
    assert both.given_pulses(-4.0, -4.0, False).both_lost < 1e-4


def test_a_gain_of_half_with_pulses_of_half_a_pitch_is_no_fault():
    lost = LostEdges()
    lost.pulse_ratios = (-4.0, -4.0)
    for _ in range(FRAMES_MIN):
        lost.compare(MotorGain(1.05, 0.0025), MotorGain(0.53, 0.0025))
    assert lost.shares == (0.0, 0.0)


def test_narrow_pulses_show_a_fault_that_the_gains_leave_open():
    lost = LostEdges()
    lost.pulse_ratios = (0.0, 3.3)
    for _ in range(FRAMES_MIN):
        lost.compare(MotorGain(1.0, 0.0025), MotorGain(0.62, 0.0025))
    assert lost.shares[0] == 0.0 and lost.shares[1] > 0.3
    assert compared(1.0, 0.62).shares == (0.0, 0.0)  # without them


def test_sums_of_edges_that_are_even_outweigh_gains_that_are_not():
    lost = LostEdges()
    for _ in range(FRAMES_MIN):
        lost.compare(MotorGain(1.05, 0.0025), MotorGain(0.53, 0.0025), are_even=True)
    assert lost.shares == (0.0, 0.0)
    for _ in range(FRAMES_MIN):
        lost.compare(MotorGain(2.2, 0.0025), MotorGain(2.1, 0.0025), are_even=True)
    assert lost.shares[0] > 0.2


def test_what_was_likely_stays_told_until_the_pose_is_set():
    lost = compared(1.05, 0.53)
    told, probability = lost.shares, lost.probability
    for _ in range(FRAMES_MIN):
        lost.compare(MotorGain(1.05, 0.0025), MotorGain(1.0, 0.0025))
    assert lost.shares == told and lost.probability == probability
    assert lost.texts[0] == "" and lost.texts[1].startswith("at times counts half")
    lost.pose_is_set()
    assert lost.shares == (0.0, 0.0) and lost.texts == ("", "")


def turned_wheel(gain, edges):
    """What `compare_gains` reads of a wheel that has given `edges`."""
    motion = SimpleNamespace(gain=gain, gain_variance=0.0025)
    return SimpleNamespace(
        counting=SimpleNamespace(position=edges), filter=SimpleNamespace(motion=motion)
    )


@pytest.mark.parametrize(("edges", "is_told"), [(0.0, False), (11.0, False), (-12.0, True)])
def test_the_gain_of_a_wheel_that_has_hardly_turned_proves_nothing(edges, is_told):
    """A heavy robot turns about its left wheel: the load has not yet shown in the gain of that."""
    lost = LostEdges()
    for _ in range(FRAMES_MIN):
        compare_gains(lost, turned_wheel(1.0, edges), turned_wheel(0.45, 40.0), False)
    assert any(lost.shares) is is_told


def test_what_something_else_rules_out_is_not_told():
    one, both = PossibleFaults(of_one=False), PossibleFaults(of_both=False)
    for gains, impossible, other in (((1.05, 0.53), one, both), ((2.2, 2.1), both, one)):
        lost = compared(*gains)
        told = lost.shares
        assert any(told)
        lost.possible = other
        lost.compare(*(MotorGain(gain, 0.0025) for gain in gains))
        assert lost.shares == pytest.approx(told, rel=0.1)
        lost.possible = impossible
        lost.compare(*(MotorGain(gain, 0.0025) for gain in gains))
        assert lost.shares == (0.0, 0.0) and lost.texts == ("", "")
        lost.possible = other
        lost.compare(MotorGain(1.0, 0.0025), MotorGain(1.0, 0.0025))
        assert lost.texts == ("", "")  # what was ruled out is forgotten


def test_the_other_gain_is_the_calibrated_one_times_the_level_of_the_battery():
    """The ratio is 0.5 in all three: with a full, a flat, and with no possible battery."""
    full, flat, impossible = (compared(left, 0.5 * left).shares[1] ** 2 for left in (1, 0.8, 1.35))
    assert full > 2.0 * impossible and flat > 2.0 * impossible


def test_a_wheel_that_may_rub_is_less_certain():
    assert 0.3 < compared(0.54, 1.0).shares[0] < compared(0.5, 1.0).shares[0]


def test_a_gain_that_is_not_known_is_no_evidence():
    assert compared(0.5, 1.0, sd=0.5).shares == (0.0, 0.0)


def test_a_moment_is_not_enough():
    assert compared(0.5, 1.0, frames=FRAMES_MIN - 1).shares == (0.0, 0.0)


@pytest.mark.parametrize("sd", [0.0, 0.03, 0.1, 0.3, 1.0])
def test_usual_gains_make_no_fault_likely_whatever_is_known_of_them(sd):
    """The whole range in which the probabilities are not computed, with its limits."""
    for level in range(26):
        for ratio in range(-10, 11):
            mean = USUAL_LEVEL_MIN + (USUAL_LEVEL_MAX - USUAL_LEVEL_MIN) * level / 25
            half = 0.5 * USUAL_RATIO_MAX * ratio / 10
            left, right = exp(mean + half), exp(mean - half)
            gains = MotorGain(left, (sd * left) ** 2), MotorGain(right, (sd * right) ** 2)
            is_inside = abs(ratio) < 10 and 0 < level < 25
            assert not is_inside or are_usual(*gains)
            assert sum(gain_probabilities(*gains)) < 0.25 * PROBABILITY_MIN


@pytest.mark.parametrize(
    "left, right", [(1.0, 0.73), (0.73, 1.0), (1.3, 1.3), (0.36, 0.36), (0.0, 1.0), (1.0, -0.1)]
)
def test_gains_beyond_the_usual_ones_are_compared(left, right):
    assert not are_usual(MotorGain(left, 0.01), MotorGain(right, 0.01))
