"""Recordings: MCAP files with one JSON channel a wire, and some for viewers, flushed each second.

A file that was ended properly carries the metadata record `end`; without it the file was cut, and
is readable up to its last flush.
"""

from __future__ import annotations

import json
import os
from collections.abc import Iterator
from pathlib import Path
from typing import IO, Any

from diffbotctl.messages import BUILT_IN
from diffbotctl.recording.foxglove import SensorMount, Viewers, schema
from diffbotctl.recording.json_codec import json_schema, message_decoder, message_encoder
from diffbotctl.recording.replay_driver import Recorded

VIEWER = "viewer"  # origin of messages that were made for viewers: no part of the run
STATE = "state"  # name of the attachment with the state from which a replay begins
CHUNK = 256 << 10  # bytes; an unpaced run fills it in a few ms, a paced one flushes each second


class Recording:
    """Writes instants to an MCAP file. All methods may raise OSError when the disk is full."""

    def __init__(
        self,
        file: IO[bytes],
        wires: dict[str, type],
        sources: int,
        about: dict[str, str],
        mounts: dict[str, SensorMount] | None = None,
    ) -> None:
        from mcap.writer import CompressionType, Writer

        self.file = file
        self.writer: Any = Writer(file, chunk_size=CHUNK, compression=CompressionType.ZSTD)
        self.writer.start(library="diffbotctl")
        self.writer.add_metadata("run", about)
        self.epoch = int(about["epoch"])
        self.instants = 0
        self.channels: list[tuple[int, Any]] = []
        schemas: dict[type, int] = {}
        for place, (wire, kind) in enumerate(wires.items()):
            if kind not in schemas:
                text = json.dumps(json_schema(kind)).encode()
                schemas[kind] = self.writer.register_schema(kind.__name__, "jsonschema", text)
            origin = "driver" if place < sources else "block"
            channel = self.writer.register_channel(
                wire, "json", schemas[kind], {"from": origin, "kind": kind.__name__}
            )
            self.channels.append((channel, message_encoder(kind)))
        self.viewers = Viewers(self.epoch, wires, mounts or {})
        self.views: dict[str, int] = {}
        for topic, name in self.viewers.topics.items():
            view = self.writer.register_schema(f"foxglove.{name}", "jsonschema", schema(name))
            about_view = {"from": VIEWER, "kind": f"foxglove.{name}"}
            self.views[topic] = self.writer.register_channel(topic, "json", view, about_view)
        self.flush()  # killed within the first second, the file still says what it is

    def write(self, instant: tuple[Any, ...]) -> None:
        """Write the messages of one instant: (time, message or None for each wire)."""
        time = self.epoch + instant[0]
        for (channel, encode), message in zip(self.channels, instant[1:], strict=True):
            if message is not None:
                self.writer.add_message(channel, time, encode(message), time, self.instants)
        for topic, data in self.viewers.made(instant):
            self.writer.add_message(self.views[topic], time, data, time, self.instants)
        self.instants += 1

    def attach_state(self, time: int, state: bytes) -> None:
        """Put the blocks' state after the instant `time` (ns) in: a replay begins with it."""
        moment = self.epoch + time
        self.writer.add_attachment(moment, moment, STATE, "application/octet-stream", state)

    def flush(self) -> None:
        """Bring what was written to the disk, as a chunk that a reader can open."""
        self.writer.flush()
        self.file.flush()
        os.fsync(self.file.fileno())

    def finish(self, summary: dict[str, str]) -> None:
        """End the file; without this it counts as cut."""
        self.writer.add_metadata("end", summary)
        self.writer.finish()
        self.file.flush()


class RecordingReader:
    """Reads a recording, also one that was cut: up to its last flush."""

    def __init__(self, path: Path) -> None:
        self.path = path
        self.about: dict[str, str] = {}
        self.end: dict[str, str] | None = None
        self.recovered: dict[str, str] | None = None
        self.wires: dict[str, tuple[str, str]] = {}
        self.cut: str | None = None
        self.state: tuple[int, bytes] | None = None

    def messages(self) -> Iterator[Recorded]:
        """All messages of the run in the order of writing, without those made for viewers.

        Fills `about`, `end`, `wires` and `cut`.
        """
        decoders: dict[int, Any] = {}
        for channel, record in self.records():
            if channel.metadata.get("from") == VIEWER:
                continue
            if channel.id not in decoders:
                decoders[channel.id] = message_decoder(BUILT_IN[channel.metadata["kind"]])
            yield Recorded(
                record.log_time - int(self.about["epoch"]),
                channel.topic,
                channel.metadata["from"] == "driver",
                decoders[channel.id](record.data),
                record.data,
                record.sequence,
            )

    def records(self) -> Iterator[tuple[Any, Any]]:
        """Every message as it stands in the file, with its MCAP channel; nothing is decoded.

        Fills `about`, `end`, `wires`, `state` and `cut`.
        """
        from mcap.records import Attachment, Channel, Message, Metadata
        from mcap.stream_reader import StreamReader

        channels: dict[int, Any] = {}
        with self.path.open("rb") as file:
            for record in self._until_cut(StreamReader(file, validate_crcs=True).records):
                if isinstance(record, Metadata):
                    self._note(record.name, dict(record.metadata))
                elif isinstance(record, Attachment) and record.name == STATE:
                    self.state = (record.log_time - int(self.about["epoch"]), record.data)
                elif isinstance(record, Channel) and record.id not in channels:
                    channels[record.id] = record
                    origin = record.metadata.get("from", "")
                    if origin in ("driver", "block"):
                        self.wires[record.topic] = (record.metadata["kind"], origin)
                elif isinstance(record, Message):
                    yield channels[record.channel_id], record

    def _note(self, name: str, values: dict[str, str]) -> None:
        if name == "run":
            self.about = values
        elif name == "end":
            self.end = values
        elif name == "recovered":
            self.recovered = values

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
