"""Two recordings side by side: where their topics first differ."""

from __future__ import annotations

from itertools import zip_longest
from pathlib import Path
from typing import NamedTuple

from diffbotctl.recording.info import recorded_messages


class TopicDifference(NamedTuple):
    """One topic of two recordings: how many messages each has, and their first difference.

    `place` counts messages of the topic from 0, None where there is no difference; `one` and
    `other` are (time in ns, text) or None where that recording has no message at that place.
    """

    name: str
    counts: tuple[int, int]
    place: int | None
    one: tuple[int, str] | None
    other: tuple[int, str] | None

    @property
    def time(self) -> int:
        """When they first differ, in ns."""
        return min(said[0] for said in (self.one, self.other) if said is not None)


RecordedMessage = dict[str, list[tuple[int, bytes]]]


def recording_differences(one: Path, other: Path) -> list[TopicDifference]:
    """All topics of both recordings: those that differ first, by the time of the difference.

    Raises RunError for a file that is no recording.
    """
    ours, theirs = _said(one), _said(other)
    topics = [_topic(name, ours, theirs) for name in sorted(set(ours) | set(theirs))]
    return sorted(topics, key=lambda topic: (topic.place is None, _when(topic), topic.name))


def _when(topic: TopicDifference) -> int:
    return 0 if topic.place is None else topic.time


def _topic(name: str, ours: RecordedMessage, theirs: RecordedMessage) -> TopicDifference:
    one, other = ours.get(name, []), theirs.get(name, [])
    counts = (len(one), len(other))
    for place, (left, right) in enumerate(zip_longest(one, other)):
        if left != right:
            return TopicDifference(name, counts, place, _words(left), _words(right))
    return TopicDifference(name, counts, None, None, None)


def _words(said: tuple[int, bytes] | None) -> tuple[int, str] | None:
    return None if said is None else (said[0], said[1].decode())


def _said(path: Path) -> RecordedMessage:
    found: RecordedMessage = {}
    for item in recorded_messages(path):
        found.setdefault(item.wire, []).append((item.time, item.data))
    return found
