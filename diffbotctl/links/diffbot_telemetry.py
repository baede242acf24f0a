"""State frames of our firmware as messages: counts unwrapped, board time mapped to host time."""

from __future__ import annotations

from collections import deque
from math import radians
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
EDGE_TIME_TOLERANCE = 3 * TICK  # times of one edge from two frames differ by rounding
STATE_NUMBERS = 64  # sequence numbers of state frames
COMMAND_NUMBERS = 16  # sequence numbers of commands
# For which a wheel goes on at its speed in a gap: without commands the board stops it after 0.1 to
# 0.5 s, while a gap in one direction of the radio alone stops nothing.
DRIVEN_ON_MAX = SECOND // 2
BURST_PART = 16  # the wire time of one frame, 1 ms or more, suffices for a hundred frames
CLOCK_WINDOW = 30 * SECOND  # of board time that the line is fitted to
DRIFT_SPAN_MIN = SECOND  # in a shorter span the jitter of the delays would look like drift
# A quartz or ceramic resonator is within 0.005, a chip's own RC oscillator is not. Beyond this
# limit a serial link reads no byte: its last bit is then half a bit off.
DRIFT_MAX = 0.05

State = frames.StateFrame | frames.CountsFrame | frames.InertialFrame
TURN = radians(frames.TURN_NANODEGREES * 1e-9)


class SentCommand(NamedTuple):
    """A command in the values that the board receives."""

    time: int  # ns, host, when it was written
    left: float
    right: float
    kind: CommandKind


class RawEdge(NamedTuple):
    """One edge at an encoder's pin, unfiltered."""

    time: int  # ns, host
    wheel: int  # 0 left, 1 right
    level: int  # after the edge


class _Edge(NamedTuple):
    board: int  # ns of board time
    host: int


class Telemetry:
    """Converts the state frames of one board.

    `lost` counts state frames missing from the sequence. `latency` (s) is the time from writing a
    command to the first frame that shows it, measured last.
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
        """Forget counts, times and the clock: those of a restarted board begin again."""
        self.clock.forget()
        self._board_time: int | None = None  # ns, of the newest frame
        self._first_time = 0  # ns, of the first frame
        self._frames = 0
        self._sequence: int | None = None
        self._raw_counts = [0, 0]
        self._rates = [0.0, 0.0]  # counts per ns, between the last two frames
        self._counts = [0, 0]
        self._raw_turn = self._turn = 0
        self._edges: list[_Edge | None] = [None, None]
        self._in_force: tuple[int, SentCommand] | None = None
        self._shown_command: int | None = None  # by the last frame
        self._frame_time = 0  # ns, host, of the last frame

    def restarted(self) -> None:
        """The board has restarted since the last frame."""
        self.boots += 1
        self.forget()

    def wrote(self, sequence: int, sent: SentCommand) -> None:
        self._sent[sequence] = sent

    def is_newer(self, now: int, frame: State) -> bool:
        """Whether the board made a frame that arrived at `now` after the newest one so far."""
        return self._board_time is None or self._unwrap_time(now, frame.time) > self._board_time

    def read(self, now: int, frame: State) -> Encoders:
        """Message of a state frame that arrived at `now`."""
        board_time = self._unwrap_time(now, frame.time)
        self._count_lost(frame.sequence)
        elapsed = 0 if self._board_time is None else board_time - self._board_time
        if self._board_time is None or board_time > self._board_time:
            if self._board_time is None:
                self._first_time = board_time
            self._board_time = board_time
            self._frames += 1
            wire_time = WIRE_BYTES[type(frame)] * BITS_PER_BYTE * SECOND // self.baud
            self.clock.observe(board_time, now - wire_time)
        self._measure_latency(now, board_time, frame)
        time = self._host_time(now, board_time, elapsed)
        left = self._unwrap_count(0, frame.left, elapsed)
        right = self._unwrap_count(1, frame.right, elapsed)
        left_edge = right_edge = None
        if not isinstance(frame, frames.CountsFrame):
            left_edge = self._edge_time(0, board_time, frame.left_age)
            right_edge = self._edge_time(1, board_time, frame.right_age)
        sent, since = self._command_in_force(board_time, frame)
        encoders = Encoders(time, left, right, left_edge, right_edge, *sent[1:], since, self.boots)
        duty = frame.duty / frames.REPORTED_DUTY_ONE
        level = None if isinstance(frame, frames.InertialFrame) else frame.level
        if frame.sequence % 2:
            encoders = encoders._replace(right_level=level, right_duty=duty)
        else:
            encoders = encoders._replace(left_level=level, left_duty=duty)
        skipped = self._skipped_command(frame, sent, since)
        self._shown_command, self._frame_time = frame.command, time
        if skipped is not None:
            encoders = encoders._replace(
                skipped_command_time=skipped.time,
                skipped_left_command=skipped.left,
                skipped_right_command=skipped.right,
            )
        if isinstance(frame, frames.InertialFrame):
            return encoders._replace(turn=self._unwrap_turn(frame.turn))
        return encoders

    @property
    def rate(self) -> float:
        """State frames per second of board time since its start; nan before there were two."""
        if self._board_time is None or self._board_time == self._first_time:
            return float("nan")
        return (self._frames - 1) * SECOND / (self._board_time - self._first_time)

    def raw_edges(self, now: int, frame: frames.CaptureFrame) -> list[RawEdge]:
        """Edges of a capture frame that arrived at `now`. Needs state frames, for the clock."""
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

    def measured_at(self, now: int, frame: frames.RangeFrame) -> int:
        """Host time of the measurement in a frame that arrived at `now`."""
        wire_time = WIRE_BYTES[type(frame)] * BITS_PER_BYTE * SECOND // self.baud
        return now - wire_time - frame.age * frames.RANGE_AGE_NANOSECONDS

    def _unwrap_time(self, now: int, low: int) -> int:
        """Board time (ns) from its low 16 bits: the one nearest to the clock's estimate."""
        if self._board_time is None:
            return low * TICK
        expected = self.clock.to_board(now)
        turns = round((expected - low * TICK) / (WRAP * TICK))
        return (low + turns * WRAP) * TICK

    def _host_time(self, now: int, board_time: int, elapsed: int) -> int:
        """Host time of a frame, `elapsed` (ns of board time) after the last one, until `now`.

        The clock's line falls when a frame arrives with less delay than all before it. Times then
        advance at half the rate of the board's until they are on the line, and never go back. In a
        burst, frames that lower the line have arrived at the same `now`: each then advances by a
        part of what is left.
        """
        time, last = min(self.clock.to_host(board_time), now), self._frame_time
        if elapsed <= 0 or last >= now:
            return time
        return max(time, last + min(elapsed // 2, (now - last) // BURST_PART))

    def _count_lost(self, sequence: int) -> None:
        if self._sequence is not None:
            self.lost += (sequence - self._sequence - 1) % STATE_NUMBERS
        self._sequence = sequence

    def _measure_latency(self, now: int, board_time: int, frame: State) -> None:
        """Measure the latency with the first frame that shows a command of ours.

        Another host may have sent a command with the same number before: a command in force since
        before we wrote that number is not ours.
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

    def _unwrap_count(self, side: int, raw: int, elapsed: int) -> int:
        """The count of a wheel from its low 16 bits, `elapsed` (ns) after the last frame.

        It is the one nearest to where the wheel is at its last speed: an encoder with 80,000 counts
        a second goes through half of the 16 bits within a gap of 0.4 s.
        """
        expected = round(self._rates[side] * min(elapsed, DRIVEN_ON_MAX)) if elapsed > 0 else 0
        step = (raw - self._raw_counts[side] - expected + WRAP // 2) % WRAP - WRAP // 2 + expected
        if elapsed > 0:
            self._rates[side] = step / elapsed
        self._raw_counts[side] = raw
        self._counts[side] += step
        return self._counts[side]

    def _unwrap_turn(self, raw: int) -> float:
        """The turn in rad; beyond half a range, 320 deg, between two frames it is unknown."""
        self._turn += (raw - self._raw_turn + WRAP // 2) % WRAP - WRAP // 2
        self._raw_turn = raw
        return self._turn * TURN

    def _edge_time(self, side: int, board_time: int, age: int) -> int | None:
        """Host time of a wheel's last edge, computed from the first frame that shows it."""
        edge = self._edges[side]
        if age != frames.AGE_NONE:
            time = board_time - age * TICK
            if edge is None or abs(time - edge.board) > EDGE_TIME_TOLERANCE:
                edge = self._edges[side] = _Edge(time, self.clock.to_host(time))
        return edge.host if edge else None

    def _command_in_force(self, board_time: int, frame: State) -> tuple[SentCommand, int]:
        """Command that drives the motors, and the host time since which its values are in force."""
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

    def _skipped_command(self, frame: State, sent: SentCommand, since: int) -> SentCommand | None:
        """The command between those of the last frame and of this one, with the time at which it
        took effect: as much earlier as it was written earlier."""
        number = (frame.command - 1) % COMMAND_NUMBERS
        shown_number = self._shown_command
        before = self._sent.get(number)
        shown = None if shown_number is None else self._sent.get(shown_number)
        if before is None or shown is None or shown_number in (number, frame.command):
            return None
        time = since - (sent.time - before.time)
        is_between = shown.time < before.time < sent.time and self._frame_time < since
        if not is_between or before.kind != sent.kind or before[1:] in (shown[1:], sent[1:]):
            return None
        return before._replace(time=max(time, self._frame_time))

    def _command_start(self, board_time: int, frame: State) -> int:
        return self.clock.to_host(board_time - frame.command_age * COMMAND_AGE)


def volts_of(reading: int) -> float:
    """Voltage at an analog pin; nan where the board has no such sensor."""
    if reading == frames.ANALOG_NONE:
        return float("nan")
    return reading * REFERENCE_V / frames.ANALOG_ONE


class BoardClock:
    """Maps board time to host time, both in ns, from the stamps and arrivals of frames.

    A frame can be late but never early, so the true offset is below every measured one. The map is
    a line below all measurements: the edge of their lower convex hull that spans the middle of the
    window. It is the line with the smallest sum of distances (Moon, Skelly and Towsley,
    "Estimation and removal of clock skew from network delay measurements", INFOCOM 1999).
    """

    def __init__(self) -> None:
        self._hull: deque[tuple[int, int]] = deque()
        self._origin = 0
        self._offset = 0
        self._drift = 0.0

    def forget(self) -> None:
        """Discard all measurements, as after a restart of the board."""
        self._hull.clear()

    def observe(self, board: int, arrival: int) -> None:
        """Add a frame: stamp `board` (must increase), earliest possible host time `arrival`."""
        point = (board, arrival - board)
        hull = self._hull
        while len(hull) >= 2 and not _below(hull[-2], hull[-1], point):
            hull.pop()
        hull.append(point)
        while board - hull[0][0] > CLOCK_WINDOW and len(hull) > 2:
            hull.popleft()
        self._fit_line()

    def to_host(self, board: int) -> int:
        """Host time at board time `board`."""
        return board + self._offset + round(self._drift * (board - self._origin))

    def to_board(self, host: int) -> int:
        """Board time at host time `host`; the error is of second order in the drift."""
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
        if self._drift != drift:  # no clock: the lowest point that a line with this slope meets
            start, low = min(hull, key=lambda point: point[1] - self._drift * point[0])
        self._origin, self._offset = start, low


def _below(a: tuple[int, int], b: tuple[int, int], c: tuple[int, int]) -> bool:
    """True when `b` is below the line from `a` to `c`, that is, on the lower hull."""
    return (b[1] - a[1]) * (c[0] - a[0]) < (c[1] - a[1]) * (b[0] - a[0])
