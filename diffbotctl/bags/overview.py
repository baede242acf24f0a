"""What is in a recording, without decoding its messages."""

from __future__ import annotations

from pathlib import Path
from typing import Any, NamedTuple

from diffbotctl.bags.source import readable, whole
from diffbotctl.graph import SECOND
from diffbotctl.hub.recording import RecordingReader


class Topic(NamedTuple):
    """One topic of a recording. `rate` is in Hz, None below two messages; `last` in ns."""

    name: str
    kind: str
    origin: str
    messages: int
    rate: float | None
    last: int


class Overview(NamedTuple):
    """A recording at a glance.

    `about` is what the run said of itself at its start, `end` at its end, or None where the file
    does not say. `begins` and `ends` are logical times in ns. `cut` is why reading ended early.
    """

    path: Path
    size: int
    about: dict[str, str]
    end: dict[str, str] | None
    recovered: dict[str, str] | None
    begins: int
    ends: int
    topics: tuple[Topic, ...]
    cut: str | None

    @property
    def complete(self) -> bool:
        """Whether the recording says of itself that nothing is missing."""
        return self.end is not None and self.cut is None


class _Count:
    """How often a topic spoke, and when first and last."""

    def __init__(self, channel: Any, time: int) -> None:
        self.channel = channel
        self.messages = 0
        self.first = self.last = time

    def topic(self) -> Topic:
        span = self.last - self.first
        rate = (self.messages - 1) * SECOND / span if span > 0 else None
        about = self.channel.metadata
        kind, origin = about.get("kind", ""), about.get("from", "")
        return Topic(self.channel.topic, kind, origin, self.messages, rate, self.last)


def overview(path: Path) -> Overview:
    """Look through the recording at `path`. Raises RunError for a file that is none."""
    reader = RecordingReader(path)
    counts: dict[int, _Count] = {}
    epoch = 0
    with readable(path):
        size = path.stat().st_size
        for channel, record in reader.records():
            epoch = epoch or int(reader.about.get("epoch", 0))
            time = record.log_time - epoch
            count = counts.setdefault(channel.id, _Count(channel, time))
            count.messages += 1
            count.last = time
    whole(reader)
    silent = set(reader.wires) - {count.channel.topic for count in counts.values()}
    topics = [count.topic() for count in counts.values()]
    topics += [Topic(name, *reader.wires[name], 0, None, 0) for name in silent]
    return Overview(
        path,
        size,
        reader.about,
        reader.end,
        reader.recovered,
        min((count.first for count in counts.values()), default=0),
        max((count.last for count in counts.values()), default=0),
        tuple(sorted(topics, key=lambda topic: (ORDER.index(topic.origin), topic.name))),
        reader.cut,
    )


ORDER = ("driver", "block", "viewer")
