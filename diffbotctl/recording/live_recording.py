"""A recording that a client makes of a running engine, from the lines that it subscribes to.

It holds what came while the client was connected, of the topics that it chose. The messages are
written as they came, with the schemas that the engine sends, so that no package has to be installed
for their classes. It begins in an unknown state, so it cannot be replayed.
"""

from __future__ import annotations

import json
import os
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

from mcap.writer import CompressionType, Writer

from diffbotctl.recording.run_metadata import LIVE
from diffbotctl.recording.writer import CHUNK_BYTES


class LiveTopic(NamedTuple):
    """A topic: the name of its message class, and the JSON Schema of that class."""

    name: str
    kind: str
    schema: Mapping[str, Any]


class LiveRecording:
    """Writes messages to a new MCAP file. All methods may raise OSError."""

    def __init__(self, path: Path, about: Mapping[str, str], topics: Sequence[LiveTopic]) -> None:
        self.file = open(path, "wb")  # noqa: SIM115 - closed by `close`
        self.writer: Any = Writer(
            self.file, chunk_size=CHUNK_BYTES, compression=CompressionType.ZSTD
        )
        self.writer.start(library="diffbotctl")
        self.writer.add_metadata("run", {**about, LIVE: "1"})
        self.epoch = int(about["epoch"])
        self.channels: dict[str, int] = {}
        schemas: dict[str, int] = {}
        for topic in topics:
            if topic.kind not in schemas:
                text = json.dumps(topic.schema).encode()
                schemas[topic.kind] = self.writer.register_schema(topic.kind, "jsonschema", text)
            is_driver = topic.name.partition(".")[0] in ("robot", "operator", "input")
            metadata = {"from": "driver" if is_driver else "block", "kind": topic.kind}
            self.channels[topic.name] = self.writer.register_channel(
                topic.name, "json", schemas[topic.kind], metadata
            )
        self.messages = 0
        self.instants = 0
        self.last = 0
        self.flush()

    def write(self, topic: str, message: Mapping[str, Any]) -> None:
        """Write a message as it came; a topic that was not chosen is ignored."""
        channel = self.channels.get(topic)
        if channel is None:
            return
        time = int(message["time"])
        if time > self.last:
            self.instants += 1
        self.last = max(self.last, time)
        wall_time = self.epoch + time
        data = json.dumps(message).encode()
        self.writer.add_message(channel, wall_time, data, wall_time, self.instants)
        self.messages += 1

    def flush(self) -> None:
        """Write everything to the disk, as a chunk that a reader can open."""
        self.writer.flush()
        self.file.flush()
        os.fsync(self.file.fileno())

    def finish(self, cause: str) -> None:
        """Complete the file; without this it counts as cut."""
        self.writer.add_metadata("end", {"code": "", "cause": cause, "last": str(self.last)})
        self.writer.finish()
        self.file.flush()

    def close(self) -> None:
        """Close the file."""
        self.file.close()
