"""A command that took effect and was replaced between two frames: the wheel has followed it."""

from math import exp

import pytest

from diffbotctl.config.load import load
from diffbotctl.estimation.commanded_wheel import CommandedWheelOdometer
from diffbotctl.estimation.edge_hypothesis import EdgeHypothesis
from diffbotctl.estimation.wheel_frame import BoardFrame, DriveChange, WheelFrame
from diffbotctl.estimation.wheel_kalman import WheelKalman
from diffbotctl.estimation.wheel_odometer import WheelOdometer
from diffbotctl.estimation.wheel_side import LinkTiming, Priors

MS = 1_000_000
TIMING = LinkTiming(0.0, 0.0, True)


def left_side():
    return load("goal", "book_2wd").robot.drive.left


@pytest.mark.parametrize("edge", [None, 4, 12])
def test_a_skipped_drive_acts_as_if_a_frame_had_shown_it(edge):
    """Frames at 0 and 25 ms; 50 pitches/s from 8 ms on, 90 from 15 ms on; an edge at `edge` ms."""
    two, three, without = (EdgeHypothesis(WheelKalman(Priors(), 20), 0, 0) for _ in range(3))
    for hypothesis in (two, three, without):
        hypothesis.update(WheelFrame(1 * MS, 0, None, 10.0, 1 * MS, 0.2))
    count, edge_time = (0, None) if edge is None else (1, edge * MS)
    skipped = DriveChange(8 * MS, 50.0, 0.5)
    two.update(WheelFrame(25 * MS, count, edge_time, 90.0, 15 * MS, 0.9, skipped))
    three.update(WheelFrame(14 * MS, count, edge_time, 50.0, 8 * MS, 0.5))
    three.update(WheelFrame(25 * MS, count, edge_time, 90.0, 15 * MS, 0.9))
    without.update(WheelFrame(25 * MS, count, edge_time, 90.0, 15 * MS, 0.9))
    # The frame between also shows that no edge had passed by then.
    error = two.motion.speed - three.motion.speed
    assert abs(error) < 0.2 * abs(without.motion.speed - three.motion.speed)
    assert two.motion.z == pytest.approx(three.motion.z, abs=0.02)
    assert two.drive == three.drive == 90.0


def test_the_wheel_s_filter_follows_a_skipped_command_from_rest():
    """20 ms at 4 rad/s before 8 rad/s: the wheel is ahead by the motion of these 20 ms."""
    reported, without = (WheelOdometer(left_side(), 0, 0, TIMING) for _ in range(2))
    frame = BoardFrame(25 * MS, 0, None, 8.0, 25 * MS)
    reported.update(frame._replace(skipped=(5 * MS, 4.0)))
    without.update(frame)
    assert without.filter.motion.travel == 0.0
    # Duty 0.1 + 0.344 of 4 rad/s turns a wheel of the rated speed at 4 rad/s; lag 0.1 s.
    pitches = 4.0 * 20 / 6.2832 * (0.020 - 0.1 * (1 - exp(-0.2)))
    assert reported.filter.motion.travel == pytest.approx(pitches, rel=0.1)


def test_a_wheel_without_an_encoder_follows_a_skipped_command():
    side = left_side()
    wheel = CommandedWheelOdometer(side, 0, 0, TIMING)
    wheel.update(BoardFrame(25 * MS, 0, None, 0.0, 25 * MS, skipped=(5 * MS, 4.0)))
    wheel.report()
    lag = side.motor.lag
    radians = 4.0 * (0.020 - lag * (1 - exp(-0.020 / lag)))
    assert wheel.travel == pytest.approx(0.5 * side.wheel.diameter * radians)
