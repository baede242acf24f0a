"""The flight recorder: keeps the last minutes in the hub's memory, and has them written at a stop.

Each file is written by a process that is forked for it and holds the ring as it was: neither a slow
disk nor the size of the file delays the hub. The hub outlives a killed engine, so that what led to
it is written too. A power cut loses the ring: who must know what came before records with
`--record`.
"""

from __future__ import annotations

import os
import pickle
import select
import socket
from contextlib import suppress
from typing import Any

from diffbotctl.engine.flight import State, Stopped
from diffbotctl.graph import SECOND
from diffbotctl.hub.child import fork, stand_alone
from diffbotctl.hub.flight_file import Subject, could_not, outcome
from diffbotctl.hub.recorder_process import report, whole
from diffbotctl.hub.ring import Ring

AFTER = SECOND  # ns; how the robot came to rest belongs to the story of a stop
APART = 10 * SECOND  # ns between two files, however often something stops the robot
NICENESS = 10  # writing a file takes a tenth of a second of a small machine's time
LARGEST = 1 << 16  # bytes taken between two looks at the hub's clients


class Keeper:
    """Takes what comes over `channel`, and decides when to write."""

    def __init__(self, channel: socket.socket, subject: Subject) -> None:
        self.channel = channel
        self.subject = subject
        self.buffer = bytearray()
        self.ring = Ring()
        self.stop: Stopped | None = None
        self.free = 0  # ns; no file before
        self.files = 0
        self.writer = 0  # pid of the latest one
        self.end: dict[str, str] | None = None
        self.is_orphan = False

    def fileno(self) -> int:
        """The file that becomes readable when something comes."""
        return self.channel.fileno()

    def read(self) -> bool:
        """Take what has come, without waiting. False once the engine has ended or died."""
        try:
            data = self.channel.recv(LARGEST, socket.MSG_DONTWAIT)
        except BlockingIOError:
            return True
        except ConnectionResetError:
            data = b""
        self.buffer += data
        for item in whole(self.buffer):
            self.take(item)
        return bool(data)

    def rest(self) -> None:
        """Take what still comes, until the engine has ended; then write, if that is a reason."""
        goes_on = True
        while goes_on:
            select.select([self.channel], [], [])
            goes_on = self.read()
        self.over()

    def give_up(self) -> None:
        """Keep nothing any longer; the engine sees it by the channel's end."""
        self.ring = Ring()
        self.channel.shutdown(socket.SHUT_RDWR)

    def take(self, data: bytes) -> None:
        """Take one pickled item from the engine."""
        item: Any = pickle.loads(data)
        if isinstance(item, list):
            self.ring.keep(item[-1][0], data)
        elif isinstance(item, State):
            self.ring.mark(item)
        elif isinstance(item, Stopped):
            self.stop = self.stop or item
        else:
            self.end = item
        if self.stop and self.ring.last >= max(self.stop.time + AFTER, self.free):
            self._write(f"{self.stop.code}: {self.stop.cause}")

    def over(self) -> None:
        """The engine has ended, with its last word or without."""
        self.is_orphan = self.end is None
        if self.end is None:
            self._write("the engine was killed")
        elif self.end["code"] != "0":
            self._write(self.end["cause"])
        elif self.stop is not None:
            self._write(f"{self.stop.code}: {self.stop.cause}")

    def _write(self, cause: str) -> None:
        """Fork the writer of a flight. Whoever has forked the hub need not wait for it."""
        self.stop = None
        self.free = self.ring.last + APART
        if not self.ring.last:
            return
        self.files += 1
        before = self.writer
        try:
            self.writer = fork(lambda: self._finish(cause, before))
        except OSError as error:
            self._say(could_not(self.subject, error))

    def _finish(self, cause: str, before: int) -> int:
        """In a process of its own, after the writer `before` it has ended."""
        stand_alone({self.channel.fileno()}, NICENESS)
        _see_end(before)
        self._say(outcome(self.subject, self.files, self.ring, self._summary(cause)))
        return 0

    def _say(self, line: str) -> None:
        if self.is_orphan:
            os.write(2, line.encode())  # nobody else can say it
        else:
            report(self.channel, line)

    def _summary(self, cause: str) -> dict[str, str]:
        end = self.end or {}
        last = max(self.ring.last, int(end.get("last", 0)))
        code, truth = end.get("code", ""), end.get("truth", "")
        return {"code": code, "cause": cause, "last": str(last), "truth": truth}


def _see_end(writer: int) -> None:
    """Wait until an earlier writer has ended, so that files and lines come in order."""
    with suppress(OSError):  # it has ended
        if writer:
            select.select([os.pidfd_open(writer)], [], [])
