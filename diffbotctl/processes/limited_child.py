"""A forked child that runs code of the user: limited in time and memory, and it prints nothing."""

from __future__ import annotations

import os
import pickle
import resource
import select
import signal
import sys
import time
from collections.abc import Callable
from contextlib import suppress
from typing import Generic, NamedTuple, TypeVar

from diffbotctl.processes.child_process import fork

Result = TypeVar("Result")
EXIT_POLL_PERIOD_S = 0.002


class ChildLimits(NamedTuple):
    """What a child may use: processor and wall time (s), memory and each file (bytes)."""

    processor: float
    wall: float
    memory: int
    file: int = 64 << 20


class ChildEndedError(Exception):
    """The child ended without a result; the text states why."""


class LimitedChild(Generic[Result]):
    """A forked child that runs `run` and sends back what it returns.

    It inherits all modules and values of this process. Several are followed with `select`, since
    the object stands for its pipe; close it in the end, whether or not its result was taken.
    """

    def __init__(self, run: Callable[[], Result], limits: ChildLimits) -> None:
        self.limits = limits
        self.deadline = time.monotonic() + limits.wall
        self.processor = 0.0  # that it has used (s), once it has ended
        self._received = bytearray()
        self._has_ended = False  # and its process number may belong to another one
        self._file, write = os.pipe()

        def child() -> int:
            os.close(self._file)
            os.setsid()  # what it starts ends with it
            _limit(limits)
            data = pickle.dumps(run())
            while data:
                data = data[os.write(write, data) :]
            return 0

        self._pid = fork(child)
        os.close(write)

    def fileno(self) -> int:
        """The pipe, for `select`."""
        return self._file

    def receive(self) -> bool:
        """Take what the child has sent; whether it has closed its pipe, as it does at its end."""
        data = os.read(self._file, 1 << 16)
        self._received += data
        return not data

    def is_late(self) -> bool:
        return time.monotonic() > self.deadline

    def result(self) -> Result:
        """What `run` returned; waits for it. The child has ended then, and what it has started.

        Raises ChildEndedError when it took longer, filled the memory, or ended in another way.
        """
        try:
            status = self._wait()
        finally:
            self.close()
        if os.WIFSIGNALED(status):
            number = os.WTERMSIG(status)
            cause = f"its process was ended by {signal.Signals(number).name}"
            # The usage that is reported was up to a tenth less than what the limit had counted.
            is_spent = number == signal.SIGKILL and self.processor >= 0.8 * self.limits.processor
            if number == signal.SIGXCPU or is_spent:
                limit = f"{self.limits.processor:g} s of processor time"
                cause = f"it took more than {limit}: code that does not return"
            raise ChildEndedError(cause)
        try:
            result: Result = pickle.loads(self._received)
        except Exception:  # it ended while it wrote
            code = os.waitstatus_to_exitcode(status)
            cause = f"its process ended with exit code {code} before it gave a result"
            raise ChildEndedError(cause) from None
        return result

    def close(self) -> None:
        if not self._pid:
            return
        with suppress(ProcessLookupError, PermissionError):
            os.killpg(self._pid, signal.SIGKILL)
        if not self._has_ended:
            os.kill(self._pid, signal.SIGKILL)  # it may not be a group of its own yet
            os.waitpid(self._pid, 0)
        os.close(self._file)
        self._pid = 0

    def _wait(self) -> int:
        """Receive until the child has ended; its status."""
        is_open = True
        while not self.is_late():
            if is_open:
                left = max(self.deadline - time.monotonic(), 0.0)
                ready, _, _ = select.select([self], [], [], left)
                is_open = not (ready and self.receive())
                continue
            pid, status, usage = os.wait4(self._pid, os.WNOHANG)
            if pid:
                self._has_ended = True
                self.processor = usage.ru_utime + usage.ru_stime
                return status
            time.sleep(EXIT_POLL_PERIOD_S)
        cause = "code that waits, or a busy computer"
        raise ChildEndedError(f"it took more than {self.limits.wall:g} s: {cause}")


def _limit(limits: ChildLimits) -> None:
    """Limit this process, and let it print nothing: the terminal is the parent's."""
    seconds = max(round(limits.processor), 1)
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    resource.setrlimit(resource.RLIMIT_CPU, (seconds, seconds + 1))
    resource.setrlimit(resource.RLIMIT_FSIZE, (limits.file, limits.file))
    with suppress(ValueError, OSError):  # a lower limit is in force
        resource.setrlimit(resource.RLIMIT_AS, (limits.memory, limits.memory))
    null = os.open(os.devnull, os.O_RDWR)
    for number in (0, 1, 2):
        os.dup2(null, number)
    sys.stdout = sys.stderr = os.fdopen(null, "w")
