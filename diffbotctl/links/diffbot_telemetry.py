"""State frames of our firmware, turned into messages: counts unwrapped, times in the host's."""

from __future__ import annotations

from typing import NamedTuple

from diffbotctl.links import diffbot_frames as frames
from diffbotctl.links.clock_sync import BoardClock
from diffbotctl.links.diffbot_settings import REFERENCE
from diffbotctl.messages import CommandKind, Encoders, Volts
from diffbotctl.time import SECOND

WRAP = 1 << 16
TICK = frames.TICK_NANOSECONDS
COMMAND_AGE = frames.COMMAND_AGE_NANOSECONDS
EDGE_SLACK = 3 * TICK  # the stamp of one edge, from two frames, may differ by rounding
SEQUENCES = 64  # of state frames
COMMANDS = 16  # numbers of commands

State = frames.StateFrame | frames.CountsFrame


class Sent(NamedTuple):
    """A command as the board will take it."""

    time: int  # ns, host, when it was written
    left: float
    right: float
    kind: CommandKind  # `wheels` or `duty`


class RawEdge(NamedTuple):
    """One flank at an encoder's pin, unfiltered."""

    time: int  # ns, host
    wheel: int  # 0 left, 1 right
    level: int  # after the flank


class _Edge(NamedTuple):
    board: int  # ns of board time
    host: int


class Telemetry:
    """Follows one board from frame to frame.

    `lost` counts state frames missing from the sequence, `latency` (s) is the last time from the
    writing of a command to the arrival of its echo.
    """

    def __init__(self, baud: int) -> None:
        self.clock = BoardClock()
        self.baud = baud
        self.boots = 0
        self.lost = 0
        self.latency = float("nan")
        self._sent: dict[int, Sent] = {}
        self._echoed: int | None = None
        self.forget()

    def forget(self) -> None:
        """The board has restarted: no difference may be taken across that."""
        self.clock.forget()
        self._board: int | None = None
        self._first = (0, 0)  # board time of the first frame, and how many there were
        self._sequence: int | None = None
        self._raw = [0, 0]
        self._counts = [0, 0]
        self._edges: list[_Edge | None] = [None, None]
        self._force: tuple[int, Sent] | None = None

    def restarted(self) -> None:
        """The board shows another start than before."""
        self.boots += 1
        self.forget()

    def wrote(self, sequence: int, sent: Sent) -> None:
        """A command has been written."""
        self._sent[sequence] = sent

    def read(self, now: int, frame: State) -> Encoders:
        """One state frame that arrived at `now`."""
        board = self._unwrap_time(now, frame.time)
        self._count_lost(frame.sequence)
        wire = frames.WIRE[type(frame)] * 10 * SECOND // self.baud
        if self._board is None or board > self._board:
            if self._board is None:
                self._first = (board, 0)
            self._board = board
            self._first = (self._first[0], self._first[1] + 1)
            self.clock.observe(board, now - wire)
        self._measure_latency(now, board, frame)
        time = min(self.clock.to_host(board), now)
        counts = [
            self._unwrap_count(side, raw) for side, raw in enumerate((frame.left, frame.right))
        ]
        edges: list[int | None] = [None, None]
        if isinstance(frame, frames.StateFrame):
            ages = (frame.left_age, frame.right_age)
            edges = [self._edge(side, board, age) for side, age in enumerate(ages)]
        sent, since = self._in_force(board, frame)
        return Encoders(
            time,
            counts[0],
            counts[1],
            edges[0],
            edges[1],
            sent.left,
            sent.right,
            sent.kind,
            since,
            self.boots,
        )

    @property
    def rate(self) -> float:
        """State frames a second of the board's time since its start; nan before there were two."""
        first, count = self._first
        if self._board is None or self._board == first:
            return float("nan")
        return (count - 1) * SECOND / (self._board - first)

    def raw_edges(self, now: int, frame: frames.CaptureFrame) -> list[RawEdge]:
        """The flanks of a capture frame that arrived at `now`; state frames must come as well."""
        board = self._unwrap_time(now, frame.time % WRAP)
        found = []
        for entry in frame.edges[: frame.used]:
            age = (frame.time - entry) & frames.CAPTURE_TIME
            time = self.clock.to_host(board - age * TICK)
            found.append(RawEdge(time, entry >> 15, entry >> 14 & 1))
        return found

    def volts(self, encoders: Encoders, frame: State) -> Volts:
        """The distance sensor's voltage in a state frame."""
        return Volts(encoders.time, volts_of(frame.range))

    def _unwrap_time(self, now: int, low: int) -> int:
        """Full board time, the one nearest to what the clocks suggest."""
        if self._board is None:
            return low * TICK
        expected = self.clock.to_board(now)
        whole = WRAP * TICK
        turns = round((expected - low * TICK) / whole)
        return low * TICK + turns * whole

    def _count_lost(self, sequence: int) -> None:
        if self._sequence is not None:
            self.lost += (sequence - self._sequence - 1) % SEQUENCES
        self._sequence = sequence

    def _measure_latency(self, now: int, board: int, frame: State) -> None:
        """The first frame that shows a command of ours tells it.

        There are sixteen numbers, and another host may have driven the board until just now: what
        took hold before we wrote that number is no echo of ours.
        """
        if frame.command == self._echoed or frame.command_age == frames.COMMAND_AGE_NONE:
            return
        sent = self._sent.get(frame.command)
        held = self.clock.to_host(board - frame.command_age * COMMAND_AGE)
        if sent is None or held + COMMAND_AGE < sent.time:
            return
        self._echoed = frame.command
        if now - sent.time < SECOND:
            self.latency = (now - sent.time) / SECOND

    def _unwrap_count(self, side: int, raw: int) -> int:
        step = (raw - self._raw[side] + WRAP // 2) % WRAP - WRAP // 2
        self._raw[side] = raw
        self._counts[side] += step
        return self._counts[side]

    def _edge(self, side: int, board: int, age: int) -> int | None:
        """One edge keeps the time that its first frame gave it."""
        if age == frames.AGE_NONE:
            return self._edges[side].host if self._edges[side] else None  # type: ignore[union-attr]
        at = board - age * TICK
        known = self._edges[side]
        if known is None or abs(at - known.board) > EDGE_SLACK:
            known = self._edges[side] = _Edge(at, self.clock.to_host(at))
        return known.host

    def _in_force(self, board: int, frame: State) -> tuple[Sent, int | None]:
        """The command that drives the motors, and the host's time since which its values do."""
        kind: CommandKind = "duty" if frames.MODE[frame.mode] == "duty" else "wheels"
        drives = frames.MODE[frame.mode] in ("speed", "duty")
        sent = self._sent.get(frame.command) if drives else None
        sent = sent or Sent(0, 0.0, 0.0, kind)
        before = self._force
        if before is not None and before[1][1:] == sent[1:]:
            return sent, before[0]
        if frame.command_age == frames.COMMAND_AGE_NONE or not drives:
            since = self.clock.to_host(board)
        else:
            since = self.clock.to_host(board - frame.command_age * COMMAND_AGE)
        self._force = (since, sent)
        return sent, since


def volts_of(reading: int) -> float:
    """Volts at an analog pin; nan where the board has no such sensor."""
    if reading == frames.ANALOG_NONE:
        return float("nan")
    return reading * REFERENCE / frames.ANALOG_ONE
