"""Child side of recordings and log files: the processes that write them, and the MCAP writer.

A child outlives a killed engine until it has written what had reached it. When it cannot write, it
reports that once over its channel, and after that only drains the channel.
"""

import json
import os
import socket
import time
from collections.abc import Callable
from contextlib import suppress
from datetime import UTC, datetime
from pathlib import Path
from typing import IO, Any, NamedTuple

from diffbotctl.message_types import type_name
from diffbotctl.messages import LogLine
from diffbotctl.processes.child_process import (
    SILENCE_PERIOD_S,
    drain,
    fork_with_channel,
    read_items,
    report,
)
from diffbotctl.recording.foxglove import ViewerMessages, schema
from diffbotctl.recording.json_codec import message_encoder
from diffbotctl.recording.message_schema import json_schema
from diffbotctl.recording.recording_file import RecordingFile, open_locked
from diffbotctl.recording.viewer_layout import viewer_layout
from diffbotctl.recording.viewer_model import ViewerModel
from diffbotctl.time import SECOND

NICENESS = 5  # as that of the control socket's process
VIEWER = "viewer"  # origin of messages that are written for viewers and are no part of the run
STATE = "state"  # name of the attachment with the state from which a replay begins
URDF, LAYOUT = "robot.urdf", "layout.json"  # names of the attachments for viewers


class RecordingHeader(NamedTuple):
    """What a recording must know of its run before the first instant.

    `wires` are all wires with their message classes, the first `sources` of them the drivers';
    `about` is the metadata of the run; `model` is what viewers draw besides the messages.
    """

    wires: dict[str, type]
    sources: int
    about: dict[str, str]
    model: ViewerModel = ViewerModel()


class RecordingWriter(RecordingFile):
    """Writes the instants of a run, with one channel a wire and some for viewers."""

    def __init__(self, file: IO[bytes], header: RecordingHeader) -> None:
        super().__init__(file, header.about)
        self.channels: list[tuple[int, Any]] = []
        schemas: dict[type, int] = {}
        for place, (wire, kind) in enumerate(header.wires.items()):
            if kind not in schemas:
                schema_text = json.dumps(json_schema(kind)).encode()
                schemas[kind] = self.add_schema(type_name(kind), schema_text)
            origin = "driver" if place < header.sources else "block"
            channel = self.add_channel(wire, schemas[kind], origin, type_name(kind))
            self.channels.append((channel, message_encoder(kind)))
        self.viewers = ViewerMessages(self.epoch, header.wires, header.model, has_grids=False)
        published = {
            kind: self.add_schema(f"foxglove.{kind}", schema(kind))
            for kind in dict.fromkeys(self.viewers.topics.values())
        }
        self.viewer_channels = {
            topic: self.add_channel(topic, published[kind], VIEWER, f"foxglove.{kind}")
            for topic, kind in self.viewers.topics.items()
        }
        self._attach_for_viewers(header.wires)
        self.flush()  # killed within the first second, the file still has the run's metadata

    def _attach_for_viewers(self, wires: dict[str, type]) -> None:
        """Attach the robot's model and a layout; black box files have nothing to show in them."""
        urdf = self.viewers.model.urdf
        if urdf:
            self._attach(self.epoch, URDF, "application/xml", urdf.encode())
        layout = viewer_layout(wires, self.viewers.topics)
        if layout:
            self._attach(self.epoch, LAYOUT, "application/json", json.dumps(layout).encode())

    def _attach(self, time: int, name: str, media_type: str, data: bytes) -> None:
        self.writer.add_attachment(time, name, media_type, data)

    def write(self, instant: tuple[Any, ...]) -> None:
        """Write the messages of one instant: (time, message or None for each wire)."""
        time, number, add_message = self.epoch + instant[0], self.instants, self.writer.add_message
        for (channel, encode), message in zip(self.channels, instant[1:], strict=True):
            if message is not None:
                add_message(channel, time, encode(message), number)
        for topic, data in self.viewers.messages(instant):
            add_message(self.viewer_channels[topic], time, data, number)
        self.instants += 1

    def attach_state(self, time: int, state: bytes) -> None:
        """Attach the state of the blocks after the instant `time` (ns): a replay begins there."""
        self._attach(self.epoch + time, STATE, "application/octet-stream", state)


def start_recorder(
    path: Path, header: RecordingHeader, is_paced: bool
) -> tuple[socket.socket, int]:
    """Open `path` and fork the process that writes it. Returns the engine's end and the pid.

    A paced run has priority over its writer; an unpaced one waits for it. Raises OSError when the
    file cannot be opened: in the engine, before anything has started.
    """
    file = open_locked(path)

    def serve(channel: socket.socket) -> int:
        if is_paced:
            with suppress(OSError):
                os.nice(NICENESS)
        return _until_it_fails(channel, lambda: _write_recording(channel, file, header))

    channel, pid = fork_with_channel(serve)
    file.close()
    return channel, pid


def start_log_writer(path: Path, epoch: int) -> tuple[socket.socket, int]:
    """Open `path` to append to it, and fork the process that writes log lines as JSON.

    `epoch`: ns since 1970 at logical time 0. Returns the engine's end and the pid. Raises OSError
    when the file cannot be opened: in the engine, before anything has started.
    """
    file = open(path, "a", encoding="utf-8")  # noqa: SIM115 - the child closes it
    channel, pid = fork_with_channel(
        lambda channel: _until_it_fails(channel, lambda: _write_log(channel, file, epoch)),
        buffer=None,
    )
    file.close()
    return channel, pid


def _until_it_fails(channel: socket.socket, write: Callable[[], None]) -> int:
    try:
        write()
    except OSError as error:
        report(channel, os.strerror(error.errno or 0))
        drain(channel)
        return 1
    return 0


def _write_recording(channel: socket.socket, file: IO[bytes], header: RecordingHeader) -> None:
    recording = RecordingWriter(file, header)
    flushed = time.monotonic()
    summary: dict[str, str] | None = None
    for item in read_items(channel):
        if isinstance(item, list):
            for instant in item:
                recording.write(instant)
        elif isinstance(item, dict):
            summary = item
        if time.monotonic() - flushed >= SILENCE_PERIOD_S:
            recording.flush()
            flushed = time.monotonic()
    recording.flush()
    if summary is not None:
        recording.finish({**summary, "instants": str(recording.instants)})


def _write_log(channel: socket.socket, file: IO[str], epoch: int) -> None:
    for lines in read_items(channel):
        for line in lines or ():
            file.write(log_text(line, epoch))
        file.flush()  # a program that follows the file gets each line at once


def log_text(line: LogLine, epoch: int) -> str:
    """One line of the file: `at` is the time of day in UTC, `time` the run's, in ns."""
    seconds, rest = divmod(epoch + line.time, SECOND)
    at = datetime.fromtimestamp(seconds, UTC).replace(microsecond=rest // 1000)
    fields: dict[str, Any] = {"at": at.isoformat(timespec="microseconds"), **line._asdict()}
    return json.dumps(fields) + "\n"
