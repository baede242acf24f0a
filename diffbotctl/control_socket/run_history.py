"""The past of a run for screens that are attached late: trail, and numbers of its topics."""

from __future__ import annotations

import struct
from collections import deque
from itertools import islice
from math import ceil, isfinite, nan
from typing import Any

from diffbotctl.geometry.trail import Trail
from diffbotctl.message_types import parts
from diffbotctl.messages import Message, Odometry, fields
from diffbotctl.time import MILLISECOND, SECOND

HISTORY_PERIOD = 200 * MILLISECOND  # of logical time, between two samples
HISTORY_SAMPLES = 600  # of each topic: two minutes
TRAIL_SPACING_M, TRAIL_MAX_POINTS = 0.02, 1000
REPLY_MAX_VALUES = 20_000  # of a reply; a type with more than 30 fields is sent with gaps
VALUE_DIGITS = 6  # more than a screen has rows
NUMBER_TYPES = (int, float, bool)


class TopicHistory:
    """The last numbers of one topic, as bytes: a tenth of the memory of the messages."""

    def __init__(self, kind: type) -> None:
        self.names = [
            name
            for name, (hint, _) in fields(kind).items()
            if name != "time" and any(part in NUMBER_TYPES for part in parts(hint))
        ]
        self.format = struct.Struct(f"{1 + len(self.names)}d")  # with the time
        self.samples: deque[bytes] = deque(maxlen=HISTORY_SAMPLES)
        self.trail = Trail(TRAIL_SPACING_M, TRAIL_MAX_POINTS) if kind is Odometry else None
        self.time = -1

    def add(self, message: Message) -> None:
        """Add a sample, unless this message is one already."""
        if message.time == self.time:
            return
        self.time = message.time
        numbers = (_number(getattr(message, name)) for name in self.names)
        self.samples.append(self.format.pack(float(message.time), *numbers))
        if self.trail is not None and isinstance(message, Odometry):
            self.trail.add((message.x, message.y))

    def reply(self) -> dict[str, Any]:
        """The samples as JSON values; null where there is no finite number."""
        step = ceil(len(self.samples) * len(self.names) / REPLY_MAX_VALUES) or 1
        rows = [self.format.unpack(sample) for sample in islice(self.samples, 0, None, step)]
        times, *columns = zip(*rows, strict=True) if rows else ((), *[() for _ in self.names])
        return {
            "times": [round(time / SECOND, 3) for time in times],
            "fields": {
                name: [_rounded(value) for value in column]
                for name, column in zip(self.names, columns, strict=True)
            },
            "trail": []
            if self.trail is None
            else [[round(x, 3), round(y, 3)] for x, y in self.trail.points],
        }


class RunHistory:
    """The histories of all topics, sampled every HISTORY_PERIOD."""

    def __init__(self, kinds: dict[str, type]) -> None:
        self.topics = {wire: TopicHistory(kind) for wire, kind in kinds.items()}
        self.due = 0

    def sample(self, now: int, newest: dict[str, Message]) -> None:
        """Add the newest message of each topic, when a sample is due."""
        if now < self.due:
            return
        self.due = now + HISTORY_PERIOD
        for wire, message in newest.items():
            self.topics[wire].add(message)


def _number(value: Any) -> float:
    try:
        return float(value)
    except (OverflowError, TypeError, ValueError):  # too great, or none
        return nan


def _rounded(value: float) -> float | None:
    return float(f"{value:.{VALUE_DIGITS}g}") if isfinite(value) else None
