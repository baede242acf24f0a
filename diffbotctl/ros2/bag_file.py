"""A rosbag2 folder: MCAP storage with messages in CDR, written by the library rosbags."""

from __future__ import annotations

from pathlib import Path
from typing import Any, Literal

import numpy as np
from rosbags.interfaces import (
    Connection,
    Nodetype,
    Qos,
    QosDurability,
    QosHistory,
    QosLiveliness,
    QosReliability,
    QosTime,
)
from rosbags.rosbag2 import StoragePlugin, Writer
from rosbags.typesys import Stores, get_typestore

from diffbotctl.ros2.conversion import Fields
from diffbotctl.ros2.topics import Delivery, RosTopic

FORMAT_VERSION: Literal[9] = 9  # of metadata.yaml, since Jazzy
QUEUE_DEPTH = 10
UNBOUNDED = QosTime(0x7FFFFFFF, 999_999_999)  # as rosbag2 writes a duration without a limit
EMPTY = {"string": "", "bool": False, "float32": 0.0, "float64": 0.0}  # other types are integers


class RosBag:
    """Writes a new folder; `close` completes it. Raises OSError when it cannot be written."""

    def __init__(self, folder: Path, mark: tuple[str, str]) -> None:
        self.types: Any = get_typestore(Stores.ROS2_JAZZY)
        self.writer = Writer(folder, version=FORMAT_VERSION, storage_plugin=StoragePlugin.MCAP)
        self.writer.set_custom_data(*mark)
        self.writer.open()
        self.connections: dict[RosTopic, Connection] = {}
        self.counts: dict[str, int] = {}

    def add_topic(self, topic: RosTopic) -> None:
        """Make a topic known, so that it is listed even without a message."""
        self.connections[topic] = self.writer.add_connection(
            absolute_name(topic),
            topic.type,
            typestore=self.types,
            offered_qos_profiles=[_offered_qos(topic.delivery)],
        )
        self.counts[absolute_name(topic)] = 0

    def write(self, topic: RosTopic, time: int, fields: Fields) -> None:
        """Write a message that was received at `time` (ns since 1970)."""
        if topic not in self.connections:
            self.add_topic(topic)
        message = self._message(topic.type, fields)
        data = self.types.serialize_cdr(message, topic.type)
        self.writer.write(self.connections[topic], time, data)
        self.counts[absolute_name(topic)] += 1

    def close(self) -> None:
        self.writer.close()

    def abort(self) -> None:
        """Close the file as it is."""
        self.writer.abort()

    def _message(self, kind: str, fields: Fields) -> Any:
        """A message with `fields`; those that are not named are zero, false or empty."""
        _, declared = self.types.fielddefs[kind]
        values = {name: self._value(detail, fields.get(name)) for name, detail in declared}
        return self.types.types[kind](**values)

    def _value(self, declared: Any, value: Any) -> Any:
        node, detail = declared
        if node is Nodetype.NAME:
            return self._message(detail, value or {})
        if node is Nodetype.BASE:
            return EMPTY.get(detail[0], 0) if value is None else value
        (item, name), length = detail
        if item is Nodetype.NAME:
            return [self._message(name, fields) for fields in value or ()]
        if name[0] == "string":
            return list(value or ())
        return np.array(value if value is not None else [0] * length, dtype=name[0])


def absolute_name(topic: RosTopic) -> str:
    return "/" + topic.name.lstrip("/")


def _offered_qos(delivery: Delivery) -> Qos:
    is_latched, is_sensor = delivery == "latched", delivery == "best_effort"
    return Qos(
        QosHistory.KEEP_LAST,
        QUEUE_DEPTH,
        QosReliability.BEST_EFFORT if is_sensor else QosReliability.RELIABLE,
        QosDurability.TRANSIENT_LOCAL if is_latched else QosDurability.VOLATILE,
        UNBOUNDED,
        UNBOUNDED,
        QosLiveliness.AUTOMATIC,
        UNBOUNDED,
        avoid_ros_namespace_conventions=False,
    )
