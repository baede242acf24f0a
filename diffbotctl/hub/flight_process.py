"""The flight recorder's process: keeps the last minutes in memory, and writes them at a stop.

It outlives a killed engine just long enough to write what led to it. A power cut loses the ring:
whoever must know what came before one records with `--record`.
"""

from __future__ import annotations

import os
import pickle
import socket
from contextlib import suppress
from pathlib import Path
from typing import Any, NamedTuple

from diffbotctl.engine.flight import State, Stopped
from diffbotctl.graph import SECOND
from diffbotctl.hub import recorder_process
from diffbotctl.hub.ring import Ring

AFTER = SECOND  # ns; how the robot came to rest belongs to the story of a stop
APART = 10 * SECOND  # ns between two files, however often something stops the robot
KEPT = 10  # files in the folder; older ones go
NICENESS = 10  # writing a file takes a tenth of a second of a small machine's time


class Subject(NamedTuple):
    """What the files must know of the run. `wires` are those of the drivers alone."""

    folder: Path
    name: str
    wires: dict[str, type]
    about: dict[str, str]


def folder() -> Path:
    """Where this user's flights lie."""
    state = os.environ.get("XDG_STATE_HOME")
    home = Path(state) if state and Path(state).is_absolute() else Path.home() / ".local" / "state"
    return home / "diffbotctl" / "flights"


def start(subject: Subject) -> tuple[socket.socket, int]:
    """Fork the recorder. Returns the engine's end of the channel, and the pid."""
    return recorder_process.fork(lambda channel: _serve(channel, subject))


def _serve(channel: socket.socket, subject: Subject) -> int:
    with suppress(OSError):
        os.nice(NICENESS)
    desk = _Desk(channel, subject)
    for data in recorder_process.pieces(channel):
        desk.take(data)
    desk.over()
    return 0


class _Desk:
    """Takes what comes, and decides when to write."""

    def __init__(self, channel: socket.socket, subject: Subject) -> None:
        self.channel = channel
        self.subject = subject
        self.ring = Ring()
        self.stop: Stopped | None = None
        self.free = 0  # ns; no file before
        self.files = 0
        self.end: dict[str, str] | None = None

    def take(self, data: bytes | None) -> None:
        """One piece from the engine; None is a second of silence."""
        if data is None:
            return
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
        if self.end is None:
            os.write(2, self._write("the engine was killed").encode())  # nobody else can say it
        elif self.end["code"] != "0":
            self._write(self.end["cause"])
        elif self.stop is not None:
            self._write(f"{self.stop.code}: {self.stop.cause}")

    def _write(self, cause: str) -> str:
        """Write a flight, and return the line that was said about it."""
        self.stop = None
        self.free = self.ring.last + APART
        line = self._outcome(cause) if self.ring.last else ""
        recorder_process.report(self.channel, line)
        return line

    def _outcome(self, cause: str) -> str:
        try:
            path = self._save(cause)
        except OSError as error:
            where = f"{self.subject.folder}: {os.strerror(error.errno or 0)}"
            return f"The last minutes could not be kept: {where}\n"
        whole = self.ring.known and self.ring.begin is None
        words = "The whole run so far is" if whole else "The last 3 minutes are"
        return f"{words} in {path}; diffbotctl replay {path}\n"

    def _save(self, cause: str) -> Path:
        self.files += 1
        self.subject.folder.mkdir(parents=True, exist_ok=True)
        path = self.subject.folder / f"{self.subject.name}-{self.files}.mcap"
        draft = path.with_suffix(".part")
        try:
            with draft.open("wb") as file:
                _record(file, self.subject, self.ring, self._summary(cause))
            draft.replace(path)
        finally:
            draft.unlink(missing_ok=True)
        prune(self.subject.folder)
        return path

    def _summary(self, cause: str) -> dict[str, str]:
        end = self.end or {}
        last = max(self.ring.last, int(end.get("last", 0)))
        code, truth = end.get("code", ""), end.get("truth", "")
        return {"code": code, "cause": cause, "last": str(last), "truth": truth}


def _record(file: Any, subject: Subject, ring: Ring, summary: dict[str, str]) -> None:
    from diffbotctl.hub.recording import Recording

    begins = "run" if ring.known and ring.begin is None else "state" if ring.begin else "unknown"
    about = {**subject.about, "flight": begins}
    recording = Recording(file, subject.wires, len(subject.wires), about)
    if ring.begin is not None:
        recording.attach_state(*ring.begin)
    for instant in ring.instants():
        recording.write(instant)
    recording.finish({**summary, "instants": str(recording.instants)})


def prune(folder: Path) -> None:
    """Keep the newest KEPT flights of the folder."""
    flights = sorted(folder.glob("*.mcap"), key=lambda path: path.stat().st_mtime_ns)
    for path in flights[:-KEPT]:
        path.unlink(missing_ok=True)
