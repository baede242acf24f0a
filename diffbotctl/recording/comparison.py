"""Comparing runs: a replay with its recording, and two recordings by topic."""

from __future__ import annotations

import json
from collections import Counter, defaultdict
from collections.abc import Collection, Iterable
from itertools import groupby, zip_longest
from pathlib import Path
from typing import Any, NamedTuple

from diffbotctl.messages import GoalState, LogLine, Stop
from diffbotctl.recording.json_codec import message_encoder
from diffbotctl.recording.reader import RecordedMessage, RecordingReader
from diffbotctl.time import NEVER


class Difference(NamedTuple):
    """The first difference of a replay from its recording. `time` is in ns."""

    time: int
    wire: str
    recorded: str
    replayed: str


TEXT_FIELDS: dict[type, str] = {LogLine: "text", Stop: "cause", GoalState: "cause"}


class ReplayChecker:
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
        recorded: Iterable[RecordedMessage],
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
            return  # an instant without messages is not in a recording
        time, then = self._next()
        if time != instant[0]:
            self._differ(min(time, instant[0]), "(time)", f"{time} ns", f"{instant[0]} ns")
            return
        for wire in sorted(set(then) | set(now)):
            recorded, replayed = then.get(wire, b"nothing"), now.get(wire, b"nothing")
            if recorded == replayed or self._lacks_later_fields(wire, recorded, replayed):
                continue
            if self._differs_in_text(wire, recorded, replayed):
                self.text_differences += 1
            else:
                self._differ(time, wire, recorded.decode(), replayed.decode())
                return
        self.compared += len(now)

    def finish(self) -> None:
        time, then = self._next()
        if then and self.difference is None:
            wire, data = next(iter(then.items()))
            self._differ(time, wire, data.decode(), "nothing: the replay has ended")

    def _lacks_later_fields(self, wire: str, recorded: bytes, replayed: bytes) -> bool:
        """Whether the recorded message only lacks fields that a later version added, and these have
        their defaults in the replayed one."""
        defaults: dict[str, Any] = getattr(self.kinds.get(wire), "_field_defaults", {})
        if not defaults or b"nothing" in (recorded, replayed):
            return False
        later, earlier = json.loads(replayed), json.loads(recorded)
        completed = {name: earlier.get(name, defaults.get(name)) for name in later}
        return earlier.keys() < later.keys() and json.dumps(completed).encode() == replayed

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


class TopicDifference(NamedTuple):
    """One topic of two recordings: how many messages each has, and their first difference.

    `place` counts messages of the topic from 0, None where there is no difference; `one` and
    `other` are (time in ns, text), or None where that recording has no message at that place.
    """

    name: str
    counts: tuple[int, int]
    place: int | None
    one: tuple[int, str] | None
    other: tuple[int, str] | None

    @property
    def time(self) -> int:
        """When they first differ, in ns; 0 where they do not."""
        return min((message[0] for message in (self.one, self.other) if message), default=0)


def recording_differences(one: Path, other: Path) -> list[TopicDifference]:
    """All topics of both recordings: those that differ first, by the time of the difference.

    Raises RunError for a file that is not a recording.
    """
    ours, theirs = _texts_by_topic(one), _texts_by_topic(other)
    topics = [_compare(name, ours[name], theirs[name]) for name in sorted({*ours, *theirs})]
    return sorted(topics, key=lambda topic: (topic.place is None, topic.time, topic.name))


def _compare(
    name: str, one: list[tuple[int, str]], other: list[tuple[int, str]]
) -> TopicDifference:
    counts = (len(one), len(other))
    for place, (ours, theirs) in enumerate(zip_longest(one, other)):
        if ours != theirs:
            return TopicDifference(name, counts, place, ours, theirs)
    return TopicDifference(name, counts, None, None, None)


def _texts_by_topic(path: Path) -> defaultdict[str, list[tuple[int, str]]]:
    texts = defaultdict(list)
    for item in RecordingReader(path).messages():
        texts[item.wire].append((item.time, item.data.decode()))
    return texts
