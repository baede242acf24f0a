"""Running a recording again: the drivers' messages come from it, the blocks make the rest anew."""

from __future__ import annotations

import json
from collections import Counter
from collections.abc import Collection, Iterable, Iterator
from itertools import groupby
from typing import Any, NamedTuple

from diffbotctl.engine.driver import Delivery
from diffbotctl.messages import GoalState, LogLine, Message, Stop
from diffbotctl.recording.json_codec import message_encoder
from diffbotctl.time import NEVER


class Recorded(NamedTuple):
    """One recorded message: when, on which wire, from a driver or a block, and its exact text."""

    time: int
    wire: str
    from_driver: bool
    message: Message
    data: bytes
    instant: int


class Replay:
    """A driver that delivers what the drivers of a recorded run delivered, when they did."""

    def __init__(self, recorded: Iterable[Recorded]) -> None:
        self.instants = _deliveries(recorded)
        self.next = next(self.instants, None)

    def due(self) -> int:
        """When the next recorded delivery came."""
        return NEVER if self.next is None else self.next[0]

    def files(self) -> list[int]:
        """None."""
        return []

    def deliver(self, now: int) -> list[Delivery]:
        """What came at that time."""
        deliveries: list[Delivery] = []
        while self.next is not None and self.next[0] <= now:
            deliveries += self.next[1]
            self.next = next(self.instants, None)
        return deliveries

    def close(self) -> None:
        """Nothing is held open."""


def _deliveries(recorded: Iterable[Recorded]) -> Iterator[tuple[int, list[Delivery]]]:
    for _, group in groupby(recorded, key=lambda item: item.instant):
        items = [item for item in group if item.from_driver]
        if items:
            yield items[0].time, [Delivery(item.wire, item.message) for item in items]


class Difference(NamedTuple):
    """The first place where a replay left its recording."""

    time: int
    wire: str
    recorded: str
    replayed: str


TEXT_FIELDS: dict[type, str] = {LogLine: "text", Stop: "cause", GoalState: "cause"}


class Checker:
    """Compares each instant of a replay with the recorded one, bit for bit.

    `held` are the wires that the recording has, whether or not they carried a message. Messages on
    any other wire, one of a later version, cannot be compared; `left_out` counts them.
    `texts_may_differ`: messages that differ only in a field of TEXT_FIELDS are counted in
    `text_differences` and are no difference. Another version may word them differently.
    """

    def __init__(
        self,
        wires: dict[str, type],
        held: Collection[str],
        recorded: Iterable[Recorded],
        texts_may_differ: bool,
    ) -> None:
        self.texts_may_differ = texts_may_differ
        self.text_differences = 0
        self.kinds = wires
        self.encoders = [(wire, message_encoder(kind)) for wire, kind in wires.items()]
        self.held = held
        self.left_out: Counter[str] = Counter()
        self.instants = groupby(recorded, key=lambda item: item.instant)
        self.difference: Difference | None = None
        self.compared = 0

    def record(self, instant: tuple[Any, ...]) -> None:
        """Take one replayed instant: (time, message or None for each wire)."""
        if self.difference is not None:
            return
        now = {
            wire: encode(message)
            for (wire, encode), message in zip(self.encoders, instant[1:], strict=True)
            if message is not None
        }
        for wire in [wire for wire in now if wire not in self.held]:
            self.left_out[wire] += 1
            del now[wire]
        if not now:
            return  # an instant without messages leaves no trace in a recording
        time, then = self._next()
        if time != instant[0]:
            self._differ(min(time, instant[0]), "(time)", f"{time} ns", f"{instant[0]} ns")
            return
        for wire in sorted(set(then) | set(now)):
            recorded, replayed = then.get(wire, b"nothing"), now.get(wire, b"nothing")
            if recorded == replayed:
                continue
            if self._differs_in_text(wire, recorded, replayed):
                self.text_differences += 1
            else:
                self._differ(time, wire, recorded.decode(), replayed.decode())
                return
        self.compared += len(now)

    def finish(self) -> None:
        """Note a recording that goes on where the replay has ended."""
        time, then = self._next()
        if then and self.difference is None:
            wire, data = next(iter(then.items()))
            self._differ(time, wire, data.decode(), "nothing: the replay has ended")

    def _differs_in_text(self, wire: str, recorded: bytes, replayed: bytes) -> bool:
        """Whether the two differ only in a text that another version may word differently."""
        field = TEXT_FIELDS.get(self.kinds[wire]) if wire in self.kinds else None
        if field is None or not self.texts_may_differ or b"nothing" in (recorded, replayed):
            return False
        return bool({**json.loads(recorded), field: ""} == {**json.loads(replayed), field: ""})

    def _next(self) -> tuple[int, dict[str, bytes]]:
        for _, group in self.instants:
            items = list(group)
            return items[0].time, {item.wire: item.data for item in items}
        return NEVER, {}

    def _differ(self, time: int, wire: str, recorded: str, replayed: str) -> None:
        self.difference = Difference(time, wire, recorded, replayed)
