"""Travels of hypotheses about the edges: since when they differ, and by how much in each frame."""

import pytest

from diffbotctl.estimation.edge_hypothesis import EdgeHypothesis
from diffbotctl.estimation.pose_history import FRAMES_MAX
from diffbotctl.estimation.priors import Priors
from diffbotctl.estimation.wheel_kalman import WheelKalman


def hypothesis(*travels):
    return EdgeHypothesis(WheelKalman(Priors(), 20), 0, 0, travels=list(travels))


@pytest.mark.parametrize(
    ("one", "other", "corrections", "frames"),
    [
        ((0.0, 1.0, 2.0), (0.0, 1.0, 2.0), [], 0),
        ((0.0, 1.0, 2.0), (0.0, 1.0, 3.0), [1.0], 1),
        ((0.0, 1.0, 2.0, 3.0), (0.0, 2.0, 3.0, 4.0), [1.0, 0.0, 0.0], 3),
        ((0.0, 1.0, 2.0, 3.0), (0.0, 1.25, 3.0, 4.0), [0.25, 0.75, 0.0], 2),
        ((0.0, 1.0, 2.0), (1.0, 1.5, 2.0), [1.0, -0.5, -0.5], 0),  # and agree in the end
    ],
)
def test_hypotheses_differ_since_the_frame_in_which_their_travels_part(
    one, other, corrections, frames
):
    before, best = hypothesis(*one), hypothesis(*other)
    assert before.corrections(best) == pytest.approx(corrections)
    assert sum(before.corrections(best)) == pytest.approx(other[-1] - one[-1])
    if corrections and frames:
        assert before.frames_since(best) == best.frames_since(before) == frames


def test_the_memory_of_a_long_run_is_bounded():
    old, new = hypothesis(), hypothesis()
    for _ in range(5 * FRAMES_MAX):
        old.motion.z += 0.1
        new.motion.z += 0.2
        old.remember()
        new.remember()
    assert len(old.travels) == len(new.travels) < 2 * FRAMES_MAX
    corrections = old.corrections(new)
    assert len(corrections) == FRAMES_MAX
    assert sum(corrections) == pytest.approx(0.1 * 5 * FRAMES_MAX)
