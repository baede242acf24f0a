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
