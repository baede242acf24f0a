"""What is in a recording, without decoding its messages.

Opening a recording, with words for a file that is none.
"""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any, NamedTuple

from diffbotctl.errors import Problem, RunError
from diffbotctl.recording.mcap_file import RecordingReader
from diffbotctl.recording.replay_driver import Recorded
from diffbotctl.time import SECOND


class TopicInfo(NamedTuple):
    """One topic of a recording. `rate` is in Hz, None below two messages; `last` in ns."""

    name: str
    kind: str
    origin: str
    messages: int
    rate: float | None
    last: int


class RecordingInfo(NamedTuple):
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
    topics: tuple[TopicInfo, ...]
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

    def topic(self) -> TopicInfo:
        span = self.last - self.first
        rate = (self.messages - 1) * SECOND / span if span > 0 else None
        about = self.channel.metadata
        kind, origin = about.get("kind", ""), about.get("from", "")
        return TopicInfo(self.channel.topic, kind, origin, self.messages, rate, self.last)


def recording_info(path: Path) -> RecordingInfo:
    """Look through the recording at `path`. Raises RunError for a file that is none."""
    reader = RecordingReader(path)
    counts: dict[int, _Count] = {}
    epoch = 0
    with readable_recording(path):
        size = path.stat().st_size
        for channel, record in reader.records():
            epoch = epoch or int(reader.about.get("epoch", 0))
            time = record.log_time - epoch
            count = counts.setdefault(channel.id, _Count(channel, time))
            count.messages += 1
            count.last = time
    require_complete(reader)
    silent = set(reader.wires) - {count.channel.topic for count in counts.values()}
    topics = [count.topic() for count in counts.values()]
    topics += [TopicInfo(name, *reader.wires[name], 0, None, 0) for name in silent]
    return RecordingInfo(
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


def recorded_messages(path: Path) -> Iterator[Recorded]:
    """The messages of the run recorded at `path`. Raises RunError for a file that is none."""
    reader = RecordingReader(path)
    with readable_recording(path):
        yield from reader.messages()
    require_complete(reader)


class readable_recording:  # noqa: N801 - read as a word: `with readable(path):`
    """Turns an OSError on the way into words about the file `path`."""

    def __init__(self, path: Path) -> None:
        self.path = path

    def __enter__(self) -> None:
        """Nothing is opened here."""

    def __exit__(self, kind: object, error: object, trace: object) -> None:
        if isinstance(error, OSError):
            cause = f"cannot read it: {error.strerror}"
            raise RunError(Problem("E-RECORDING", str(self.path), cause)) from error


def require_complete(reader: RecordingReader) -> None:
    """Raise RunError unless what `reader` has read began as a recording does."""
    if not reader.about:
        cause = "this is no recording of diffbotctl"
        fix = "make one: diffbotctl run goal --record FILE"
        raise RunError(Problem("E-RECORDING", str(reader.path), cause, fix))
