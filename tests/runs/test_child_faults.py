"""Children of a run that are killed or suspended, and a cable: a sample of what `prove` runs."""

import signal
from socket import AF_UNIX, SOCK_SEQPACKET, socketpair

import pytest

from diffbotctl.processes.screen import ScreenFeed
from tests.sampling import by_day
from tests.support.trials.child_faults import child_fault, emulator_fault, unplugged


@pytest.mark.parametrize(
    ("kind", "number"),
    by_day(
        2,
        [
            ("hub", signal.SIGKILL),
            ("recorder", signal.SIGSTOP),
            ("hub", signal.SIGSTOP),
            ("recorder", signal.SIGKILL),
            ("log", signal.SIGSTOP),
            ("screen", signal.SIGSTOP),
        ],
    ),
)
def test_the_run_goes_on_or_ends_and_leaves_nothing(kind, number):
    outcome = child_fault(kind, number, 5)
    assert not outcome.faults, outcome.output


def test_a_killed_emulator_ends_the_run():
    outcome = emulator_fault(signal.SIGKILL, 6)
    assert not outcome.faults, outcome.output
    assert "final stop NOT CONFIRMED" in outcome.output


def test_a_cable_that_is_replugged_needs_resume_and_nothing_else():
    outcome = unplugged(7)
    assert not outcome.faults, outcome.output


def test_a_screen_that_has_left_is_reported_during_the_run_and_not_at_its_end():
    for act, count in ((lambda feed: feed.idle(0), 1), (lambda feed: feed.finish(0, "", False), 0)):
        engine_end, screen_end = socketpair(AF_UNIX, SOCK_SEQPACKET)
        screen_end.close()
        gone = []
        act(ScreenFeed(engine_end, lambda: (0, 0), lambda gone=gone: gone.append(True)))
        assert len(gone) == count
