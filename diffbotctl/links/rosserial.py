"""The host's half of rosserial, for boards that still run the book's firmware."""

from __future__ import annotations

import struct
from collections import deque
from math import isfinite, nan, pi
from typing import NamedTuple

from diffbotctl.links.rosserial_frames import Decoder, Frame, encode
from diffbotctl.links.ticks import Ticks
from diffbotctl.messages import Duty, Encoders, Link, Message, Text, Volts, Wheels

SECOND = 1_000_000_000
NEVER = 1 << 62
PUBLISHER, SUBSCRIBER, PARAMETER, LOG, TIME = 0, 1, 6, 7, 10  # topic ids of the protocol itself
ASK_AGAIN = 800_000_000  # ns; an answer takes 0.55 s, and a tenth of the questions is lost
REPEAT = 50_000_000  # ns between two pairs: the firmware loses a quarter of single commands
SILENT = SECOND  # ns without ticks after which the board is asked for its topics again
COMMAND_DELAY = 100_000_000  # ns from a pair on the wire to the motors, measured
STILL = 300_000_000  # ns without a new tick after which a stop counts as confirmed
TOGETHER = 45_000_000  # ns within which both wheels' ticks belong to one loop of the firmware
MARGIN = 1.5  # times the rated speed: a lightly loaded motor turns faster than rated
FULL = 255  # PWM of full duty
BITS = 10  # bits a byte on the wire
LEVELS = ("debug", "info", "warning", "error", "fatal")
INT32, FLOAT32 = "da5909fbe378aeaf85e547e830cc1bb7", "73fcbf46b49191e672908e50842a83d4"


class Topics(NamedTuple):
    """Names of the firmware's topics, and its formula: centimetres = range_constant / volts."""

    left_ticks: str = "left_ticks"
    right_ticks: str = "right_ticks"
    distance: str = "obstacle_distance"
    left_speed: str = "set_left_speed"
    right_speed: str = "set_right_speed"
    range_constant: float = 13.0


class RosserialHost:
    """A link protocol (see `LinkProtocol`) that asks, listens, and repeats what it commands.

    `rated` is the wheels' speed at full duty (rad/s), `slots` the counts a turn; `sensor` is the
    output port for the volts of the distance sensor. All times are logical nanoseconds.
    """

    def __init__(
        self, baud: int, rated: float, slots: int, sensor: str, topics: Topics | None = None
    ) -> None:
        self.names = topics or Topics()
        self.baud, self.sensor = baud, sensor
        self.fastest = MARGIN * rated * slots / (2 * pi)
        self.decoder = Decoder()
        self.ticks = Ticks(self.fastest)
        self.received = self.restarts = 0
        self.state = "opening"
        self.wanted = (0, 0)
        self.stopping = False
        self.moved_at = self.heard_at = self.busy_until = 0
        self.opened(0)

    def opened(self, now: int) -> None:
        """The port is open: forget the peer, ask for its topics."""
        damaged = self.decoder.damaged
        self.decoder = Decoder()
        self.decoder.damaged = damaged
        self.ids: dict[str, int] = {}
        self.replies: deque[bytes] = deque(maxlen=4)
        self.parts: dict[str, tuple[int, int]] = {}
        self.sent: deque[tuple[int, float, float]] = deque([(-NEVER, 0.0, 0.0)])
        self.ask_at = self.tell_at = now
        self.pair_at = now
        self.heard_at = now
        self.state = "negotiating"
        self.told = ""

    def closed(self, now: int, cause: str) -> list[tuple[str, Message]]:
        """The port is gone."""
        self.state = self.told = "lost"
        self.wanted = (0, 0)
        return [("link", self._link(now, cause))]

    def receive(self, now: int, data: bytes) -> list[tuple[str, Message]]:
        """Take bytes; return what they say."""
        heard: list[tuple[str, Message]] = []
        for frame in self.decoder.feed(data):
            heard += self._hear(now, frame)
        return heard

    def command(self, now: int, wanted: Wheels | Duty) -> None:
        """Take a new duty; the old one, if it still waits, is gone. Raises TypeError for Wheels."""
        if isinstance(wanted, Wheels):
            raise TypeError("a board with the book's firmware takes duty, not wheel speeds")
        pair = (_pwm(wanted.left), _pwm(wanted.right))
        if pair != self.wanted:
            self.pair_at = now
        if pair != (0, 0):
            self.stopping = False
        self.wanted = pair

    def stop(self, now: int) -> None:
        """Command zero, again and again."""
        self.wanted, self.stopping = (0, 0), True
        self.replies.clear()
        self.pair_at = self.moved_at = now

    @property
    def stopped(self) -> bool:
        """True when the ticks have stood still for a while since the stop."""
        return self.stopping and self._is_up() and self.heard_at - self.moved_at >= STILL

    def due(self) -> int:
        """When there is something to send, the wire being free; or to tell of the link."""
        wanted = self.ask_at
        if self.replies:
            wanted = self.busy_until
        elif self._is_known():
            wanted = min(wanted, self.pair_at)
        return min(max(wanted, self.busy_until), max(self.tell_at, self.busy_until))

    def send(self, now: int) -> bytes:
        """The next bytes: an answer, a question, or a pair of commands. Never half a pair."""
        data = b""
        if now < self.busy_until:
            return data
        if self._is_known() and self.pair_at <= now:
            data = self.farewell() if self.wanted == (0, 0) else self._pair(*self.wanted)
            self.pair_at = now + REPEAT
            self._note_sent(now)
        elif self.replies:
            data = self.replies.popleft()
        elif self.ask_at <= now:
            data = encode(PUBLISHER, b"")
            self.ask_at = now + ASK_AGAIN
        self.busy_until = now + len(data) * BITS * SECOND // self.baud
        return data

    def farewell(self) -> bytes:
        """The bytes that stop this board; empty before its topics are known."""
        return self._pair(0, 0) if self._is_known() else b""

    def timed(self, now: int) -> list[tuple[str, Message]]:
        """Notice silence; tell of the link each second and whenever its state changes."""
        if self.state == "up" and now - self.heard_at > SILENT:
            self.state = "stale"
            self.ids.clear()
            self.ask_at = now
        elif self.state != "up" and self._is_up() and now - self.heard_at <= SILENT:
            self.state, self.ask_at = "up", NEVER
        if self.state == self.told and now < self.tell_at:
            return []
        self.told, self.tell_at = self.state, now + SECOND
        return [("link", self._link(now, self._why()))]

    def _hear(self, now: int, frame: Frame) -> list[tuple[str, Message]]:
        self.received += 1
        if frame.topic in (PUBLISHER, SUBSCRIBER):
            self._learn(frame.payload)
        elif frame.topic == TIME:
            seconds, rest = divmod(now, SECOND)
            self.replies.append(encode(TIME, struct.pack("<II", seconds, rest)))
        elif frame.topic == PARAMETER:
            self.replies.append(encode(PARAMETER, bytes(12)))  # three empty lists
        elif frame.topic == LOG:
            return [("text", Text(now, _log(frame.payload)))]
        else:
            return self._data(now, frame)
        return []

    def _learn(self, payload: bytes) -> None:
        """Take a TopicInfo: u16 id, then name, type and md5 as counted strings, i32 buffer."""
        try:
            (number,) = struct.unpack_from("<H", payload)
            name, at = _string(payload, 2)
            _, at = _string(payload, at)
            md5, _ = _string(payload, at)
        except (struct.error, UnicodeDecodeError):
            return
        name = name.removeprefix("/")
        wanted = FLOAT32 if name == self.names.distance else INT32
        if name in self._needed() and md5 == wanted:
            self.ids[name] = number
            self.decoder.lengths[number] = 4

    def _data(self, now: int, frame: Frame) -> list[tuple[str, Message]]:
        names, ids = self.names, self.ids
        if len(frame.payload) != 4:
            return []
        if frame.topic == ids.get(names.distance):
            return [(self.sensor, self._volts(now, frame.payload))]
        for side in (names.left_ticks, names.right_ticks):
            if frame.topic == ids.get(side):
                self.parts[side] = (now, struct.unpack("<i", frame.payload)[0])
                return self._pair_up(now)
        if self._is_known():
            self.ask_at = min(self.ask_at, now)  # an id we never heard of: ask what it is
        return []

    def _pair_up(self, now: int) -> list[tuple[str, Message]]:
        left = self.parts.get(self.names.left_ticks)
        right = self.parts.get(self.names.right_ticks)
        if left is None or right is None or abs(left[0] - right[0]) > TOGETHER:
            return []
        self.parts.clear()
        before, boot = self.ticks.counts, self.ticks.boot
        if not self.ticks.accept(now, left[1], right[1]):
            return []
        if self.ticks.boot != boot:
            self.restarts += 1
        if before != self.ticks.counts:
            self.moved_at = now
        self.heard_at = now
        return [("encoders", self._encoders(now))]

    def _encoders(self, now: int) -> Encoders:
        """Counts dated back by the time that two frames take on the wire."""
        time = now - 24 * BITS * SECOND // self.baud
        while len(self.sent) > 1 and self.sent[1][0] <= time:
            self.sent.popleft()
        since, left, right = self.sent[0]
        return Encoders(
            time, *self.ticks.counts, None, None, left, right, "duty",
            since if since > -NEVER else None, self.ticks.boot,
        )  # fmt: skip

    def _volts(self, now: int, payload: bytes) -> Volts:
        (centimetres,) = struct.unpack("<f", payload)
        sound = isfinite(centimetres) and centimetres > 0.0
        return Volts(now, self.names.range_constant / centimetres if sound else nan)

    def _pair(self, left: int, right: int) -> bytes:
        ids, names = self.ids, self.names
        return encode(ids[names.left_speed], struct.pack("<i", left)) + encode(
            ids[names.right_speed], struct.pack("<i", right)
        )

    def _note_sent(self, now: int) -> None:
        left, right = self.wanted[0] / FULL, self.wanted[1] / FULL
        if (left, right) != self.sent[-1][1:]:
            self.sent.append((now + COMMAND_DELAY, left, right))

    def _needed(self) -> tuple[str, ...]:
        names = self.names
        return (
            names.left_ticks, names.right_ticks, names.distance, names.left_speed,
            names.right_speed,
        )  # fmt: skip

    def _is_known(self) -> bool:
        return len(self.ids) == len(self._needed())

    def _is_up(self) -> bool:
        return self._is_known() and self.ticks.raw is not None

    def _why(self) -> str:
        if self.state == "up":
            return ""
        if self.state == "stale":
            return "the board sends no ticks"
        missing = [name for name in self._needed() if name not in self.ids]
        if len(missing) == len(self._needed()):
            return "the board does not answer"
        return f"the board has not told of {', '.join(missing)}" if missing else "no ticks yet"

    def _link(self, now: int, cause: str) -> Link:
        return Link(
            now, self.state, received=self.received, damaged=self.decoder.damaged,
            lost=self.ticks.rejected, restarts=self.restarts, cause=cause,
        )  # fmt: skip


def _pwm(duty: float) -> int:
    """PWM for a duty of -1 to 1. Raises ValueError for anything else, nan included."""
    if not -1.0 <= duty <= 1.0:
        raise ValueError(f"a duty of {duty} is not within -1 to 1")
    return round(duty * FULL)


def _string(payload: bytes, at: int) -> tuple[str, int]:
    """A counted string at `at`, and where it ends. Raises struct.error when it is cut."""
    (length,) = struct.unpack_from("<I", payload, at)
    end = at + 4 + length
    if end > len(payload):
        raise struct.error("the string is longer than its message")
    return payload[at + 4 : end].decode("ascii"), end


def _log(payload: bytes) -> str:
    """Level and words of a log message."""
    level = LEVELS[payload[0]] if payload and payload[0] < len(LEVELS) else "log"
    words = payload[5:].decode("utf-8", "replace")
    return f"{level}: {words}"
