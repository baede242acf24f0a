"""Black box, child side: keeps the last minutes of a run's inputs in memory, writes them at a stop.

It lives in the process of the control socket. Each file is written by a process that is forked for
it and holds the inputs as they were: neither a slow disk nor the size of the file delays the
control socket. The process outlives a killed engine, so that what led to that is written too. A
power cut loses the memory: a run that must not be lost is recorded with `--record`.
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
from typing import IO, Any, Literal, NamedTuple

from diffbotctl import user_folders
from diffbotctl.processes.child_process import close_inherited_files, fork, report, split_frames
from diffbotctl.recording.black_box import NOTICE_END, EngineState, StopEvent
from diffbotctl.recording.run_metadata import TEXT_MAX_LENGTH
from diffbotctl.recording.snapshot import StateError, culprit_text
from diffbotctl.recording.snapshot_json import to_json
from diffbotctl.recording.snapshot_restore import plain_classes
from diffbotctl.recording.writer import RecordingHeader, RecordingWriter
from diffbotctl.time import SECOND

FILES_MAX = 10  # in the folder; older ones are deleted
SPAN_MIN = 180 * SECOND  # that is kept, once the run is that old
SIZE_MAX_BYTES = 24 << 20  # three minutes of a 50 Hz board take half a megabyte
PACKET_BYTES = 32 << 10  # that are compressed at once: every few seconds, in a millisecond
AFTER_STOP = SECOND  # ns that are recorded after a stop: how the robot came to rest
FILE_PERIOD_MIN = 10 * SECOND  # between two files, however often the robot is stopped
SAVE_PERIOD_MIN = SECOND
WRITER_NICENESS = 10  # writing a file takes a tenth of a second on a small machine
READ_BYTES = 1 << 16  # at once, between two polls of the clients


class RunMetadata(NamedTuple):
    """What the files contain about the run. `wires` are those of the drivers alone.

    `kinds` are the message classes of all wires.
    """

    folder: Path
    name: str
    wires: dict[str, type]
    about: dict[str, str]
    kinds: tuple[type, ...] = ()


def black_box_folder() -> Path:
    return user_folders.state_folder() / "flights"


def write_black_box(run: RunMetadata, number: int, ring: InputRing, summary: dict[str, str]) -> str:
    """Write file `number` of this run. Returns what to print about it, or about the failure."""
    start = start_of(run, ring)
    try:
        path = _save(run, number, ring, start, summary)
    except OSError as error:
        return write_failed_message(run, error)
    is_whole = ring.known and ring.begin is None
    words = "The whole run so far is" if is_whole else "The last 3 minutes are"
    if start.problem:
        words = f"A replay begins in an unknown state: {start.problem}.\n{words}"
    home = Path.home()
    shown = f"~/{path.relative_to(home)}" if path.is_relative_to(home) else path
    return (
        f"{words} kept: `diffbotctl why` explains it, or\n    diffbotctl replay {shown}{NOTICE_END}"
    )


def write_failed_message(run: RunMetadata, error: OSError) -> str:
    """The line to print when there is no file."""
    cause = os.strerror(error.errno or 0)
    return f"The last minutes could not be kept: {run.folder}: {cause}{NOTICE_END}"


def delete_oldest(folder: Path) -> None:
    """Keep the newest FILES_MAX files of the folder."""
    files = sorted(folder.glob("*.mcap"), key=lambda path: path.stat().st_mtime_ns)
    for path in files[:-FILES_MAX]:
        path.unlink(missing_ok=True)


def _path(run: RunMetadata, number: int) -> Path:
    return run.folder / f"{run.name}-{number}.mcap"


class FlightStart(NamedTuple):
    """Where a file begins: at the start of the run, in a known state (JSON), or in an unknown one.

    `problem`: why it is not known.
    """

    begins: Literal["run", "state", "unknown"]
    state: bytes = b""
    problem: str = ""


def start_of(run: RunMetadata, ring: InputRing) -> FlightStart:
    """Where the file with the inputs in `ring` begins."""
    if ring.begin is None:
        return FlightStart("run" if ring.known else "unknown", problem=ring.state_problem)
    find_class = plain_classes(run.kinds)
    state = pickle.loads(ring.begin.data)
    try:
        return FlightStart("state", to_json(state, find_class))
    except StateError as error:
        problem = culprit_text(state[0], lambda value: to_json(value, find_class)) or str(error)
        return FlightStart("unknown", problem=problem)


def _save(
    run: RunMetadata, number: int, ring: InputRing, start: FlightStart, summary: dict[str, str]
) -> Path:
    run.folder.mkdir(parents=True, exist_ok=True)
    path = _path(run, number)
    draft = path.with_suffix(".part")
    try:
        with draft.open("wb") as file:
            _write(file, run, ring, start, summary)
        draft.replace(path)
    finally:
        draft.unlink(missing_ok=True)
    delete_oldest(run.folder)
    return path


def _write(
    file: IO[bytes], run: RunMetadata, ring: InputRing, start: FlightStart, summary: dict[str, str]
) -> None:
    about = {**run.about, "flight": start.begins}
    if start.problem:
        about["state_problem"] = start.problem[:TEXT_MAX_LENGTH]
    recording = RecordingWriter(file, RecordingHeader(run.wires, len(run.wires), about))
    if ring.begin is not None and start.state:
        recording.attach_state(ring.begin.time, start.state)
    for instant in ring.instants():
        recording.write(instant)
    recording.finish({**summary, "instants": str(recording.instants)})


class InputRing:
    """Batches of instants, pickled and then compressed, and the states between them.

    The oldest part, up to a state, is dropped, so that the rest can be replayed exactly: `begin` is
    that state, None while nothing was dropped. Without states, when a block's state cannot be
    saved, it drops what is too old, and `known` is then False. Times are in ns, sizes in bytes.
    """

    def __init__(
        self,
        span_min: int = SPAN_MIN,
        size_max: int = SIZE_MAX_BYTES,
        packet_size: int = PACKET_BYTES,
    ) -> None:
        self.span_min, self.size_max, self.packet_size = span_min, size_max, packet_size
        self.packets: deque[tuple[int, bytes]] = deque()  # (time of the last instant, compressed)
        self.uncompressed: list[bytes] = []
        self.states: deque[EngineState] = deque()
        self.begin: EngineState | None = None
        self.known = True
        self.state_problem = ""  # why there are no states
        self.size = 0
        self.last = 0

    def add_batch(self, time: int, data: bytes) -> None:
        """Add a pickled list of instants, the last of which was at `time`."""
        self.uncompressed.append(data)
        self.size += len(data)
        self.last = time
        if sum(map(len, self.uncompressed)) >= self.packet_size:
            self._compress()
        self._drop_oldest()

    def add_state(self, state: EngineState) -> None:
        """Add a state: what comes after it can be replayed from here."""
        if state.problem:
            self.state_problem = state.problem
            return
        self._compress()  # no packet contains instants from before and after a state
        self.states.append(state)
        self.size += len(state.data)
        self._drop_oldest()

    def instants(self) -> Iterator[tuple[Any, ...]]:
        """All instants that are kept, in order."""
        for _, packet in self.packets:
            yield from _unpickled(zlib.decompress(packet))
        yield from _unpickled(b"".join(self.uncompressed))

    def _compress(self) -> None:
        if not self.uncompressed:
            return
        packet = zlib.compress(b"".join(self.uncompressed), 1)
        self.size += len(packet) - sum(map(len, self.uncompressed))
        self.packets.append((self.last, packet))
        self.uncompressed.clear()

    def _drop_oldest(self) -> None:
        oldest = self.last - self.span_min
        while self.states and (self.states[0].time <= oldest or self.size > self.size_max):
            self.begin = self.states.popleft()
            self.known = True
            self._drop_until(self.begin.time)
            self.size -= len(self.begin.data)
        if self.packets and (self.size > self.size_max or self._has_no_states(oldest)):
            self._drop_until(max(oldest, self.packets[0][0]))
            self.begin, self.known = None, False

    def _has_no_states(self, oldest: int) -> bool:
        """Whether no state has come for twice the span: then none will."""
        return not self.states and self.packets[0][0] < oldest - self.span_min

    def _drop_until(self, time: int) -> None:
        while self.packets and self.packets[0][0] <= time:
            self.size -= len(self.packets.popleft()[1])


def _unpickled(data: bytes) -> Iterator[tuple[Any, ...]]:
    """The instants of pickled lists that follow one another."""
    file = io.BytesIO(data)
    while file.tell() < len(data):
        yield from pickle.load(file)


class BlackBoxStore:
    """Receives the engine's items over `channel`, and decides when to write a file."""

    def __init__(self, channel: socket.socket, run: RunMetadata) -> None:
        self.channel = channel
        self.run = run
        self.buffer = bytearray()
        self.ring = InputRing()
        self.stop: StopEvent | None = None
        self.next_file = 0  # ns; no file before
        self.next_save = 0
        self.files = 0
        self.writer = 0  # pid of the newest writing process
        self.end: dict[str, str] | None = None
        self.engine_was_killed = False

    def fileno(self) -> int:
        """The file descriptor that becomes readable when an item comes."""
        return self.channel.fileno()

    def read(self) -> bool:
        """Receive what has come, without waiting. False once the engine has ended or died."""
        try:
            data = self.channel.recv(READ_BYTES, socket.MSG_DONTWAIT)
        except BlockingIOError:
            return True
        except ConnectionResetError:
            data = b""
        self.buffer += data
        for item in split_frames(self.buffer):
            self.take(item)
        return bool(data)

    def read_to_end(self) -> None:
        """Receive everything until the engine has ended; then write a file if there is a reason."""
        is_running = True
        while is_running:
            select.select([self.channel], [], [])
            is_running = self.read()
        self.finish()

    def give_up(self) -> None:
        """Keep nothing from here on; the engine notices the end of the channel."""
        self.ring = InputRing()
        self.channel.shutdown(socket.SHUT_RDWR)

    def save(self, cause: str) -> int | None:
        """Begin to write a file without a stop. Returns its number; None: nothing has come yet.

        Within SAVE_PERIOD_MIN it is the last one: many requests must not start many processes.
        """
        if not self.ring.last:
            return None
        if not self.files or self.ring.last >= self.next_save:
            self.next_save = self.ring.last + SAVE_PERIOD_MIN
            before = self.stop, self.next_file
            self._write(cause)
            self.stop, self.next_file = before
        return self.files

    def path(self, number: int) -> Path:
        """The path of file `number`, which appears when it is complete."""
        return _path(self.run, number)

    def take(self, data: bytes) -> None:
        """Take one pickled item from the engine."""
        item: Any = pickle.loads(data)
        match item:
            case list():
                self.ring.add_batch(item[-1][0], data)
            case EngineState():
                self.ring.add_state(item)
            case StopEvent():
                self.stop = self.stop or item
            case _:
                self.end = item
        if self.stop and self.ring.last >= max(self.stop.time + AFTER_STOP, self.next_file):
            self._write(f"{self.stop.code}: {self.stop.cause}")

    def finish(self) -> None:
        """Write a file if the engine was killed, failed, or had stopped the robot."""
        self.engine_was_killed = self.end is None
        if self.end is None:
            self._write("the engine was killed")
        elif self.end["code"] != "0":
            self._write(self.end["cause"])
        elif self.stop is not None:
            self._write(f"{self.stop.code}: {self.stop.cause}")

    def _write(self, cause: str) -> None:
        """Fork a writing process; it is not waited for."""
        self.stop = None
        self.next_file = self.ring.last + FILE_PERIOD_MIN
        if not self.ring.last:
            return
        self.files += 1
        previous_writer = self.writer
        try:
            self.writer = fork(lambda: self._write_file(cause, previous_writer))
        except OSError as error:
            self._announce(write_failed_message(self.run, error))

    def _write_file(self, cause: str, previous_writer: int) -> int:
        """Runs in a process of its own, after `previous_writer` has ended."""
        close_inherited_files({self.channel.fileno()}, WRITER_NICENESS)
        _wait_for(previous_writer)
        self._announce(write_black_box(self.run, self.files, self.ring, self._summary(cause)))
        return 0

    def _announce(self, line: str) -> None:
        if self.engine_was_killed:
            os.write(2, line.encode())  # no other process can print it
        else:
            report(self.channel, line)

    def _summary(self, cause: str) -> dict[str, str]:
        end = self.end or {}
        last = max(self.ring.last, int(end.get("last", 0)))
        code, truth = end.get("code", ""), end.get("truth", "")
        return {"code": code, "cause": cause, "last": str(last), "truth": truth}


def _wait_for(writer: int) -> None:
    """Wait until a writing process has ended, so that files and lines come in order."""
    with suppress(OSError):  # it has ended
        if writer:
            select.select([os.pidfd_open(writer)], [], [])
