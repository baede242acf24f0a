"""Recovering a recording that was cut or damaged: every record that can be read, in a new file."""

from __future__ import annotations

import os
from collections.abc import Iterator
from pathlib import Path
from typing import IO, Any, NamedTuple

from mcap.records import Attachment, Channel, Message, Metadata, Schema
from mcap.writer import Writer

from diffbotctl.errors import Problem, RunError
from diffbotctl.recording import mcap_records
from diffbotctl.recording.reader import open_recording


class RecoveryResult(NamedTuple):
    """What was recovered.

    `damaged` counts the chunks that could not be read; `cut` is why the reading ended before the
    file's proper end, or None.
    """

    messages: int
    damaged: int
    cut: str | None


class ReadableRecords:
    """Every record of a damaged file that can still be read."""

    def __init__(self) -> None:
        self.damaged = 0
        self.cut: str | None = None

    def records(self, file: IO[bytes]) -> Iterator[Any]:
        """The records; of a chunk with a wrong record none."""
        try:
            for whole in mcap_records.file_records(file):
                try:
                    records = list(mcap_records.records_in(whole))
                except mcap_records.MalformedError:
                    self.damaged += 1
                    continue
                yield from records
        except mcap_records.CutError as error:
            self.cut = str(error)
        except mcap_records.MalformedError as error:
            self.cut = f"byte {error.place}: {error}"


class RecordingCopy:
    """Writes records to a new file, with new identifiers."""

    def __init__(self, file: Any) -> None:
        self.writer: Any = Writer(file)
        self.writer.start(library="diffbotctl")
        self.schemas: dict[int, int] = {0: 0}  # 0 means no schema
        self.channels: dict[int, int] = {}
        self.messages = 0
        self.is_recording = False

    def add(self, record: Any) -> None:
        """Write a record; of messages those whose channel has been written."""
        match record:
            case Schema() if record.id not in self.schemas:
                self.schemas[record.id] = self.writer.register_schema(
                    record.name, record.encoding, record.data
                )
            case Channel() if record.id not in self.channels and record.schema_id in self.schemas:
                self.channels[record.id] = self.writer.register_channel(
                    record.topic,
                    record.message_encoding,
                    self.schemas[record.schema_id],
                    record.metadata,
                )
            case Message() if record.channel_id in self.channels:
                channel = self.channels[record.channel_id]
                self.writer.add_message(
                    channel, record.log_time, record.data, record.publish_time, record.sequence
                )
                self.messages += 1
            case Attachment():
                self.writer.add_attachment(
                    record.create_time,
                    record.log_time,
                    record.name,
                    record.media_type,
                    record.data,
                )
            case Metadata():
                self.is_recording = self.is_recording or record.name == "run"
                self.writer.add_metadata(record.name, record.metadata)


def recover(source: Path, target: Path) -> RecoveryResult:
    """Write every message of `source` that can be read to the file `target`, another one.

    A recording without an end stays without one: messages may be missing, so that `replay --check`
    refuses it. Raises RunError when `source` is not a recording, or `target` cannot be written.
    """
    if target.exists() and not target.is_file():
        cause, fix = "this is a device or a folder, not a file", "choose another name"
        raise RunError(Problem("E-RECORD", str(target), cause, fix))
    draft = target.with_name(target.name + ".part")
    damaged_file = ReadableRecords()
    try:
        with open_recording(source) as file:
            copy = _copy(file, draft, damaged_file)
        if not copy.is_recording:
            cause = "the beginning of a recording of diffbotctl cannot be read"
            raise RunError(Problem("E-RECORDING", str(source), cause))
        os.replace(draft, target)
    except OSError as error:
        cause = f"cannot write it: {error.strerror}"
        raise RunError(Problem("E-RECORD", str(target), cause)) from error
    finally:
        draft.unlink(missing_ok=True)
    return RecoveryResult(copy.messages, damaged_file.damaged, damaged_file.cut)


def _copy(file: Any, draft: Path, damaged_file: ReadableRecords) -> RecordingCopy:
    with draft.open("wb") as output:
        copy = RecordingCopy(output)
        for record in damaged_file.records(file):
            copy.add(record)
        loss = {"damaged_chunks": str(damaged_file.damaged), "cut": damaged_file.cut or ""}
        copy.writer.add_metadata("recovered", loss)
        copy.writer.finish()
    return copy
