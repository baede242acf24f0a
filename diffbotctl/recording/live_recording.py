"""A recording that a client makes of a running engine, from the lines that it subscribes to.

It holds what came while the client was connected, of the topics that it chose. The messages are
written as they came, with the schemas that the engine sends, so that no package has to be installed
for their classes. It begins in an unknown state, so it cannot be replayed.
"""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

from diffbotctl.recording.recording_file import RecordingFile, open_locked
from diffbotctl.recording.run_metadata import LIVE


class LiveTopic(NamedTuple):
    """A topic: the name of its message class, and the JSON Schema of that class.

    `is_of_block`: a block publishes it, and no driver, program, device or client.
    """

    name: str
    kind: str
    schema: Mapping[str, Any]
    is_of_block: bool = True


class LiveRecording(RecordingFile):
    """Writes messages as they come to a new file."""

    def __init__(self, path: Path, about: Mapping[str, str], topics: Sequence[LiveTopic]) -> None:
        file = open_locked(path)
        super().__init__(file, {**about, LIVE: "1"})
        self.channels: dict[str, int] = {}
        schemas: dict[str, int] = {}
        for topic in topics:
            if topic.kind not in schemas:
                text = json.dumps(topic.schema).encode()
                schemas[topic.kind] = self.add_schema(topic.kind, text)
            origin = "block" if topic.is_of_block else "driver"
            channel = self.add_channel(topic.name, schemas[topic.kind], origin, topic.kind)
            self.channels[topic.name] = channel
        self.messages = 0
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
        self.writer.add_message(channel, wall_time, data, self.instants)
        self.messages += 1

    def end(self, cause: str) -> None:
        self.finish({"code": "", "cause": cause, "last": str(self.last)})

    def close(self) -> None:
        self.file.close()
