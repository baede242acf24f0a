"""A host that is suspended, or whose watchdog is lost, while a stock board drives."""

import signal

import pytest

from diffbotctl.drivers.watchdog_process import STOPPED_TEXT
from tests.sampling import by_day
from tests.support.trials.host_freeze import (
    PROGRAM,
    frozen,
    hanging,
    stand,
    watchdog_signalled,
)


@pytest.mark.parametrize("whole_group", by_day(1, [False, True]))
def test_a_suspended_host_is_stopped_and_does_not_drive_when_it_continues(whole_group):
    outcome = frozen(1, whole_group)
    assert outcome.stop_s is not None, outcome.output
    assert outcome.stays, outcome.output
    assert "host_frozen" in outcome.output
    assert "resume" in outcome.output


@pytest.mark.parametrize("number", by_day(1, [signal.SIGSTOP, signal.SIGKILL]))
def test_a_lost_watchdog_ends_the_run(number):
    outcome = watchdog_signalled(2, number)
    assert outcome.stop_s is not None, outcome.output
    assert outcome.stays
    assert "E-WATCHDOG" in outcome.output


def test_a_block_that_hangs_is_stopped_and_named():
    outcome = hanging(3)
    assert outcome.stop_s is not None, outcome.output
    assert outcome.stays, outcome.output
    assert "block hangs took 2" in outcome.output  # 2.5 s, or 2500 ms


def test_the_watchdog_of_a_killed_host_reports_that_it_has_stopped_the_robot():
    with stand(4) as place:
        process = place.start(PROGRAM)
        since = place.now
        process.kill()
        assert place.time_to_stop(since) is not None
        assert STOPPED_TEXT in process.communicate(timeout=30)[0]
