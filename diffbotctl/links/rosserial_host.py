"""Host side of rosserial, protocol version 2, for boards that run the book's firmware.

Such a board acknowledges nothing, loses a quarter of the commands, and has no dead-man stop. So the
host repeats everything: the request for the topics until all needed ones are known, the duties 20
times a second, a stop until the counts no longer change.
"""

from __future__ import annotations

import struct
from collections import deque
from math import isfinite, nan

from diffbotctl.links import diffbot_codec, diffbot_frames
from diffbotctl.links.link_protocol import BITS_PER_BYTE, LinkOutput, Refusal
from diffbotctl.links.rosserial_frames import RosserialDecoder, RosserialFrame, encode
from diffbotctl.links.rosserial_stop import StopOrder
from diffbotctl.links.rosserial_topics import (
    EMPTY_PARAMETER,
    FIRST_TOPIC,
    LOG,
    PARAMETER,
    PUBLISHER,
    REQUEST,
    SUBSCRIBER,
    TIME,
    TopicNames,
    Topics,
    read_log,
)
from diffbotctl.links.rosserial_wheels import SpeedSender, TickUnwrapper, TickVerdict, pair_frames
from diffbotctl.messages import Duty, Encoders, Link, LinkState, Message, Text, Volts, Wheels
from diffbotctl.time import MILLISECOND, NEVER, SECOND

ANSWER_TIMEOUT = 570 * MILLISECOND  # a full answer takes 0.55 s at 9600 baud
# A third of an answer arrives in this time, and part of it undamaged.
FIRST_ANSWER_TIMEOUT = 300 * MILLISECOND
FLUSH_QUESTIONS_MIN = 3  # questions without an answer
FLUSH = bytes(128)  # four of them end the longest false frame, 512 bytes
# What the firmware of diffbotctl answers, and the book's ignores: it starts no frame of rosserial.
OTHER_QUESTION = diffbot_codec.encode(diffbot_frames.AskFrame(diffbot_frames.VERSION))
TIME_TIMEOUT = 3 * SECOND  # the board asks for the time every 2.5 s and stops sending after 11 s
TIME_PERIOD = SECOND
STALE_TIMEOUT = SECOND  # without ticks; the board is asked for its topics again
PAIR_TIMEOUT = 40 * MILLISECOND  # both ticks of one pass arrive 12.5 ms apart at 9600 baud
STANDSTILL_TIME = 300 * MILLISECOND  # without a new count
REPORT_PERIOD = SECOND  # of the Link message
# A board that lost the first stops gets 20 more in this time, and its wheels coast to rest.
MOTION_TIME = 1_500 * MILLISECOND
VOLTAGE_MAX_V = 5.5  # a 5 V board's input at the upper end of its supply's tolerance
RANGE_CONSTANT_V_CM = 13.0  # the sketch's centimetres are this over the volts
LEVELS = ("debug", "information", "warning", "error", "fatal")


class RosserialHost:
    """Host side of the link to one board. Fulfils LinkProtocol.

    `rate`: counts/s of a wheel at rated speed. `sensor`: output port for the distance's `Volts`.
    `command_delay`: ns from sending a speed to the motor. `wire_time`: ns from counting to the
    pair's arrival here.
    """

    def __init__(
        self,
        rate: float,
        *,
        baud: int = 9600,
        sensor: str = "front",
        names: TopicNames | None = None,
        command_delay: int = 100_000_000,
        wire_time: int = 17_000_000,
    ) -> None:
        self.names = TopicNames(*(name.lstrip("/") for name in names or TopicNames()))
        self.topics = Topics(self.names)
        self.decoder = RosserialDecoder(self.topics.plausible)
        self.baud = baud
        # Set only by an answer of another firmware: this one may miss any question.
        self.refusal: Refusal | None = None
        self.other_decoder = diffbot_codec.FrameDecoder()
        self.byte_time = BITS_PER_BYTE * SECOND // baud
        self.speeds = SpeedSender(command_delay, self.byte_time)
        self.counts = {
            self.names.left_ticks: TickUnwrapper(rate),
            self.names.right_ticks: TickUnwrapper(rate),
        }
        self.sensor, self.wire_time = sensor, wire_time
        self.state: LinkState = "opening"
        self.cause, self.boot = "", 0
        self._replies: deque[bytes] = deque()
        self._tick_arrivals: dict[str, int] = {}  # arrival of ticks that wait for the other wheel's
        self._last_counts: tuple[int, int] | None = None  # counts of the last Encoders
        self._encoders_at = self._moved_at = 0
        self._silent = True  # only answers have arrived since the port was opened or went stale
        self._answered_in_silence = False
        self._stopping, self._stopped = False, False
        self._stop_sent_at: int | None = None  # when the first pair of the present stop was sent
        self._line_free_at = 0
        self._ask_at = self._report_at = self._time_at = NEVER
        self._unanswered = 0  # questions since the last answer
        self._question_end = 0  # when the last question was sent completely
        self._reported = ("", "")

    # --- requests of the driver ---

    def opened(self, now: int) -> None:
        """Forget the board's topics and ask for them. The counts continue."""
        self.topics.clear()
        self.decoder.clear()
        self._replies.clear()
        self.state, self._line_free_at = "negotiating", now
        self._ask_at = self._report_at = now
        self._time_at, self._unanswered = NEVER, 0
        self.speeds.send_at(now)
        self._board_silent()

    def closed(self, now: int, cause: str) -> LinkOutput:
        self.state, self.cause = "lost", cause
        self.topics.clear()
        self._replies.clear()
        self._ask_at = self._report_at = self._time_at = NEVER
        self._stopped = False
        self.speeds.set_target(now, 0.0, 0.0)
        return [self._report(now)]

    def receive(self, now: int, data: bytes) -> LinkOutput:
        """Take bytes; return the messages that they complete."""
        output: LinkOutput = []
        if self._unanswered >= FLUSH_QUESTIONS_MIN and self.other_decoder.feed(data):
            self.refusal = Refusal(
                "E-BOARD-DIFFBOT",
                "the board runs the firmware of diffbotctl, not the book's",
                "name a robot whose link has the protocol diffbot: for the robot of the book, "
                "--robot book_2wd",
            )
        for frame in self.decoder.feed(data):
            output += self._on_frame(now, frame)
        return output + self._link_output(now)

    def command(self, now: int, command: Wheels | Duty) -> None:
        """Take a new duty. Raises TypeError for Wheels: this board has no speed loop."""
        if not isinstance(command, Duty):
            raise TypeError("a board with rosserial firmware takes Duty, not Wheels")
        self._stopping = self._stopped = False
        self.speeds.set_target(now, command.left, command.right)

    def stop(self, now: int) -> None:
        """Send stops until the wheels stand. The driver has discarded unsent bytes."""
        if not self._stopping:
            self._stopped, self._stop_sent_at = False, None
        self._stopping = True
        self.speeds.set_target(now, 0.0, 0.0)
        self.speeds.send_at(now)
        self._line_free_at = now

    @property
    def stopped(self) -> bool:
        """True when the counts have not changed for 0.3 s since the stop, while they arrived."""
        return self._stopped

    def due(self) -> int:
        """Time of the next call of `send` or `on_time`."""
        if self.state in ("opening", "lost"):
            return NEVER
        return min(max(self._line_free_at, self._next_send_at()), self._next_report_at())

    def send(self, now: int) -> bytes:
        """One frame, or one pair of duties; nothing while the line is busy."""
        if now < self._line_free_at or now < self._next_send_at():
            return b""
        if self._replies:
            data = self._replies.popleft()
        elif self._ask_at <= now:
            data = self._question(now)
        elif self._time_at <= now:
            self._time_at = now + TIME_PERIOD
            data = _time_answer(now)
        else:
            data = self._speed_frames(now)
        self._line_free_at = now + len(data) * self.byte_time
        return data

    def on_time(self, now: int) -> LinkOutput:
        """Check for missing ticks; report the link each second."""
        if self.state == "up" and now >= self._encoders_at + STALE_TIMEOUT:
            self.state = "stale"
            self._ask_at = now
            self.speeds.set_target(now, 0.0, 0.0)
            self._board_silent()
        return self._link_output(now)

    def stop_frame(self) -> bytes:
        """Bytes that stop this board; empty while its topics are not known."""
        topics = self._speed_topics()
        return pair_frames(topics, 0, 0) if topics else b""

    def stop_order(self) -> StopOrder | None:
        """How another process stops this board; None while its topics are not known."""
        ticks = [self.topics.numbers.get(name, 0) for name in self.counts]
        frames = self.stop_frame()
        return StopOrder(frames, *ticks) if frames else None

    def may_move(self, now: int) -> bool:
        """True when the wheels turn or will: a duty waits, or was sent in the last MOTION_TIME."""
        return not self._stopped and self.speeds.moves_within(now, MOTION_TIME)

    # --- writing ---

    def _speed_topics(self) -> tuple[int, int] | None:
        names = (self.names.left_speed, self.names.right_speed)
        if not self.topics.are_confirmed(names):
            return None
        return self.topics.numbers[names[0]], self.topics.numbers[names[1]]

    def _next_send_at(self) -> int:
        if self._replies:
            return 0
        speeds = self.speeds.due if self._speed_topics() else NEVER
        return min(self._ask_at, self._time_at, speeds)

    def _question(self, now: int) -> bytes:
        """The request for the topics.

        A board that does not answer may be reading a frame whose damaged length includes the
        questions: zeros, which start no frame, fill it. Or it has the firmware of diffbotctl.
        """
        flush = FLUSH + OTHER_QUESTION if self._unanswered >= FLUSH_QUESTIONS_MIN else b""
        question = flush + encode(REQUEST)
        self._unanswered += 1
        self._question_end = now + len(question) * self.byte_time
        self._ask_at = self._question_end + FIRST_ANSWER_TIMEOUT
        return question

    def _next_report_at(self) -> int:
        silence = self._encoders_at + STALE_TIMEOUT if self.state == "up" else NEVER
        return min(self._report_at, silence)

    def _speed_frames(self, now: int) -> bytes:
        topics = self._speed_topics()
        if topics is None:
            return b""
        if self._stopping and self._stop_sent_at is None:
            self._stop_sent_at = now
        urgent = self._stopping and not self._stopped
        moving = self.state == "up" and not self._stopping
        return self.speeds.next_frames(now, topics, moving, urgent)

    # --- reading ---

    def _on_frame(self, now: int, frame: RosserialFrame) -> LinkOutput:
        topic, payload = frame
        if topic in (PUBLISHER, SUBSCRIBER, TIME) and self._ask_at != NEVER:
            self._ask_at = max(
                self._ask_at, self._question_end + ANSWER_TIMEOUT
            )  # the board is answering
        if topic in (PUBLISHER, SUBSCRIBER):
            self._on_topic(now, topic, payload)
        elif topic == TIME:
            self._replies += [_time_answer(now)] * 2  # twice, since single ones get lost
            self._time_at = now + TIME_TIMEOUT
        elif topic == PARAMETER:
            self._replies.append(encode(PARAMETER, EMPTY_PARAMETER))
        elif topic == LOG:
            return _log_text(now, payload)
        elif topic >= FIRST_TOPIC:
            return self._on_data(now, topic, payload)
        return []

    def _on_topic(self, now: int, role: int, payload: bytes) -> None:
        before = self.topics.complete
        if not self.topics.learn(role, payload):
            return
        self._unanswered = 0
        if self._silent:
            self._answered_in_silence = True
        if self.topics.complete and not before:
            self._ask_at = now + STALE_TIMEOUT  # ask again when no ticks follow

    def _on_data(self, now: int, topic: int, payload: bytes) -> LinkOutput:
        name = next((n for n, number in self.topics.numbers.items() if number == topic), None)
        if name in self.counts and len(payload) == 4:
            return self._on_ticks(now, name, struct.unpack("<i", payload)[0])
        if name and name == self.names.distance and len(payload) == 4:
            self._silent = False
            return [(self.sensor, self._volts(now, struct.unpack("<f", payload)[0]))]
        if name is None and not self._answered_in_silence:
            self._silent = False  # it published before it was asked: no restart
        return []

    def _on_ticks(self, now: int, name: str, raw: int) -> LinkOutput:
        ticks = self.counts[name]
        if self._answered_in_silence and abs(raw) <= ticks.reach(now - self._encoders_at):
            self._board_restarted()
            for side in self.counts.values():
                side.forget()
        self._silent = self._answered_in_silence = False
        verdict = ticks.take(now, raw)
        if verdict is TickVerdict.SUSPECT:
            return []
        if verdict is TickVerdict.ANEW:
            self._board_restarted()
            for other in self.counts:
                if other != name:
                    self.counts[other].rebase()
        self._tick_arrivals[name] = now
        if len(self._tick_arrivals) < 2 or now - min(self._tick_arrivals.values()) > PAIR_TIMEOUT:
            return []
        self._tick_arrivals.clear()
        return self._encoders(now)

    def _encoders(self, now: int) -> LinkOutput:
        if not self.topics.complete:
            return []
        left, right = (count.value for count in self.counts.values())
        self._encoders_at = now
        if self.state != "up":
            self.state, self._ask_at = "up", NEVER
        if (left, right) != self._last_counts:
            self._last_counts, self._moved_at = (left, right), now
        if self._stopping and self._stop_sent_at is not None:
            self._stopped = now - max(self._stop_sent_at, self._moved_at) >= STANDSTILL_TIME
        time = now - self.wire_time
        duty = self.speeds.in_force(time)
        message = Encoders(
            time, left, right, None, None, duty.left, duty.right, "duty", duty.since, self.boot
        )
        return [*self._link_output(now), ("encoders", message)]

    def _volts(self, now: int, centimetres: float) -> Volts:
        volts = nan
        if isfinite(centimetres) and centimetres > 0.0:
            volts = RANGE_CONSTANT_V_CM / centimetres
        return Volts(now - self.wire_time, volts if volts <= VOLTAGE_MAX_V else nan)

    def _board_silent(self) -> None:
        self._silent, self._answered_in_silence = True, False
        self._stopped = False
        self._tick_arrivals.clear()

    def _board_restarted(self) -> None:
        """The board counts from a new base: `boot` marks that differences across it are invalid."""
        self._tick_arrivals.clear()
        if self._last_counts is not None:
            self.boot += 1
            self._last_counts = None

    # --- link messages ---

    def _link_output(self, now: int) -> LinkOutput:
        """A Link message when the state has changed or the report is due."""
        if self.state in ("opening", "lost"):
            return []
        self.cause = self._find_cause()
        if (self.state, self.cause) == self._reported and now < self._report_at:
            return []
        return [self._report(now)]

    def _report(self, now: int) -> tuple[str, Message]:
        self._reported = (self.state, self.cause)
        if self._report_at != NEVER:
            self._report_at = now + REPORT_PERIOD
        frames, damaged = self.decoder.frames, self.decoder.damaged
        link = Link(now, self.state, frames, damaged, restarts=self.boot, cause=self.cause)
        return ("link", link)

    def _find_cause(self) -> str:
        if self.state == "up":
            return ""
        if self.topics.problems:
            return "; ".join(self.topics.problems.values()) + ": change the sketch"
        if self.state == "stale":
            return "no ticks from the board for 1 s; asking it again for its topics"
        if self.topics.missing:
            return (
                f"the board has not named {', '.join(self.topics.missing)} yet; "
                "if this lasts, compare these names with the sketch's"
            )
        return "the board has named its topics, but sends no ticks yet"


def _time_answer(now: int) -> bytes:
    """Reply to a time request: seconds and nanoseconds, 32 bits each."""
    seconds, nanoseconds = divmod(now, SECOND)
    return encode(TIME, struct.pack("<II", seconds % (1 << 32), nanoseconds))


def _log_text(now: int, payload: bytes) -> LinkOutput:
    logged = read_log(payload)
    if logged is None:
        return []
    return [("text", Text(now, f"board, {LEVELS[logged[0]]}: {logged[1]}"))]
