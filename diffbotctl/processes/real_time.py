"""Scheduling of what may not wait for other programs: the engine of a real robot, and boards.

An engine that waits for a processor sends its commands late. With a real-time priority it runs as
soon as a frame arrives, whatever other programs compute; Linux gives it to root, and to users with
a limit `rtprio`. Without it the engine asks for short time slices: from Linux 6.12 on it then
runs before the programs beside it in most cases.

A board has its own processor, so programs beside diffbotctl cannot slow it down. An emulated one
shares the computer with them; without priority it misses the host's timeouts when the computer is
busy, in a way in which no board does. So it runs before the engine too, as does the watchdog that
stops a robot whose engine hangs. Linux leaves a twentieth of the time to normal programs, so a
block that never returns can be ended.
"""

from __future__ import annotations

import os
import platform
import struct
from collections.abc import Iterator
from contextlib import contextmanager, suppress

try:
    import ctypes
except ImportError:  # a Python that was built without libffi
    ctypes = None  # type: ignore[assignment]

CALLING_THREAD = 0
ENGINE_PRIORITY = 1  # the lowest of the real-time priorities: before every normal program
BOARD_PRIORITY = 2
SLICE_NS = 100_000  # the shortest that Linux accepts
SET_ATTRIBUTES = {"x86_64": 314, "aarch64": 274, "riscv64": 274}  # numbers of a system call
ATTRIBUTES = struct.Struct("IIQiIQQQ")  # struct sched_attr of the kernel, first version
RESET_ON_FORK = 1  # a flag in it: later children get the usual slices


def prefer(process: int = CALLING_THREAD, priority: int = BOARD_PRIORITY) -> bool:
    """Run a process, or the calling thread, before all normal programs; not its later children.

    False where the system does not permit it.
    """
    policy = os.SCHED_RR | os.SCHED_RESET_ON_FORK
    with suppress(OSError, AttributeError):  # other systems have no such call
        os.sched_setscheduler(process, policy, os.sched_param(priority))
        return True
    return False


@contextmanager
def preferred(priority: int = BOARD_PRIORITY) -> Iterator[None]:
    """The calling thread runs before all normal programs, where the system permits it."""
    before = _scheduling()
    is_preferred = prefer(priority=priority)
    try:
        yield
    finally:
        if is_preferred and before is not None:
            policy, parameters = before
            # Only root may take the flag back.
            os.sched_setscheduler(CALLING_THREAD, policy | os.SCHED_RESET_ON_FORK, parameters)


@contextmanager
def preferred_engine() -> Iterator[None]:
    """The calling thread is an engine's: it runs as soon as something arrives for it."""
    with preferred(ENGINE_PRIORITY):
        scheduling = _scheduling()
        if scheduling is not None and scheduling[0] & ~os.SCHED_RESET_ON_FORK == os.SCHED_OTHER:
            request_short_slices()
        yield


def request_short_slices() -> bool:
    """Ask for the shortest time slices for the calling thread, which any user may.

    False where there is no such call. Linux before 6.12 ignores it.
    """
    number = SET_ATTRIBUTES.get(platform.machine())
    is_64_bit = struct.calcsize("P") == 8  # other programs have other numbers
    if ctypes is None or number is None or not is_64_bit:
        return False
    niceness = os.getpriority(os.PRIO_PROCESS, CALLING_THREAD)
    fields = ATTRIBUTES.pack(
        ATTRIBUTES.size, os.SCHED_OTHER, RESET_ON_FORK, niceness, 0, SLICE_NS, 0, 0
    )
    call = ctypes.CDLL(None, use_errno=True).syscall
    return bool(call(number, CALLING_THREAD, fields, 0) == 0)


def _scheduling() -> tuple[int, os.sched_param] | None:
    """Policy and priority of the calling thread; None on systems that have no such call."""
    with suppress(OSError, AttributeError):
        policy = os.sched_getscheduler(CALLING_THREAD)
        return policy, os.sched_getparam(CALLING_THREAD)
    return None
