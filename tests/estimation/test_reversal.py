"""A wheel whose drive reverses: how long it may roll on against it."""

import pytest

from diffbotctl.estimation.edge_hypothesis import EdgeHypothesis
from diffbotctl.estimation.predicted_wheel import DIAGONAL, SPEED_ENTRIES
from diffbotctl.estimation.wheel_frame import WheelFrame
from diffbotctl.estimation.wheel_kalman import WheelKalman
from diffbotctl.estimation.wheel_side import Priors

FRAME = 20_000_000  # ns
LAG = 0.1  # s
SLOTS = 1000


@pytest.mark.parametrize("rest, direction", [(1, 1), (25, -1)])
def test_a_wheel_turns_with_its_drive_once_it_cannot_have_coasted_so_long(rest, direction):
    """However sure the filter is of a speed against the drive, after `rest` frames without it."""
    hypothesis = EdgeHypothesis(WheelKalman(Priors(lag=LAG), SLOTS), 0, 0)
    for frame in range(1, 40):
        hypothesis.update(WheelFrame(frame * FRAME, 3 * frame, None, 150.0, 0, 0.9))
    for frame in range(40, 40 + rest):
        hypothesis.update(WheelFrame(frame * FRAME, 3 * 39, None, -150.0, 39 * FRAME, -0.9))
    hypothesis.motion.speed = 100.0
    best, *_ = hypothesis.update(
        WheelFrame((40 + rest) * FRAME, 3 * 39 + 2, None, -150.0, 39 * FRAME, -0.9)
    )
    assert best.edge_direction == direction


def test_a_wheel_that_was_taken_for_standing_is_followed_when_its_edges_come():
    hypothesis = EdgeHypothesis(WheelKalman(Priors(lag=LAG), SLOTS), 0, 0)
    for frame in range(1, 100):
        hypothesis.update(WheelFrame(frame * FRAME, frame, None, 50.0, 0, 0.4))
    motion = hypothesis.motion
    motion.offset, motion.speed = -300.0, 0.0  # as if friction exceeded the drive, for certain
    motion.covariance = tuple(
        0.0 if entry in (*SPEED_ENTRIES, DIAGONAL[3]) else value
        for entry, value in enumerate(motion.covariance)
    )
    for frame in range(100, 110):
        hypothesis.update(WheelFrame(frame * FRAME, frame, None, 50.0, 0, 0.4))
    assert motion.speed == pytest.approx(50.0, rel=0.3)  # an edge in 20 ms


def test_a_wheel_that_static_friction_should_hold_is_followed_when_its_edges_come():
    """Its friction was measured as a duty of 0.5, and it turns at 0.4."""
    priors = Priors(lag=LAG, breakaway=0.5)
    hypothesis = EdgeHypothesis(WheelKalman(priors, SLOTS), 0, 0)
    for frame in range(1, 30):
        hypothesis.update(WheelFrame(frame * FRAME, 0, None, 50.0, 0, 0.4))
    assert hypothesis.motion.speed == 0.0
    for frame in range(30, 50):
        hypothesis.update(WheelFrame(frame * FRAME, frame - 29, None, 50.0, 0, 0.4))
    assert hypothesis.motion.speed == pytest.approx(50.0, rel=0.3)  # an edge in 20 ms


def test_an_edge_at_a_duty_that_should_not_move_the_wheel_disproves_the_measured_one():
    """From then on it is not held, whatever was measured: with a breakaway five times too high, a
    robot that stopped and started again claimed its goal with an error of 35 deg."""
    hypothesis = EdgeHypothesis(WheelKalman(Priors(lag=LAG, breakaway=0.5), SLOTS), 0, 0)
    assert hypothesis.motion.priors.breakaway == 0.5
    for frame in range(1, 20):
        hypothesis.update(WheelFrame(frame * FRAME, max(frame - 10, 0), None, 50.0, 0, 0.4))
    hypothesis.motion.speed = 0.0  # it rests
    before = hypothesis.motion.z
    hypothesis.motion.predict(0.1, 50.0, 0.4)
    assert hypothesis.motion.z > before
