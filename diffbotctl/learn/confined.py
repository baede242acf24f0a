"""Runs a function in a forked child that is limited in time and memory, and prints nothing."""

from __future__ import annotations

import os
import pickle
import select
import signal
import time
from collections.abc import Callable
from contextlib import suppress
from typing import Generic, TypeVar

from diffbotctl.processes.child_process import fork
from diffbotctl.processes.limited_child import limit_child, send_result

Result = TypeVar("Result")
MEMORY_MAX_BYTES, FILE_MAX_BYTES = 1 << 30, 64 << 20


class ConfinedError(Exception):
    """The child ended without a result; the text states why."""


class Confined(Generic[Result]):
    """A forked child that runs `run` with limits; close it when its result is not waited for.

    `processor` and `wall`: what it may take of both times (s).
    """

    def __init__(self, run: Callable[[], Result], processor: float, wall: float) -> None:
        self.processor, self.wall = processor, wall
        self.began = time.monotonic()
        self.file, write = os.pipe()

        def child() -> int:
            os.close(self.file)
            os.setsid()  # what it starts ends with it
            limit_child(processor, MEMORY_MAX_BYTES, FILE_MAX_BYTES)
            send_result(write, run())
            return 0

        self.pid = fork(child)
        os.close(write)

    def result(self) -> Result:
        """What `run` returned.

        Raises ConfinedError when it took longer, filled the memory, or ended in another way.
        """
        try:
            data = _received(self.file, self.began + self.wall)
            status = self._ended()
        except TimeoutError:
            raise ConfinedError(f"it took more than {self.wall:g} s") from None
        finally:
            self.close()
        if os.WIFSIGNALED(status):
            number = signal.Signals(os.WTERMSIG(status))
            cause = f"its process was ended by {number.name}"
            if number == signal.SIGXCPU:
                cause = (
                    f"it took more than {self.processor:g} s of processor time: an endless loop?"
                )
            raise ConfinedError(cause)
        try:
            result: Result = pickle.loads(data)
        except (EOFError, pickle.UnpicklingError):
            raise ConfinedError("it ended before it gave a result") from None
        return result

    def close(self) -> None:
        """End the child and what it has started."""
        if not self.pid:
            return
        with suppress(ProcessLookupError, PermissionError):
            os.killpg(self.pid, signal.SIGKILL)
        with suppress(ChildProcessError):
            os.waitpid(self.pid, 0)
        os.close(self.file)
        self.pid = 0

    def _ended(self) -> int:
        """The status of the child, which has closed its pipe. Raises TimeoutError."""
        while time.monotonic() < self.began + self.wall:
            found = os.waitid(os.P_PID, self.pid, os.WEXITED | os.WNOHANG | os.WNOWAIT)
            if found is not None:
                return found.si_status if found.si_code != os.CLD_EXITED else found.si_status << 8
            time.sleep(0.002)
        raise TimeoutError


def _received(file: int, end: float) -> bytes:
    """What the child sends until it ends. Raises TimeoutError at `end` of the clock (s)."""
    received = bytearray()
    while True:
        left = end - time.monotonic()
        if left <= 0.0:
            raise TimeoutError
        ready, _, _ = select.select([file], [], [], left)
        if not ready:
            continue
        data = os.read(file, 1 << 16)
        if not data:
            return bytes(received)
        received += data
