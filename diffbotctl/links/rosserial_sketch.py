"""Host side of rosserial for sketches with topics of their own.

The board is asked for its topics until it has named all that the pipeline declares, with their
types. It acknowledges nothing, so what differs is only certain after some answers. A message for
the board is sent at once or replaced by a newer one; none is kept for a board that was lost, so
that no old command reaches an actuator after a reconnect.
"""

from __future__ import annotations

import re
import struct
from collections import deque
from collections.abc import Mapping
from typing import Any, NamedTuple

from diffbotctl.links.link_protocol import BITS_PER_BYTE
from diffbotctl.links.rosserial_frames import RosserialDecoder, RosserialFrame, encode
from diffbotctl.links.rosserial_scalars import CODECS
from diffbotctl.links.rosserial_topics import (
    EMPTY_PARAMETER,
    FIRST_TOPIC,
    LOG,
    PARAMETER,
    PUBLISHER,
    REQUEST,
    SUBSCRIBER,
    TIME,
    RosserialTopicInfo,
    Topics,
    printable_text,
    read_log,
    read_topic_info,
)
from diffbotctl.messages import LogLevel
from diffbotctl.time import MILLISECOND, SECOND

ASK_PERIOD = 600 * MILLISECOND
ANSWER_MAX = 10 * SECOND  # an Arduino starts in 2 s; without any frame by then it has no rosserial
SETTLED_TIME = 1500 * MILLISECOND  # without a new topic; then those that are missing are not there
QUESTIONS_MIN = 3  # before a difference counts: one answer may be damaged
SILENCE_ASK = 4 * SECOND  # the board asks for the time every 2.5 s
SILENCE_MAX = 9 * SECOND
AHEAD = 20 * MILLISECOND  # of bytes that may wait in the port; more would delay the newest command
LEVELS: tuple[LogLevel, ...] = ("debug", "info", "warning", "error", "error")


class SketchFailure(NamedTuple):
    """Why the board cannot be used; `is_final` if that stays so until a person changes it."""

    cause: str
    fix: str
    is_final: bool


def port_name(topic: str) -> str:
    """The name of a topic as a pipeline writes it: `front_led` for `/front/led` or `frontLed`."""
    words = re.sub(r"(?<=[a-z0-9])(?=[A-Z])|[^A-Za-z0-9]+", "_", topic)
    return words.strip("_").lower()


class SketchTopics(Topics):
    """Topics of the pipeline, by their names there; `named` has all that the board named."""

    def __init__(self, publishers: Mapping[str, type], subscribers: Mapping[str, type]) -> None:
        super().__init__()
        self.publishers, self.subscribers = set(publishers), set(subscribers)
        kinds = {**publishers, **subscribers}
        self.kinds = {name: (CODECS[kind].ros_type,) for name, kind in kinds.items()}
        self.named: dict[tuple[int, str], RosserialTopicInfo] = {}

    def clear(self) -> None:
        super().clear()
        self.named.clear()

    def read(self, payload: bytes) -> RosserialTopicInfo | None:
        """As Topics.read, with the name that the pipeline has for the topic."""
        info = read_topic_info(payload)
        return None if info is None else info._replace(name=port_name(info.name))

    def learn(self, role: int, payload: bytes) -> bool:
        is_learnt = super().learn(role, payload)
        info = self.read(payload)
        if is_learnt and info is not None:
            self.named[role, info.name] = info
        return is_learnt

    def differences(self) -> list[str]:
        """What the board names otherwise than the pipeline, or not at all."""
        texts = list(self.problems.values())
        for role, names, does in (
            (PUBLISHER, self.publishers, "publishes"),
            (SUBSCRIBER, self.subscribers, "subscribes to"),
        ):
            there = [
                f"{info.name} ({printable_text(info.kind[0])})"
                for (named_role, _), info in self.named.items()
                if named_role == role
            ]
            texts += [
                f"{name} is missing: the sketch {does} {', '.join(there) or 'nothing'}"
                for name in sorted(names & set(self.missing))
                if name not in self.problems
            ]
        return texts


class SketchBoard:
    """Host side of the link to one board. All times are in ns.

    `publishers`: message classes of the topics that the sketch publishes, by name; `subscribers` of
    those that it subscribes to. `log` collects what the board has logged.
    """

    def __init__(
        self, publishers: Mapping[str, type], subscribers: Mapping[str, type], baud: int
    ) -> None:
        self.publishers, self.subscribers = publishers, subscribers
        self.topics = SketchTopics(publishers, subscribers)
        self.decoder = RosserialDecoder(self.topics.plausible)
        self.byte_time = BITS_PER_BYTE * SECOND // baud
        self.baud = baud
        self.log: list[tuple[LogLevel, str]] = []
        self.opened(0)

    def opened(self, now: int) -> None:
        """The port has been opened: forget the board, and what waited for it; ask it."""
        self.topics.clear()
        self.decoder.clear()
        self._replies: deque[bytes] = deque()
        self._waiting: dict[str, bytes] = {}  # the newest payload of each subscriber
        self._opened_at = self._ask_at = self._line_free_at = now
        self._frame_at = self._named_at = now
        self._questions = 0
        self._has_answered = False

    @property
    def is_ready(self) -> bool:
        """True when all topics are known, and of the types that the pipeline declares."""
        return self.topics.complete

    def receive(self, now: int, data: bytes, wall_time: int) -> list[tuple[str, Any]]:
        """Take bytes; the messages that they complete, with the names of their topics.

        `wall_time`: ns since 1970, which the board gets when it asks for the time.
        """
        messages: list[tuple[str, Any]] = []
        for frame in self.decoder.feed(data):
            self._frame_at = now
            if frame.topic >= FIRST_TOPIC:
                messages += self._message(now, frame)
            else:
                self._take(now, frame, wall_time)
        return messages

    def publish(self, name: str, message: Any) -> None:
        """Send a message to a subscriber soon, unless a newer one replaces it.

        Dropped while the board is not ready. Raises ValueError if it does not fit.
        """
        if not self.is_ready:
            return
        payload = CODECS[self.subscribers[name]].encode(message)
        space = self.topics.named[SUBSCRIBER, name].buffer
        if len(payload) > space:  # the client library would write outside of its buffer
            raise ValueError(f"{len(payload)} bytes are too many: the board takes {space}")
        self._waiting[name] = payload

    def send(self, now: int) -> bytes:
        """The next frame to write; nothing while the line is busy, or nothing waits."""
        if self._line_free_at > now + AHEAD:
            return b""
        if self._replies:
            data = self._replies.popleft()
        elif now >= self._next_question():
            self._questions += 1
            self._ask_at = now + ASK_PERIOD
            data = encode(REQUEST)
        elif self._waiting and self.is_ready:
            name = next(iter(self._waiting))
            data = encode(self.topics.numbers[name], self._waiting.pop(name))
        else:
            return b""
        self._line_free_at = max(self._line_free_at, now) + len(data) * self.byte_time
        return data

    def failure(self, now: int) -> SketchFailure | None:
        """Why the board cannot be used; None while it can, or may still answer."""
        if self.is_ready:
            if now - self._frame_at <= SILENCE_MAX:
                return None
            return SketchFailure("nothing comes from it", "check its plug, cable and power", False)
        if not self._has_answered:
            if now - self._opened_at <= ANSWER_MAX:
                return None
            return SketchFailure(
                f"no answer of rosserial comes at {self.baud} baud",
                "flash a sketch that uses ros_lib, and give its baud rate (57600 unless it sets "
                "another one)",
                False,
            )
        if self._questions < QUESTIONS_MIN or now - self._named_at <= SETTLED_TIME:
            return None
        cause = "; ".join(self.topics.differences())
        return SketchFailure(cause, "change `out` or `in` of the source, or the sketch", True)

    def _next_question(self) -> int:
        if not self.is_ready:
            return self._ask_at
        return max(self._frame_at + SILENCE_ASK, self._ask_at)

    def _message(self, now: int, frame: RosserialFrame) -> list[tuple[str, Any]]:
        for name in self.publishers:
            if self.topics.numbers.get(name) == frame.topic and self.is_ready:
                message = CODECS[self.publishers[name]].decode(now, frame.payload)
                return [] if message is None else [(name, message)]
        return []

    def _take(self, now: int, frame: RosserialFrame, wall_time: int) -> None:
        if frame.topic in (PUBLISHER, SUBSCRIBER):
            before = len(self.topics.named)
            if self.topics.learn(frame.topic, frame.payload):
                self._has_answered = True
            if len(self.topics.named) > before:
                self._named_at = now
        elif frame.topic == TIME:
            seconds, nanoseconds = divmod(wall_time, SECOND)
            self._replies.append(encode(TIME, struct.pack("<II", seconds % (1 << 32), nanoseconds)))
        elif frame.topic == PARAMETER:
            self._replies.append(encode(PARAMETER, EMPTY_PARAMETER))
        elif frame.topic == LOG:
            level_and_text = read_log(frame.payload)
            if level_and_text is not None:
                self.log.append((LEVELS[level_and_text[0]], level_and_text[1]))
