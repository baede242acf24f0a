"""Since when two hypotheses about the edges differ."""

import pytest

from diffbotctl.estimation.edge_hypothesis import SPLITS_MAX, EdgeHypothesis, split_time
from diffbotctl.estimation.priors import Priors
from diffbotctl.estimation.wheel_kalman import WheelKalman


def hypothesis(*splits):
    return EdgeHypothesis(WheelKalman(Priors(), 20), 0, 0, splits=splits)


@pytest.mark.parametrize(
    ("one", "other", "time"),
    [
        ((), (), 0),  # of different motors: from the start
        (((5, 0),), ((5, 1),), 5),
        (((5, 0), (7, 0)), ((5, 0), (7, 2)), 7),
        (((5, 0), (7, 0)), ((5, 1),), 5),
        (((5, 0), (7, 0)), ((5, 0), (7, 1), (9, 0)), 7),
        (((5, 0), (7, 0), (8, 1)), ((5, 0), (7, 1), (9, 0)), 7),
    ],
)
def test_hypotheses_differ_since_their_first_split_apart(one, other, time):
    assert split_time(hypothesis(*one), hypothesis(*other)) == time
    assert split_time(hypothesis(*other), hypothesis(*one)) == time


def test_of_a_long_history_the_last_splits_decide():
    common = [(time, 0) for time in range(100)]
    kept = common[1 - SPLITS_MAX :]
    assert split_time(hypothesis(*kept, (200, 0)), hypothesis(*kept, (200, 1))) == 200
