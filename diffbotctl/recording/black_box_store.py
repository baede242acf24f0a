"""The file of one flight: where it lies, what stands in it, and how many are kept.

The last minutes of a run's inputs, in memory: from the run's start or from a known state.

The flight recorder: keeps the last minutes in the hub's memory, and has them written at a stop.

Each file is written by a process that is forked for it and holds the ring as it was: neither a slow
disk nor the size of the file delays the hub. The hub outlives a killed engine, so that what led to
it is written too. A power cut loses the ring: who must know what came before records with
`--record`.
"""

from __future__ import annotations

import io
import os
import pickle
import select
import socket
import zlib
from collections import deque
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

from diffbotctl.processes.fork import close_inherited_files, fork
from diffbotctl.recording.black_box import EngineState, StopEvent
from diffbotctl.recording.writer_process import report, split_frames
from diffbotctl.time import SECOND

if TYPE_CHECKING:
    pass

KEPT = 10  # files in the folder; older ones go


class RunMetadata(NamedTuple):
    """What the files must know of the run. `wires` are those of the drivers alone."""

    folder: Path
    name: str
    wires: dict[str, type]
    about: dict[str, str]


def black_box_folder() -> Path:
    """Where this user's flights lie."""
    state = os.environ.get("XDG_STATE_HOME")
    home = Path(state) if state and Path(state).is_absolute() else Path.home() / ".local" / "state"
    return home / "diffbotctl" / "flights"


def outcome(subject: RunMetadata, number: int, ring: InputRing, summary: dict[str, str]) -> str:
    """Write flight `number` of this run, and return the line that tells of it."""
    try:
        path = _save(subject, number, ring, summary)
    except OSError as error:
        return write_failed_message(subject, error)
    whole = ring.known and ring.begin is None
    words = "The whole run so far is" if whole else "The last 3 minutes are"
    return f"{words} in {path}; diffbotctl replay {path}\n"


def write_failed_message(subject: RunMetadata, error: OSError) -> str:
    """The line that tells why there is no file."""
    where = f"{subject.folder}: {os.strerror(error.errno or 0)}"
    return f"The last minutes could not be kept: {where}\n"


def delete_oldest(folder: Path) -> None:
    """Keep the newest KEPT flights of the folder."""
    flights = sorted(folder.glob("*.mcap"), key=lambda path: path.stat().st_mtime_ns)
    for path in flights[:-KEPT]:
        path.unlink(missing_ok=True)


def _save(subject: RunMetadata, number: int, ring: InputRing, summary: dict[str, str]) -> Path:
    subject.folder.mkdir(parents=True, exist_ok=True)
    path = subject.folder / f"{subject.name}-{number}.mcap"
    draft = path.with_suffix(".part")
    try:
        with draft.open("wb") as file:
            _record(file, subject, ring, summary)
        draft.replace(path)
    finally:
        draft.unlink(missing_ok=True)
    delete_oldest(subject.folder)
    return path


def _record(file: Any, subject: RunMetadata, ring: InputRing, summary: dict[str, str]) -> None:
    from diffbotctl.recording.mcap_file import Recording  # the writer alone pays for it

    begins = "run" if ring.known and ring.begin is None else "state" if ring.begin else "unknown"
    about = {**subject.about, "flight": begins}
    recording = Recording(file, subject.wires, len(subject.wires), about)
    if ring.begin is not None:
        recording.attach_state(*ring.begin)
    for instant in ring.instants():
        recording.write(instant)
    recording.finish({**summary, "instants": str(recording.instants)})


SPAN = 180 * SECOND  # ns that are kept at the least, once the run is that old
MOST = 24 << 20  # bytes; three minutes of a 50 Hz board take half a megabyte
LOOSE = 32 << 10  # bytes that are compressed in one go: each few seconds, in a millisecond


class InputRing:
    """Batches of instants as they came, pickled and then compressed, and the states between them.

    It forgets from one state to the next, so that what is left can be replayed exactly. Without
    states, when a block cannot give one, it forgets as it goes: `known` is then False.
    """

    def __init__(self, span: int = SPAN, most: int = MOST, packet: int = LOOSE) -> None:
        self.span, self.most, self.packet = span, most, packet
        self.blocks: deque[tuple[int, bytes]] = deque()  # (time of the last instant, compressed)
        self.loose: list[bytes] = []
        self.states: deque[EngineState] = deque()
        self.begin: EngineState | None = None
        self.known = True
        self.size = 0
        self.last = 0

    def keep(self, time: int, data: bytes) -> None:
        """Keep a pickled list of instants, the last of which was at `time`."""
        self.loose.append(data)
        self.size += len(data)
        self.last = time
        if sum(map(len, self.loose)) >= self.packet:
            self._pack()
        self._forget()

    def mark(self, state: EngineState) -> None:
        """Keep a state: what comes after it can be replayed from here."""
        self._pack()  # a block never reaches from before a state to behind it
        self.states.append(state)
        self.size += len(state.data)
        self._forget()

    def instants(self) -> Iterator[tuple[Any, ...]]:
        """All that is kept, in order."""
        for _, block in self.blocks:
            yield from _unpickled(zlib.decompress(block))
        yield from _unpickled(b"".join(self.loose))

    def _pack(self) -> None:
        if not self.loose:
            return
        block = zlib.compress(b"".join(self.loose), 1)
        self.size += len(block) - sum(map(len, self.loose))
        self.blocks.append((self.last, block))
        self.loose.clear()

    def _forget(self) -> None:
        old = self.last - self.span
        while self.states and (self.states[0].time <= old or self.size > self.most):
            self.begin = self.states.popleft()
            self.known = True
            self._drop(self.begin.time)
            self.size -= len(self.begin.data)
        if self.blocks and (self.size > self.most or self._is_late(old)):
            self._drop(max(old, self.blocks[0][0]))
            self.begin, self.known = None, False

    def _is_late(self, old: int) -> bool:
        """No state has come for as long again as the span: none will."""
        return not self.states and self.blocks[0][0] < old - self.span

    def _drop(self, until: int) -> None:
        while self.blocks and self.blocks[0][0] <= until:
            self.size -= len(self.blocks.popleft()[1])


def _unpickled(data: bytes) -> Iterator[tuple[Any, ...]]:
    """The instants of pickled lists that follow one another."""
    file = io.BytesIO(data)
    while file.tell() < len(data):
        yield from pickle.load(file)


AFTER = SECOND  # ns; how the robot came to rest belongs to the story of a stop
APART = 10 * SECOND  # ns between two files, however often something stops the robot
NICENESS = 10  # writing a file takes a tenth of a second of a small machine's time
LARGEST = 1 << 16  # bytes taken between two looks at the hub's clients


class BlackBoxStore:
    """Takes what comes over `channel`, and decides when to write."""

    def __init__(self, channel: socket.socket, subject: RunMetadata) -> None:
        self.channel = channel
        self.subject = subject
        self.buffer = bytearray()
        self.ring = InputRing()
        self.stop: StopEvent | None = None
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
        for item in split_frames(self.buffer):
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
        self.ring = InputRing()
        self.channel.shutdown(socket.SHUT_RDWR)

    def take(self, data: bytes) -> None:
        """Take one pickled item from the engine."""
        item: Any = pickle.loads(data)
        if isinstance(item, list):
            self.ring.keep(item[-1][0], data)
        elif isinstance(item, EngineState):
            self.ring.mark(item)
        elif isinstance(item, StopEvent):
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
            self._say(write_failed_message(self.subject, error))

    def _finish(self, cause: str, before: int) -> int:
        """In a process of its own, after the writer `before` it has ended."""
        close_inherited_files({self.channel.fileno()}, NICENESS)
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
