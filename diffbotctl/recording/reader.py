"""Reading recordings: MCAP files with one JSON channel a wire, also files that were cut."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import IO, Any, NamedTuple

from diffbotctl.errors import Problem, RunError
from diffbotctl.messages import BUILT_IN, Message
from diffbotctl.recording.json_codec import message_decoder
from diffbotctl.recording.writer import STATE, VIEWER
from diffbotctl.time import SECOND

ORIGINS = ("driver", "block", VIEWER)  # in the order in which topics are listed


class RecordedMessage(NamedTuple):
    """One recorded message. `time` is in ns, `data` its exact text, `instant` counts instants."""

    time: int
    wire: str
    from_driver: bool
    message: Message
    data: bytes
    instant: int


class RecordingReader:
    """Reads a recording, also one that was cut: up to its last flush.

    The attributes are filled while `messages` or `records` runs, and are complete at its end:
    `about`, `end` and `recovered` are metadata of the run, of its end (None when cut) and of the
    recovery; `wires` maps a wire to (message class name, origin); `cut` is why reading ended early;
    `state` is the state, as (time in ns, bytes), from which a replay begins.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        self.about: dict[str, str] = {}
        self.end: dict[str, str] | None = None
        self.recovered: dict[str, str] | None = None
        self.wires: dict[str, tuple[str, str]] = {}
        self.cut: str | None = None
        self.state: tuple[int, bytes] | None = None

    def messages(self) -> Iterator[RecordedMessage]:
        """All messages of the run in the order of writing, without those for viewers.

        Raises RunError when the file cannot be read or is not a recording.
        """
        decoders: dict[int, Any] = {}
        for channel, record in self.records():
            if channel.metadata.get("from") == VIEWER:
                continue
            if channel.id not in decoders:
                decoders[channel.id] = message_decoder(BUILT_IN[channel.metadata["kind"]])
            yield RecordedMessage(
                record.log_time - int(self.about["epoch"]),
                channel.topic,
                channel.metadata["from"] == "driver",
                decoders[channel.id](record.data),
                record.data,
                record.sequence,
            )

    def records(self) -> Iterator[tuple[Any, Any]]:
        """Each message's MCAP channel and record, not decoded. Raises RunError as `messages`."""
        from mcap.records import Attachment, Channel, Message, Metadata  # heavy
        from mcap.stream_reader import StreamReader

        channels: dict[int, Any] = {}
        with open_recording(self.path) as file:
            for record in self._until_cut(StreamReader(file, validate_crcs=True).records):
                if isinstance(record, Metadata):
                    self._read_metadata(record.name, dict(record.metadata))
                elif isinstance(record, Attachment) and record.name == STATE:
                    self.state = (record.log_time - int(self.about["epoch"]), record.data)
                elif isinstance(record, Channel) and record.id not in channels:
                    channels[record.id] = record
                    origin = record.metadata.get("from", "")
                    if origin in ("driver", "block"):
                        self.wires[record.topic] = (record.metadata["kind"], origin)
                elif isinstance(record, Message):
                    self._require_metadata()
                    yield channels[record.channel_id], record
        self._require_metadata()

    def _read_metadata(self, name: str, values: dict[str, str]) -> None:
        match name:
            case "run":
                self.about = values
            case "end":
                self.end = values
            case "recovered":
                self.recovered = values

    def _require_metadata(self) -> None:
        if not self.about:
            cause = "this is not a recording of diffbotctl"
            fix = "make one: diffbotctl run goal --record FILE"
            raise RunError(Problem("E-RECORDING", str(self.path), cause, fix))

    def _until_cut(self, records: Any) -> Iterator[Any]:
        iterator = iter(records)
        while True:
            try:
                yield next(iterator)
            except StopIteration:
                return
            except Exception as error:  # the reader raises whatever its decompressor raises
                self.cut = f"{type(error).__name__}: {error}"
                return


def open_recording(path: Path) -> IO[bytes]:
    """Open the file `path`. Raises RunError when that fails."""
    try:
        return path.open("rb")
    except OSError as error:
        cause = f"cannot read it: {error.strerror}"
        raise RunError(Problem("E-RECORDING", str(path), cause)) from error


class TopicInfo(NamedTuple):
    """One topic of a recording. `rate` is in Hz, None below two messages; `last` in ns."""

    name: str
    kind: str
    origin: str
    messages: int
    rate: float | None
    last: int


class RecordingInfo(NamedTuple):
    """Summary of a recording.

    `about` is the metadata of the run, `end` that of its end, None when it is missing. `begins` and
    `ends` are logical times in ns. `cut` is why reading ended early.
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
        """Whether the recording was completed and read to its end."""
        return self.end is not None and self.cut is None


def recording_info(path: Path) -> RecordingInfo:
    """The summary of the recording at `path`. Raises RunError for a file that is none."""
    reader = RecordingReader(path)
    spans: dict[str, tuple[int, int, int]] = {}  # count, first and last time by topic
    kinds: dict[str, tuple[str, str]] = {}
    for channel, record in reader.records():
        time = record.log_time - int(reader.about["epoch"])
        count, first, _ = spans.get(channel.topic, (0, time, time))
        spans[channel.topic] = (count + 1, first, time)
        kinds[channel.topic] = (channel.metadata.get("kind", ""), channel.metadata.get("from", ""))
    kinds.update(reader.wires)
    topics = [_topic_info(topic, *kinds[topic], *spans.get(topic, (0, 0, 0))) for topic in kinds]
    return RecordingInfo(
        path,
        path.stat().st_size,
        reader.about,
        reader.end,
        reader.recovered,
        min((first for _, first, _ in spans.values()), default=0),
        max((last for _, _, last in spans.values()), default=0),
        tuple(sorted(topics, key=lambda topic: (ORIGINS.index(topic.origin), topic.name))),
        reader.cut,
    )


def _topic_info(name: str, kind: str, origin: str, count: int, first: int, last: int) -> TopicInfo:
    rate = (count - 1) * SECOND / (last - first) if last > first else None
    return TopicInfo(name, kind, origin, count, rate, last)
