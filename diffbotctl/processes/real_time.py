"""Real-time priority for what stands for a machine of its own: an emulated board, a fake device.

A board has its own processor, so programs beside diffbotctl cannot slow it down. An emulated one
shares the computer with them; without priority it misses the host's timeouts when the computer is
busy, in a way in which no board does. Linux gives this priority to root, and to users with a limit
`rtprio`; for others nothing changes.
"""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import contextmanager, suppress

CALLING_THREAD = 0
PRIORITY = 1  # the lowest of the real-time priorities: before every normal program


def prefer(process: int = CALLING_THREAD) -> bool:
    """Run a process, or the calling thread, before all normal programs; not its later children.

    False where the system does not permit it.
    """
    policy = os.SCHED_RR | os.SCHED_RESET_ON_FORK
    with suppress(OSError, AttributeError):  # other systems have no such call
        os.sched_setscheduler(process, policy, os.sched_param(PRIORITY))
        return True
    return False


@contextmanager
def preferred() -> Iterator[None]:
    """The calling thread runs before all normal programs, where the system permits it."""
    is_preferred = prefer()
    try:
        yield
    finally:
        if is_preferred:
            os.sched_setscheduler(CALLING_THREAD, os.SCHED_OTHER, os.sched_param(0))
