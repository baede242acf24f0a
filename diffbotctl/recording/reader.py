"""Reading recordings: MCAP files with one JSON channel a wire, also files that were cut."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import IO, Any, NamedTuple

from diffbotctl.config.yaml_reader import open_regular
from diffbotctl.errors import Problem, RunError
from diffbotctl.message_types import type_name
from diffbotctl.messages import BUILT_IN, Message
from diffbotctl.printable import shortened
from diffbotctl.recording.json_codec import message_decoder
from diffbotctl.recording.message_schema import message_class
from diffbotctl.recording.run_metadata import check_end, check_run
from diffbotctl.recording.writer import LAYOUT, STATE, URDF, VIEWER
from diffbotctl.time import SECOND

TIME_MAX = 10 * 365 * 86_400 * SECOND  # ns; a run is shorter
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
    recovery; `wires` maps a wire to (message class name, origin), `kinds` to the message class;
    `cut` is why reading ended early; `state` is the state, as (time in ns, bytes), from which a
    replay begins; `attachments` are the files for viewers, by name.

    A message of another package is of the class in `known` for its wire, if that has the recorded
    name; otherwise of a class made from the schema in the recording.
    """

    def __init__(self, path: Path, known: Mapping[str, type] | None = None) -> None:
        self.path = path
        self.known = known or {}
        self.kinds: dict[str, type] = {}
        self.about: dict[str, str] = {}
        self.end: dict[str, str] | None = None
        self.recovered: dict[str, str] | None = None
        self.wires: dict[str, tuple[str, str]] = {}
        self.cut: str | None = None
        self.state: tuple[int, bytes] | None = None
        self.attachments: dict[str, bytes] = {}
        self._place = 0  # first byte of the record that is being read
        self._channels: dict[int, Any] = {}
        self._schemas: dict[int, bytes] = {}
        self._recorded_classes: dict[tuple[str, bytes], type] = {}

    def messages(self) -> Iterator[RecordedMessage]:
        """All messages of the run in the order of writing, without those for viewers.

        Raises RunError when the file cannot be read, is not a recording or is malformed.
        """
        decoders: dict[int, Any] = {}
        for channel, record in self.records():
            origin = channel.metadata.get("from")
            if origin not in ("driver", "block"):
                continue
            if channel.id not in decoders:
                decoders[channel.id] = message_decoder(self.kinds[channel.topic])
            try:
                message = decoders[channel.id](record.data)
            except (ValueError, RecursionError) as error:
                cause = f"a message of {shortened(channel.topic)} cannot be read: {error}"
                raise self._malformed(self._place, cause) from error
            yield RecordedMessage(
                self.time(record),
                channel.topic,
                origin == "driver",
                message,
                record.data,
                record.sequence,
            )

    def records(self) -> Iterator[tuple[Any, Any]]:
        """Each message's MCAP channel and record, not decoded. Raises RunError as `messages`."""
        # Heavy: a command that reads no recording does without.
        from diffbotctl.recording import mcap_records

        self._channels, self._schemas = {}, {}
        with open_recording(self.path) as file:
            try:
                for whole in mcap_records.file_records(file):
                    self._place = whole.place
                    for record in mcap_records.records_in(whole):
                        if hasattr(record, "sequence"):  # a message
                            self._require_metadata()
                            if record.channel_id not in self._channels:
                                cause = f"a message has the unknown channel {record.channel_id}"
                                raise self._malformed(whole.place, cause)
                            yield self._channels[record.channel_id], record
                        else:
                            self._add(record)
            except mcap_records.CutError as error:
                self.cut = str(error)
            except mcap_records.MalformedError as error:
                if not self.about and not error.place:
                    self._require_metadata()
                raise self._malformed(error.place, str(error)) from error
        self._require_metadata()

    def _add(self, record: Any) -> None:
        """Take metadata, an attachment or a channel."""
        match type(record).__name__:
            case "Metadata":
                self._read_metadata(record.name, dict(record.metadata))
            case "Attachment" if record.name == STATE:
                self._require_metadata()
                self.state = (self.time(record), record.data)
            case "Attachment" if record.name in (URDF, LAYOUT):
                self.attachments[record.name] = record.data
            case "Schema":
                self._schemas.setdefault(record.id, record.data)
            case "Channel" if record.id not in self._channels:
                self._channels[record.id] = record
                origin, name = record.metadata.get("from"), record.metadata.get("kind", "")
                if origin in ("driver", "block"):
                    kind = self._message_class(record, name)
                    if self.wires.setdefault(record.topic, (name, origin)) != (name, origin):
                        cause = f"{shortened(record.topic)} has messages of two classes or origins"
                        raise self._malformed(self._place, cause)
                    self.kinds.setdefault(record.topic, kind)

    def _message_class(self, channel: Any, name: str) -> type:
        """The class called `name` of the messages in a channel. Raises RunError."""
        if name in BUILT_IN:
            return BUILT_IN[name]
        known = self.known.get(channel.topic)
        if known is not None and type_name(known) == name:
            return known
        schema = self._schemas.get(channel.schema_id, b"")
        try:
            if (name, schema) not in self._recorded_classes:
                self._recorded_classes[name, schema] = message_class(name, schema)
        except ValueError as error:
            topic = shortened(channel.topic)
            cause = f"{topic} has messages of an unknown class '{name[:40]}': {error}"
            raise self._malformed(self._place, cause) from error
        return self._recorded_classes[name, schema]

    def _read_metadata(self, name: str, values: dict[str, str]) -> None:
        try:
            match name:
                case "run":
                    check_run(values)
                    self.about = values
                case "end":
                    check_end(values)
                    self.end = values
                case "recovered":
                    self.recovered = values
        except ValueError as error:
            raise self._malformed(self._place, f"metadata '{name}': {error}") from error

    def time(self, record: Any) -> int:
        """Logical time (ns) of a record. Raises RunError beyond what any run lasts."""
        time: int = record.log_time - int(self.about["epoch"])
        if abs(time) > TIME_MAX:
            raise self._malformed(self._place, "a time is years away from the start of the run")
        return time

    def _malformed(self, place: int, cause: str) -> RunError:
        fix = "`diffbotctl bag recover` keeps what can be read"
        return RunError(Problem("E-RECORDING", f"{self.path}, byte {place}", cause, fix))

    def _require_metadata(self) -> None:
        if not self.about:
            cause = "this is not a recording of diffbotctl"
            fix = "make one: diffbotctl run goal --record FILE"
            raise RunError(Problem("E-RECORDING", str(self.path), cause, fix))


def open_recording(path: Path) -> IO[bytes]:
    """Open the file `path`. Raises RunError when that fails, or it is a device or a pipe."""
    try:
        return open_regular(path)
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
    attachments: tuple[str, ...] = ()

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
        time = reader.time(record)
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
        tuple(sorted(topics, key=lambda topic: (_origin_rank(topic.origin), topic.name))),
        reader.cut,
        tuple(reader.attachments),
    )


def read_attachment(path: Path, name: str) -> bytes:
    """The file `name` that is attached to the recording at `path`. Raises RunError."""
    reader = RecordingReader(path)
    for _ in reader.records():
        pass
    if name not in reader.attachments:
        known = ", ".join(reader.attachments) or "no files"
        cause = f"'{name}' is not attached to it; it has {known}"
        raise RunError(Problem("E-RECORDING", str(path), cause))
    return reader.attachments[name]


def _origin_rank(origin: str) -> int:
    return ORIGINS.index(origin) if origin in ORIGINS else len(ORIGINS)


def _topic_info(name: str, kind: str, origin: str, count: int, first: int, last: int) -> TopicInfo:
    rate = (count - 1) * SECOND / (last - first) if last > first else None
    return TopicInfo(name, kind, origin, count, rate, last)
