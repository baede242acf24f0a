"""Duty of one motor between the reports of its board."""

from random import Random

import pytest

from diffbotctl.control.speed_loop import SpeedGains
from diffbotctl.estimation.wheel_frame import MotorDuty

GAINS = SpeedGains(0.1, 0.05, 0.05, 0.5)  # the feed-forward of 4 rad/s is 0.3


@pytest.mark.parametrize(
    ("targets", "duty"),
    [
        ([4.0], 0.35),  # what the loop adds stays,
        ([6.0], 0.45),  # also at another speed in the same direction
        ([20.0], 1.0),  # up to full duty
        ([0.0], 0.0),
        ([-4.0], -0.3),  # the loop begins anew
        ([0.0, 4.0], 0.3),
    ],
)
def test_between_two_reports_what_the_loop_adds_stays(targets, duty):
    motor = MotorDuty(GAINS)
    assert motor.update([4.0], False, None) == pytest.approx([0.3])
    assert motor.update([4.0], False, 0.35) == [0.35]
    assert motor.update(targets, False, None)[-1] == pytest.approx(duty)


def test_the_duty_is_never_against_the_target_but_where_it_is_reported():
    """A board turns the duty slowly when a wheel reverses."""
    motor = MotorDuty(GAINS)
    assert motor.update([4.0], False, -0.5) == [-0.5]
    assert motor.update([4.0], False, None) == [0.0]
    assert motor.update([4.0], False, 0.25) == [0.25]
    assert motor.update([4.0], False, None) == pytest.approx([0.25])


def test_a_report_is_the_duty_whatever_was_expected():
    motor, rng = MotorDuty(GAINS), Random(1)
    for _ in range(200):
        target, reported = rng.uniform(-25.0, 25.0), rng.randint(-127, 127) / 127
        assert motor.update([target], False, reported) == [reported]
        expected = reported if target * reported > 0.0 else 0.0
        assert motor.update([target], False, None) == pytest.approx([expected])


def test_a_raw_duty_is_exact_and_the_loop_begins_anew_after_it():
    motor = MotorDuty(GAINS)
    motor.update([4.0], False, 0.5)
    assert motor.update([0.123, -0.456], True, -58 / 127) == [0.123, -0.456]
    assert motor.update([4.0], False, None) == pytest.approx([0.3])
