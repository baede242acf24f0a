"""The channels of a run: every topic of it, and those that are made for viewers.

The messages for viewers are the same as in a recording.
"""

from __future__ import annotations

import json
from collections.abc import Iterable, Iterator
from typing import Any, NamedTuple

from diffbotctl.foxglove.protocol import ENCODING, SCHEMA_ENCODING, Fields
from diffbotctl.messages import BUILT_IN, MapUpdate
from diffbotctl.recording.foxglove import TRAIL, ViewerMessages, schema
from diffbotctl.recording.json_codec import message_reader
from diffbotctl.recording.viewer_layout import viewer_layout
from diffbotctl.recording.viewer_model import ViewerModel

LAYOUT, URDF = "layout.json", "robot.urdf"  # files that a viewer may fetch
URI_PREFIX = "package://diffbotctl/"


class RunTopic(NamedTuple):
    """A topic of the run: its wire, the name of its type, and the JSON Schema of that."""

    wire: str
    kind: str
    schema: Fields


class ChannelMessage(NamedTuple):
    """A message of a channel; `time` is in ns since 1970."""

    channel: int
    time: int
    data: bytes


class RunChannels:
    """Channels by number, and the newest message of each.

    `epoch`: ns since 1970 at logical time 0. `commands` maps what viewers may publish to its topic.
    """

    def __init__(
        self, topics: Iterable[RunTopic], model: ViewerModel, epoch: int, commands: dict[str, str]
    ) -> None:
        self.epoch = epoch
        self.now = 0  # logical time of the newest message, ns
        topics = list(topics)
        kinds = {topic.wire: BUILT_IN[topic.kind] for topic in topics if topic.kind in BUILT_IN}
        self.viewers = ViewerMessages(epoch, kinds, model)
        self.readers = {wire: message_reader(kinds[wire]) for wire in self.viewers.builders}
        self.map_wires = {wire for wire, kind in kinds.items() if kind is MapUpdate}
        self.files = {URDF: model.urdf.encode()} if model.urdf else {}
        layout = viewer_layout(kinds, self.viewers.topics, commands)
        self.files[LAYOUT] = json.dumps(layout, indent=2).encode()
        self.numbers: dict[str, int] = {}
        self.topics: dict[int, str] = {}
        self.newest: dict[int, ChannelMessage] = {}
        self.run_topics = [topic.wire for topic in topics]
        self.rows = [self._row(topic.wire, topic.kind, topic.schema) for topic in topics]
        for topic, kind in self.viewers.topics.items():
            self.rows.append(self._row(topic, f"foxglove.{kind}", json.loads(schema(kind))))

    def wires(self, channels: Iterable[int]) -> set[str]:
        topics = {self.topics[channel] for channel in channels}
        needed = {topic for topic in topics if topic not in self.viewers.topics}
        if needed != topics:
            needed |= set(self.viewers.builders)
        return needed | self.map_wires  # whose tiles have to be collected

    def take(self, wire: str, fields: Fields) -> Iterator[ChannelMessage]:
        """The messages that one message of the run becomes."""
        self.now = max(self.now, fields["time"])
        data = json.dumps(fields).encode()
        yield self._keep(wire, data)
        if wire in self.readers:
            message = self.readers[wire](fields)
            for topic, made in self.viewers.of_wire(wire, message):
                yield self._keep(topic, made)

    def begin(self, channel: int) -> Iterator[ChannelMessage]:
        """What a viewer gets when it subscribes: what does not change, or the newest message."""
        topic, time = self.topics[channel], self.epoch + self.now
        fixed = [data for each, data in self.viewers.fixed(self.now) if each == topic]
        yield from (ChannelMessage(channel, time, data) for data in fixed if data is not None)
        if channel in self.newest:
            yield self.newest[channel]

    def forget(self, wires: Iterable[str]) -> None:
        """The run is not asked for these wires any more: their newest messages become old.

        The trail stays: what the robot has driven remains true.
        """
        topics = set(wires)
        if topics & set(self.viewers.builders):
            topics |= set(self.viewers.topics) - {TRAIL}
        for topic in topics:
            self.newest.pop(self.numbers[topic], None)

    def file(self, uri: str) -> bytes | None:
        """The file with this address; None if there is none."""
        return self.files.get(uri.removeprefix(URI_PREFIX))

    def _keep(self, topic: str, data: bytes) -> ChannelMessage:
        channel = self.numbers[topic]
        message = ChannelMessage(channel, self.epoch + self.now, data)
        self.newest[channel] = message
        return message

    def _row(self, topic: str, schema_name: str, schema: Any) -> Fields:
        """One entry of the operation `advertise`."""
        number = len(self.numbers) + 1
        self.numbers[topic] = number
        self.topics[number] = topic
        return {
            "id": number,
            "topic": topic,
            "encoding": ENCODING,
            "schemaName": schema_name,
            "schemaEncoding": SCHEMA_ENCODING,
            "schema": json.dumps(schema, separators=(",", ":")),
        }
