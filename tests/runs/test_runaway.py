"""A wheel that turns at full speed is stopped and named; healthy robots drive on."""

import pytest

from tests.sampling import by_day
from tests.support.trials.runaway import LATE_S, false_stop, runaway


@pytest.mark.parametrize("seed", by_day(2, [1, 2, 5]))
def test_a_stuck_wheel_is_stopped_and_named_within_the_bound(seed):
    outcome = runaway(seed)
    assert outcome.named
    assert outcome.stopped < outcome.bound + LATE_S


@pytest.mark.parametrize("number", by_day(2, range(8)))
def test_a_healthy_random_robot_is_not_stopped(number):
    assert false_stop(3, number) == ""
