"""Topic numbers of a rosserial board, collected from its answers.

The board acknowledges nothing and its answers may be lost or damaged, so the table is completed
over several requests.
"""

from __future__ import annotations

import struct
from collections.abc import Iterable
from typing import NamedTuple

from diffbotctl.links.rosserial_frames import PAYLOAD_BYTES_MAX
from diffbotctl.links.rosserial_scalars import CODECS, RosType
from diffbotctl.messages import Bool, Empty, Float32, Int32

REQUEST = 0  # to the board: send your topics
PUBLISHER, SUBSCRIBER = 0, 1  # from the board: one TopicInfo
SERVICES = (2, 3, 4, 5)
PARAMETER, LOG, TIME = 6, 7, 10
FIRST_TOPIC = 100  # numbers of a board's topics start here, its subscribers first
INFO_BYTES_MIN = 2 + 3 * 4 + 4  # bytes of a TopicInfo whose three texts are empty

EMPTY_PARAMETER = struct.pack("<III", 0, 0, 0)  # no integers, no floats, no texts
LOG_LEVELS = 5  # debug, information, warning, error, fatal

INT32, FLOAT32, BOOL, EMPTY = (CODECS[kind].ros_type for kind in (Int32, Float32, Bool, Empty))
SIZES = {codec.ros_type: codec.size for codec in CODECS.values()}  # bytes; None: they differ


class TopicNames(NamedTuple):
    """Names of the sketch's topics. An empty name means that the sketch has no such topic."""

    left_ticks: str = "left_ticks"
    right_ticks: str = "right_ticks"
    distance: str = "obstacle_distance"
    left_speed: str = "set_left_speed"
    right_speed: str = "set_right_speed"
    reset: str = "reset"


NO_NAMES = TopicNames("", "", "", "", "", "")


class RosserialTopicInfo(NamedTuple):
    """Description of one topic by the board. `kind` is the message type and its MD5."""

    number: int
    name: str
    kind: RosType
    buffer: int


def read_topic_info(payload: bytes) -> RosserialTopicInfo | None:
    """TopicInfo of a payload, None when its length is wrong. Leading slashes are dropped."""
    texts: list[str] = []
    at = 2
    for _ in range(3):
        if at + 4 > len(payload):
            return None
        (length,) = struct.unpack_from("<I", payload, at)
        texts.append(payload[at + 4 : at + 4 + length].decode("ascii", "replace"))
        at += 4 + length
    if at + 4 != len(payload):
        return None
    (number,) = struct.unpack_from("<H", payload)
    (buffer,) = struct.unpack_from("<i", payload, at)
    return RosserialTopicInfo(number, texts[0].lstrip("/"), (texts[1], texts[2]), buffer)


class Topics:
    """Numbers known so far. `problems`: what is wrong with the sketch's declarations."""

    def __init__(self, names: TopicNames = NO_NAMES) -> None:
        self.publishers = {name.lstrip("/") for name in names[:3]} - {""}
        self.subscribers = {name.lstrip("/") for name in names[3:]} - {""}
        self.kinds: dict[str, tuple[RosType, ...]] = {
            name.lstrip("/"): (INT32,) for name in names if name
        } | {
            names.distance.lstrip("/"): (FLOAT32,),
            names.reset.lstrip("/"): (BOOL, EMPTY),
        }
        self.numbers: dict[str, int] = {}
        self.sizes: dict[int, int] = {}  # bytes of payload of each known publisher
        self.problems: dict[str, str] = {}
        self._named_subscribers: dict[int, str] = {}  # by number, needed or not

    def clear(self) -> None:
        for table in (self.numbers, self.sizes, self.problems, self._named_subscribers):
            table.clear()

    def read(self, payload: bytes) -> RosserialTopicInfo | None:
        """The TopicInfo of a payload; None when it is damaged."""
        return read_topic_info(payload)

    def learn(self, role: int, payload: bytes) -> bool:
        """Take a TopicInfo; False when it is damaged or contradicts an earlier one.

        `role` is PUBLISHER or SUBSCRIBER. Two topics never share a number: of two contradicting
        answers both are dropped, since either may be the damaged one.
        """
        info = self.read(payload)
        if info is None or info.number < FIRST_TOPIC or info.buffer <= 0:
            return False
        needed = self.publishers if role == PUBLISHER else self.subscribers
        if not self._number_is_free(info):
            return False
        if role == SUBSCRIBER:
            self._named_subscribers = {
                n: name for n, name in self._named_subscribers.items() if name != info.name
            }
            self._named_subscribers[info.number] = info.name
        if info.name in needed and self._kind_fits(info):
            self.sizes.pop(self.numbers.get(info.name, -1), None)
            self.numbers[info.name] = info.number
            size = SIZES[info.kind]
            if role == PUBLISHER and size is not None:
                self.sizes[info.number] = size
        return True

    def plausible(self, topic: int, length: int) -> bool:
        """Whether the board can send `length` bytes on `topic`, as far as is known."""
        if topic in (PUBLISHER, SUBSCRIBER, *SERVICES):
            return INFO_BYTES_MIN <= length <= PAYLOAD_BYTES_MAX
        if topic == TIME:
            return length in (0, 8)
        if topic in (PARAMETER, LOG):
            return length <= PAYLOAD_BYTES_MAX
        if topic < FIRST_TOPIC:
            return False
        return length == self.sizes.get(topic, length)

    @property
    def missing(self) -> list[str]:
        """Names without a number, in alphabetical order."""
        return sorted((self.publishers | self.subscribers) - self.numbers.keys())

    @property
    def complete(self) -> bool:
        """True when all numbers are known and those of the subscribers are confirmed."""
        return not self.missing and self.are_confirmed(self.subscribers)

    def are_confirmed(self, names: Iterable[str]) -> bool:
        """True when the numbers of these subscribers are known and cannot come from a bit error.

        A board numbers its subscribers from 100 without a gap, and a damaged number leaves a gap.
        A command to a number that the board did not assign makes it jump outside its table.
        """
        numbers = [self.numbers.get(name) for name in names]
        if None in numbers:
            return False
        last = max((number for number in numbers if number is not None), default=0)
        return all(number in self._named_subscribers for number in range(FIRST_TOPIC, last + 1))

    def _number_is_free(self, info: RosserialTopicInfo) -> bool:
        """True when no other name has this number; drops other names that have it."""
        free = self._named_subscribers.get(info.number, info.name) == info.name
        for name in [n for n, number in self.numbers.items() if number == info.number]:
            if name != info.name:
                self.sizes.pop(self.numbers.pop(name), None)
                free = False
        if not free:
            self._named_subscribers.pop(info.number, None)
        return free

    def _kind_fits(self, info: RosserialTopicInfo) -> bool:
        kinds = self.kinds[info.name]
        if info.kind in kinds:
            self.problems.pop(info.name, None)
            return True
        text = f"the sketch declares {info.name} as {printable_text(info.kind[0])}, "
        if info.kind[0] in [kind[0] for kind in kinds]:
            text += f"of another definition (MD5 {printable_text(info.kind[1])[:32]})"
        else:
            text += f"this driver expects {' or '.join(kind[0] for kind in kinds)}"
        self.problems[info.name] = text
        return False


def printable_text(text: str) -> str:
    """`text` with a question mark for each character that cannot be shown."""
    return "".join(c if c.isprintable() else "?" for c in text)


def read_log(payload: bytes) -> tuple[int, str] | None:
    """Level, 0 to 4, and text of a log message; None when it is damaged."""
    if len(payload) < 5 or payload[0] >= LOG_LEVELS:
        return None
    text = payload[5:].decode("utf-8", "replace")
    return payload[0], "".join(c if c.isprintable() else " " for c in text).strip()
