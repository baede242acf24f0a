"""The host's half of rosserial, protocol version 2, for boards that run the book's firmware.

Such a board acknowledges nothing, loses a quarter of the commands by itself, and has no dead-man's
stop. So everything said to it is repeated: the question for its topics until all needed ones are
known, the speeds 20 times a second, a stop until the ticks cease to change.
"""

from __future__ import annotations

import struct
from collections import deque
from math import isfinite, nan

from diffbotctl.links.link_protocol import Refusal
from diffbotctl.links.rosserial_commands import SpeedSender, pair
from diffbotctl.links.rosserial_frames import RosserialDecoder, RosserialFrame, encode
from diffbotctl.links.rosserial_ticks import TickUnwrapper
from diffbotctl.links.rosserial_topics import (
    FIRST_TOPIC,
    LOG,
    PARAMETER,
    PUBLISHER,
    REQUEST,
    SUBSCRIBER,
    TIME,
    TopicNames,
    Topics,
)
from diffbotctl.messages import Duty, Encoders, Link, LinkState, Message, Text, Volts, Wheels
from diffbotctl.time import NEVER, SECOND

ASK_AGAIN = 570_000_000  # ns; a full answer takes 0.55 s at 9600 baud
NO_ANSWER = 300_000_000  # ns; by then a third of an answer has come, and damage spares some of it
FLUSH_AFTER = 3  # questions without an answer
FLUSH = bytes(128)  # the longest false frame, 512 bytes, is over after four of them
TIME_AFTER = 3 * SECOND  # the board asks for the time every 2.5 s, and falls silent after 11 s
TIME_AGAIN = SECOND
SILENCE = SECOND  # without ticks for so long the board is asked again
BURST = 40_000_000  # ns within which both ticks of one pass arrive: 12.5 ms apart at 9600 baud
STANDSTILL = 300_000_000  # ns without a new count
REPORT = SECOND  # between two Link messages
BITS = 10  # on the wire a byte
MOST_VOLTS = 5.5  # V; a 5 V board's input at the upper end of its supply's tolerance
LEVELS = ("debug", "information", "warning", "error", "fatal")
NOTHING = struct.pack("<III", 0, 0, 0)  # a parameter's value: no integers, no floats, no texts

RosserialOutput = list[tuple[str, Message]]


class RosserialHost:
    """Speaks to one board; a `LinkProtocol`.

    `rate`: counts/s of a wheel at rated speed. `sensor`: output port for the distance's `Volts`.
    `range_constant`: the sketch's centimetres are this over the volts. `command_delay`: ns from
    sending a speed to the motor. `wire_time`: ns from counting to the pair's arrival here.
    """

    def __init__(
        self,
        rate: float,
        *,
        baud: int = 9600,
        sensor: str = "front",
        names: TopicNames | None = None,
        range_constant: float = 13.0,
        command_delay: int = 100_000_000,
        wire_time: int = 17_000_000,
    ) -> None:
        wanted = names or TopicNames()
        self.names = TopicNames(*(name.lstrip("/") for name in wanted))
        self.topics = Topics(self.names)
        self.decoder = RosserialDecoder(self.topics.plausible)
        self.baud = baud
        self.refusal: Refusal | None = None  # it goes on asking: such a board may miss any question
        self.byte_time = BITS * SECOND // baud
        self.speeds = SpeedSender(command_delay, self.byte_time)
        self.counts = {
            self.names.left_ticks: TickUnwrapper(rate),
            self.names.right_ticks: TickUnwrapper(rate),
        }
        self.sensor, self.range_constant, self.wire_time = sensor, range_constant, wire_time
        self.state: LinkState = "opening"
        self.cause, self.boot = "", 0
        self._replies: deque[bytes] = deque()
        self._fresh: dict[str, int] = {}  # arrival of ticks that wait for the other wheel's
        self._last: tuple[int, int] | None = None  # counts of the last Encoders
        self._heard_at = self._changed_at = 0
        self._silent = True  # nothing but answers has come since the port was opened or went stale
        self._asked_first = False
        self._stopping, self._stopped = False, False
        self._zeroed_at: int | None = None  # when the first pair of the stop under way was sent
        self._wire_free = 0
        self._ask_at = self._report_at = self._time_at = NEVER
        self._asked = self._asked_at = 0  # questions since the last answer; end of the last one
        self._reported = ("", "")

    # What the driver asks for

    def opened(self, now: int) -> None:
        """Forget the board's topics and ask for them. What was counted stays comparable."""
        self.topics.clear()
        self.decoder.clear()
        self._replies.clear()
        self.state, self._wire_free = "negotiating", now
        self._ask_at = self._report_at = now
        self._time_at, self._asked = NEVER, 0
        self.speeds.hurry(now)
        self._fall_silent()

    def closed(self, now: int, cause: str) -> RosserialOutput:
        """The port is gone."""
        self.state, self.cause = "lost", cause
        self.topics.clear()
        self._replies.clear()
        self._ask_at = self._report_at = self._time_at = NEVER
        self._stopped = False
        self.speeds.want(now, 0.0, 0.0)
        return [self._report(now)]

    def receive(self, now: int, data: bytes) -> RosserialOutput:
        """Take bytes of the board."""
        heard: RosserialOutput = []
        for frame in self.decoder.feed(data):
            heard += self._take(now, frame)
        return heard + self._news(now)

    def command(self, now: int, wanted: Wheels | Duty) -> None:
        """Take a new duty. Raises TypeError for Wheels, which this board cannot regulate."""
        if not isinstance(wanted, Duty):
            raise TypeError("a board with rosserial firmware takes Duty, not Wheels")
        self._stopping = self._stopped = False
        self.speeds.want(now, wanted.left, wanted.right)

    def stop(self, now: int) -> None:
        """Stop, and repeat it. The driver has thrown away what was not yet on the wire."""
        if not self._stopping:
            self._stopped, self._zeroed_at = False, None
        self._stopping = True
        self.speeds.want(now, 0.0, 0.0)
        self.speeds.hurry(now)
        self._wire_free = now

    @property
    def stopped(self) -> bool:
        """True when no tick has come for 0.3 s since the stop, though ticks messages did."""
        return self._stopped

    def due(self) -> int:
        """When there is something to send or to say."""
        if self.state in ("opening", "lost"):
            return NEVER
        return min(max(self._wire_free, self._send_due()), self._speak_due())

    def send(self, now: int) -> bytes:
        """One frame, or one pair of speeds; nothing while the wire is still busy."""
        if now < self._wire_free or now < self._send_due():
            return b""
        if self._replies:
            data = self._replies.popleft()
        elif self._ask_at <= now:
            data = self._ask(now)
        elif self._time_at <= now:
            self._time_at = now + TIME_AGAIN
            data = _time(now)
        else:
            data = self._speeds(now)
        self._wire_free = now + len(data) * self.byte_time
        return data

    def on_time(self, now: int) -> RosserialOutput:
        """Silence, and the report of each second."""
        if self.state == "up" and now >= self._heard_at + SILENCE:
            self.state = "stale"
            self._ask_at = now
            self.speeds.want(now, 0.0, 0.0)
            self._fall_silent()
        return self._news(now)

    def stop_frame(self) -> bytes:
        """The bytes that stop this board, or none while its topics are not known."""
        numbers = self._numbers()
        return pair(numbers, 0, 0) if numbers else b""

    # What is to be sent

    def _numbers(self) -> tuple[int, int] | None:
        names = (self.names.left_speed, self.names.right_speed)
        if not self.topics.sure(names):
            return None
        return self.topics.numbers[names[0]], self.topics.numbers[names[1]]

    def _send_due(self) -> int:
        if self._replies:
            return 0
        speeds = self.speeds.due if self._numbers() else NEVER
        return min(self._ask_at, self._time_at, speeds)

    def _ask(self, now: int) -> bytes:
        """The question for the topics. A board that does not answer may be reading a frame whose
        damaged length swallows the questions: it gets its fill of zeros, which start no frame."""
        flush = FLUSH if self._asked >= FLUSH_AFTER else b""
        question = flush + encode(REQUEST)
        self._asked += 1
        self._asked_at = now + len(question) * self.byte_time
        self._ask_at = self._asked_at + NO_ANSWER
        return question

    def _speak_due(self) -> int:
        silence = self._heard_at + SILENCE if self.state == "up" else NEVER
        return min(self._report_at, silence)

    def _speeds(self, now: int) -> bytes:
        numbers = self._numbers()
        if numbers is None:
            return b""
        if self._stopping and self._zeroed_at is None:
            self._zeroed_at = now
        hurried = self._stopping and not self._stopped
        moving = self.state == "up" and not self._stopping
        return self.speeds.take(now, numbers, moving, hurried)

    # What the board says

    def _take(self, now: int, frame: RosserialFrame) -> RosserialOutput:
        topic, payload = frame
        if topic in (PUBLISHER, SUBSCRIBER, TIME) and self._ask_at != NEVER:
            self._ask_at = max(self._ask_at, self._asked_at + ASK_AGAIN)  # it is answering
        if topic in (PUBLISHER, SUBSCRIBER):
            self._learn(now, topic, payload)
        elif topic == TIME:
            self._replies.extend((_time(now), _time(now)))  # twice, since single ones get lost
            self._time_at = now + TIME_AFTER
        elif topic == PARAMETER:
            self._replies.append(encode(PARAMETER, NOTHING))
        elif topic == LOG:
            return _log(now, payload)
        elif topic >= FIRST_TOPIC:
            return self._take_data(now, topic, payload)
        return []

    def _learn(self, now: int, role: int, payload: bytes) -> None:
        before = self.topics.complete
        if not self.topics.learn(role, payload):
            return
        self._asked = 0
        if self._silent:
            self._asked_first = True
        if self.topics.complete and not before:
            self._ask_at = now + SILENCE  # ticks must follow, else something is still wrong

    def _take_data(self, now: int, topic: int, payload: bytes) -> RosserialOutput:
        name = next((n for n, number in self.topics.numbers.items() if number == topic), None)
        if name in self.counts and len(payload) == 4:
            return self._take_ticks(now, name, struct.unpack("<i", payload)[0])
        if name and name == self.names.distance and len(payload) == 4:
            self._silent = False
            return [(self.sensor, self._volts(now, struct.unpack("<f", payload)[0]))]
        if name is None and not self._asked_first:
            self._silent = False  # it was publishing before it was asked: it has not restarted
        return []

    def _take_ticks(self, now: int, name: str, raw: int) -> RosserialOutput:
        count = self.counts[name]
        if self._asked_first and abs(raw) <= count.reach(now - self._heard_at):
            self._restarted()
            for each in self.counts.values():
                each.forget()
        self._silent = self._asked_first = False
        verdict = count.take(now, raw)
        if verdict == "suspect":
            return []
        if verdict == "anew":
            self._restarted()
            for other in self.counts:
                if other != name:
                    self.counts[other].rebase()
        self._fresh[name] = now
        if len(self._fresh) < 2 or now - min(self._fresh.values()) > BURST:
            return []
        self._fresh.clear()
        return self._encoders(now)

    def _encoders(self, now: int) -> RosserialOutput:
        if not self.topics.complete:
            return []
        left, right = (count.value for count in self.counts.values())
        self._heard_at = now
        if self.state != "up":
            self.state, self._ask_at = "up", NEVER
        if (left, right) != self._last:
            self._last, self._changed_at = (left, right), now
        if self._stopping and self._zeroed_at is not None:
            self._stopped = now - max(self._zeroed_at, self._changed_at) >= STANDSTILL
        time = now - self.wire_time
        force = self.speeds.in_force(time)
        message = Encoders(
            time, left, right, None, None, force.left, force.right, "duty", force.since, self.boot
        )
        return [*self._news(now), ("encoders", message)]

    def _volts(self, now: int, centimetres: float) -> Volts:
        volts = nan
        if isfinite(centimetres) and centimetres > 0.0:
            volts = self.range_constant / centimetres
        return Volts(now - self.wire_time, volts if volts <= MOST_VOLTS else nan)

    def _fall_silent(self) -> None:
        self._silent, self._asked_first = True, False
        self._stopped = False
        self._fresh.clear()

    def _restarted(self) -> None:
        """The board counts anew, so that no difference may be taken across this moment."""
        self._fresh.clear()
        if self._last is not None:
            self.boot += 1
            self._last = None

    # What the graph hears of the link

    def _news(self, now: int) -> RosserialOutput:
        """A Link where something has changed, or a second has passed."""
        if self.state in ("opening", "lost"):
            return []
        self.cause = self._why()
        if (self.state, self.cause) == self._reported and now < self._report_at:
            return []
        return [self._report(now)]

    def _report(self, now: int) -> tuple[str, Message]:
        self._reported = (self.state, self.cause)
        if self._report_at != NEVER:
            self._report_at = now + REPORT
        message = Link(
            now,
            self.state,
            received=self.decoder.frames,
            damaged=self.decoder.damaged,
            restarts=self.boot,
            cause=self.cause,
        )
        return ("link", message)

    def _why(self) -> str:
        if self.state == "up":
            return ""
        if self.topics.wrong:
            return "; ".join(self.topics.wrong.values()) + ": change the sketch"
        if self.state == "stale":
            return "no ticks from the board for 1 s; asking it again for its topics"
        if self.topics.missing:
            return (
                f"the board has not named {', '.join(self.topics.missing)} yet; "
                "if this lasts, compare these names with the sketch's"
            )
        return "the board has named its topics, but sends no ticks yet"


def _time(now: int) -> bytes:
    """The answer to a time request: seconds and nanoseconds, 32 bits each."""
    seconds, rest = divmod(now, SECOND)
    return encode(TIME, struct.pack("<II", seconds % (1 << 32), rest))


def _log(now: int, payload: bytes) -> RosserialOutput:
    """A log message: its level, and a text behind a length of 32 bits."""
    if len(payload) < 5 or payload[0] >= len(LEVELS):
        return []
    text = payload[5:].decode("utf-8", "replace")
    shown = "".join(c if c.isprintable() else " " for c in text).strip()
    return [("text", Text(now, f"board, {LEVELS[payload[0]]}: {shown}"))]
