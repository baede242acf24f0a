"""Edges of both signs in one frame: a wheel rolls on when the sign of its counts changes."""

import pytest

from diffbotctl.estimation.edge_hypothesis import EdgeHypothesis
from diffbotctl.estimation.wheel_frame import CountSign, WheelFrame
from diffbotctl.estimation.wheel_kalman import WheelKalman
from diffbotctl.estimation.wheel_side import Priors
from diffbotctl.time import MILLISECOND as MS

FRAME = 60 * MS
SLOTS = 20


@pytest.mark.parametrize(
    "zero_is_forward, frames",
    [
        # Each frame: its begin (ms), the command, in effect since (ms), its counts; and whether
        # edges of both signs are possible in it.
        (True, [(0, -0.5, 0, -2, True), (60, -0.5, 0, -2, False), (120, 0.0, 130, 1, True)]),
        (False, [(0, -0.5, 0, -2, True), (60, -0.5, 0, -2, False), (120, 0.0, 130, -1, False)]),
        (True, [(0, 0.5, 0, 2, False), (60, 0.0, 70, 1, False), (120, -0.5, 130, -1, True)]),
        # The command of 110 ms may take effect up to 24 ms later, in the frame after it.
        (True, [(60, -0.5, 0, -2, False), (60, 0.0, 110, 1, True), (120, 0.0, 110, 2, True)]),
        (True, [(60, -0.5, 0, -2, False), (60, 0.0, 90, 1, True), (120, 0.0, 90, 2, False)]),
        # Counts of the other sign: the command was earlier than estimated.
        (True, [(60, -0.5, 0, -2, False), (120, -0.5, 0, 1, True)]),
    ],
)
def test_in_which_frames_edges_of_both_signs_are_possible(zero_is_forward, frames):
    sign = CountSign(0.012, zero_is_forward)
    found = [
        sign.update(begin * MS, command, since * MS, steps)
        for begin, command, since, steps, _ in frames
    ]
    assert found == [expected for *_, expected in frames]


def rolling_backwards():
    """A wheel at a steady -30 pitches/s with a count of -30, and its frames so far."""
    motion = WheelKalman(Priors(frame_time=0.001, change_cost=4.0), SLOTS)
    wheel, drive = EdgeHypothesis(motion, 0, 0), -30.0
    for number in range(1, 31):
        time = number * FRAME
        count = -(time * 30 // 1_000_000_000)
        wheel = max(
            wheel.update(WheelFrame(time, count, None, drive, 0, -0.6)),
            key=lambda one: one.motion.log_likelihood,
        )
    return wheel, number


@pytest.mark.parametrize("is_mixed, passed", [(True, 2), (False, 0)])
def test_pairs_of_edges_that_cancel_are_passed_by_the_likeliest_hypothesis(is_mixed, passed):
    """At 30 pitches/s a frame of 60 ms has two edges, on average 1.8; the sign changed between
    them, so the count stands still."""
    wheel, number = rolling_backwards()
    slot = wheel.edge_slot
    frame = WheelFrame((number + 1) * FRAME, wheel.count, None, -30.0, 0, -0.6, None, is_mixed)
    best = max(wheel.update(frame), key=lambda one: one.motion.log_likelihood)
    assert slot - best.edge_slot == passed
