"""State frames of our firmware, turned into messages: counts unwrapped, times in the host's."""

from __future__ import annotations

from collections import deque
from typing import NamedTuple

from diffbotctl.links import diffbot_frames as frames
from diffbotctl.links.diffbot_codec import WIRE_BYTES
from diffbotctl.links.diffbot_frames import ModeCode
from diffbotctl.links.diffbot_settings import REFERENCE_V
from diffbotctl.links.link_protocol import BITS_PER_BYTE
from diffbotctl.messages import CommandKind, Encoders, Volts
from diffbotctl.time import SECOND

WRAP = 1 << 16
TICK = frames.TICK_NANOSECONDS
COMMAND_AGE = frames.COMMAND_AGE_NANOSECONDS
EDGE_TIME_TOLERANCE = 3 * TICK  # the stamp of one edge, from two frames, may differ by rounding
STATE_NUMBERS = 64  # of state frames
COMMAND_NUMBERS = 16
CLOCK_WINDOW = 30 * SECOND  # of board time that the line is laid through
DRIFT_SPAN_MIN = SECOND  # below, the delays' scatter would pass for drift
DRIFT_MAX = 0.01  # a ceramic resonator is within half of that

State = frames.StateFrame | frames.CountsFrame


class SentCommand(NamedTuple):
    """A command as the board will take it."""

    time: int  # ns, host, when it was written
    left: float
    right: float
    kind: CommandKind


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
        self._sent: dict[int, SentCommand] = {}
        self._echoed: int | None = None
        self.forget()

    def forget(self) -> None:
        """The board has restarted: no difference may be taken across that."""
        self.clock.forget()
        self._board_time: int | None = None  # ns, of the newest frame
        self._first_time = 0  # ns, of the first frame
        self._frames = 0
        self._sequence: int | None = None
        self._raw_counts = [0, 0]
        self._counts = [0, 0]
        self._edges: list[_Edge | None] = [None, None]
        self._in_force: tuple[int, SentCommand] | None = None

    def restarted(self) -> None:
        """The board shows another start than before."""
        self.boots += 1
        self.forget()

    def wrote(self, sequence: int, sent: SentCommand) -> None:
        """A command has been written."""
        self._sent[sequence] = sent

    def read(self, now: int, frame: State) -> Encoders:
        """One state frame that arrived at `now`."""
        board_time = self._unwrap_time(now, frame.time)
        self._count_lost(frame.sequence)
        if self._board_time is None or board_time > self._board_time:
            if self._board_time is None:
                self._first_time = board_time
            self._board_time = board_time
            self._frames += 1
            wire_time = WIRE_BYTES[type(frame)] * BITS_PER_BYTE * SECOND // self.baud
            self.clock.observe(board_time, now - wire_time)
        self._measure_latency(now, board_time, frame)
        time = min(self.clock.to_host(board_time), now)
        left, right = map(self._unwrap_count, (0, 1), (frame.left, frame.right))
        left_edge = right_edge = None
        if isinstance(frame, frames.StateFrame):
            left_edge = self._edge_time(0, board_time, frame.left_age)
            right_edge = self._edge_time(1, board_time, frame.right_age)
        sent, since = self._command_in_force(board_time, frame)
        return Encoders(time, left, right, left_edge, right_edge, *sent[1:], since, self.boots)

    @property
    def rate(self) -> float:
        """State frames a second of the board's time since its start; nan before there were two."""
        if self._board_time is None or self._board_time == self._first_time:
            return float("nan")
        return (self._frames - 1) * SECOND / (self._board_time - self._first_time)

    def raw_edges(self, now: int, frame: frames.CaptureFrame) -> list[RawEdge]:
        """The edges of a capture frame that arrived at `now`; state frames must come as well."""
        board_time = self._unwrap_time(now, frame.time % WRAP)
        edges = []
        for entry in frame.edges[: frame.used]:
            age = (frame.time - entry) & frames.CAPTURE_TIME
            time = self.clock.to_host(board_time - age * TICK)
            edges.append(RawEdge(time, entry >> 15, entry >> 14 & 1))
        return edges

    def volts(self, encoders: Encoders, frame: State) -> Volts:
        """The distance sensor's voltage in a state frame."""
        return Volts(encoders.time, volts_of(frame.range))

    def _unwrap_time(self, now: int, low: int) -> int:
        """Full board time, the one nearest to what the clocks suggest."""
        if self._board_time is None:
            return low * TICK
        expected = self.clock.to_board(now)
        turns = round((expected - low * TICK) / (WRAP * TICK))
        return (low + turns * WRAP) * TICK

    def _count_lost(self, sequence: int) -> None:
        if self._sequence is not None:
            self.lost += (sequence - self._sequence - 1) % STATE_NUMBERS
        self._sequence = sequence

    def _measure_latency(self, now: int, board_time: int, frame: State) -> None:
        """Measure with the first frame that shows a command of ours.

        There are sixteen numbers, and another host may have driven the board until just now: a
        command in force since before we wrote that number is not ours.
        """
        if frame.command == self._echoed or frame.command_age == frames.COMMAND_AGE_NONE:
            return
        sent = self._sent.get(frame.command)
        in_force_since = self._command_start(board_time, frame)
        if sent is None or in_force_since + COMMAND_AGE < sent.time:
            return
        self._echoed = frame.command
        if now - sent.time < SECOND:
            self.latency = (now - sent.time) / SECOND

    def _unwrap_count(self, side: int, raw: int) -> int:
        step = (raw - self._raw_counts[side] + WRAP // 2) % WRAP - WRAP // 2
        self._raw_counts[side] = raw
        self._counts[side] += step
        return self._counts[side]

    def _edge_time(self, side: int, board_time: int, age: int) -> int | None:
        """Host time of a wheel's last edge. An edge keeps the time of the first frame with it."""
        edge = self._edges[side]
        if age != frames.AGE_NONE:
            time = board_time - age * TICK
            if edge is None or abs(time - edge.board) > EDGE_TIME_TOLERANCE:
                edge = self._edges[side] = _Edge(time, self.clock.to_host(time))
        return edge.host if edge else None

    def _command_in_force(self, board_time: int, frame: State) -> tuple[SentCommand, int]:
        """The command that drives the motors, and the host's time since which its values do."""
        kind: CommandKind = "duty" if frame.mode == ModeCode.DUTY else "wheels"
        drives = frame.mode in (ModeCode.SPEED, ModeCode.DUTY)
        sent = self._sent.get(frame.command) if drives else None
        sent = sent or SentCommand(0, 0.0, 0.0, kind)
        if self._in_force is not None and self._in_force[1][1:] == sent[1:]:
            return sent, self._in_force[0]
        if frame.command_age == frames.COMMAND_AGE_NONE or not drives:
            since = self.clock.to_host(board_time)
        else:
            since = self._command_start(board_time, frame)
        self._in_force = (since, sent)
        return sent, since

    def _command_start(self, board_time: int, frame: State) -> int:
        return self.clock.to_host(board_time - frame.command_age * COMMAND_AGE)


def volts_of(reading: int) -> float:
    """Volts at an analog pin; nan where the board has no such sensor."""
    if reading == frames.ANALOG_NONE:
        return float("nan")
    return reading * REFERENCE_V / frames.ANALOG_ONE


class BoardClock:
    """Maps ns of board time, unwrapped, to ns of host time, from frames and their arrivals alone.

    A frame can be late but never early, so the true offset lies below every measured one. The map
    is a line under all measurements: that edge of their lower convex hull which spans the middle of
    the window. It is the line with the least sum of distances (Moon, Skelly and Towsley,
    "Estimation and removal of clock skew from network delay measurements", INFOCOM 1999).
    """

    def __init__(self) -> None:
        self._hull: deque[tuple[int, int]] = deque()
        self._origin = 0
        self._offset = 0
        self._drift = 0.0

    def forget(self) -> None:
        """Begin anew, as after a restart of the board."""
        self._hull.clear()

    def observe(self, board: int, arrival: int) -> None:
        """A frame stamped `board` could not have arrived before `arrival`; `board` must rise."""
        point = (board, arrival - board)
        hull = self._hull
        while len(hull) >= 2 and not _below(hull[-2], hull[-1], point):
            hull.pop()
        hull.append(point)
        while board - hull[0][0] > CLOCK_WINDOW and len(hull) > 2:
            hull.popleft()
        self._fit_line()

    def to_host(self, board: int) -> int:
        """The host's time at which the board's clock showed `board`."""
        return board + self._offset + round(self._drift * (board - self._origin))

    def to_board(self, host: int) -> int:
        """The board's time at the host's time `host`, to the drift's second order."""
        board = host - self._offset
        return board - round(self._drift * (board - self._origin))

    def _fit_line(self) -> None:
        hull = self._hull
        first, last = hull[0], hull[-1]
        if last[0] - first[0] < DRIFT_SPAN_MIN:
            self._origin, self._offset = min(hull, key=lambda point: point[1])
            self._drift = 0.0
            return
        middle = (first[0] + last[0]) // 2
        index = next(i for i in range(1, len(hull)) if hull[i][0] >= middle)
        (start, low), (end, high) = hull[index - 1], hull[index]
        drift = (high - low) / (end - start)
        self._drift = min(max(drift, -DRIFT_MAX), DRIFT_MAX)
        self._origin, self._offset = start, low


def _below(a: tuple[int, int], b: tuple[int, int], c: tuple[int, int]) -> bool:
    """True when `b` lies below the line from `a` to `c`, and so on the lower hull."""
    return (b[1] - a[1]) * (c[0] - a[0]) < (c[1] - a[1]) * (b[0] - a[0])
