"""Starts and stops leave nothing behind: a sample of what `prove` runs."""

from tests.support.trials.restarts import restarts


def test_runs_that_end_by_themselves_and_by_signals_leave_nothing():
    assert restarts(seed=9, count=8) == []
