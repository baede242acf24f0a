"""From a recording that was cut to a file that every reader opens."""

from __future__ import annotations

import os
from collections.abc import Iterator
from pathlib import Path
from typing import Any, NamedTuple

from diffbotctl.errors import Problem, RunError
from diffbotctl.recording.info import readable_recording

LARGEST = 256 << 20  # bytes of one record; a damaged length asks for more


class Recovered(NamedTuple):
    """What was saved. `damaged` counts the chunks that could not be read; `cut` says why the
    reading ended before the file's proper end, or is None."""

    messages: int
    damaged: int
    cut: str | None


class _Salvage:
    """Every record of a damaged file that can still be read."""

    def __init__(self) -> None:
        self.damaged = 0
        self.cut: str | None = None

    def records(self, file: Any) -> Iterator[Any]:
        from mcap.records import Chunk
        from mcap.stream_reader import StreamReader, breakup_chunk

        reader = StreamReader(file, emit_chunks=True, record_size_limit=LARGEST)
        records = iter(reader.records)
        while True:
            try:
                record = next(records)
            except StopIteration:
                return
            except Exception as error:  # a cut file ends wherever it ends
                self.cut = f"{type(error).__name__}: {error}".rstrip(": ")
                return
            if not isinstance(record, Chunk):
                yield record
                continue
            try:
                inside = breakup_chunk(record, validate_crc=True)
            except Exception:  # the decompressor raises what it likes
                self.damaged += 1
                continue
            yield from inside


class _Copy:
    """Writes records to a new file, with identifiers of its own."""

    def __init__(self, file: Any) -> None:
        from mcap.writer import Writer

        self.writer: Any = Writer(file)
        self.writer.start(library="diffbotctl")
        self.schemas: dict[int, int] = {0: 0}  # 0 means no schema
        self.channels: dict[int, int] = {}
        self.messages = 0
        self.begun = False

    def take(self, record: Any) -> None:
        from mcap.records import Attachment, Channel, Message, Metadata, Schema

        match record:
            case Schema() if record.id not in self.schemas:
                self.schemas[record.id] = self.writer.register_schema(
                    record.name, record.encoding, record.data
                )
            case Channel() if record.id not in self.channels:
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
                self.begun = self.begun or record.name == "run"
                self.writer.add_metadata(record.name, record.metadata)


def recover(source: Path, target: Path) -> Recovered:
    """Write every message of `source` that can be read to the new file `target`.

    A recording that had no end gets none: nobody knows what is missing, and `replay --check` says
    so. Raises RunError when `source` is no recording, or `target` exists or cannot be written.
    """
    if target.exists():
        cause = "the file is there already"
        raise RunError(Problem("E-RECORD", str(target), cause, "give another with --output"))
    draft = target.with_name(target.name + ".part")
    salvage = _Salvage()
    try:
        with readable_recording(source), source.open("rb") as file:
            copied = _copy(file, draft, salvage)
        if not copied.begun:
            cause = "nothing in it can be read as the beginning of a recording of diffbotctl"
            raise RunError(Problem("E-RECORDING", str(source), cause))
        os.replace(draft, target)
    finally:
        draft.unlink(missing_ok=True)
    return Recovered(copied.messages, salvage.damaged, salvage.cut)


def _copy(file: Any, draft: Path, salvage: _Salvage) -> _Copy:
    with draft.open("wb") as made:
        copy = _Copy(made)
        for record in salvage.records(file):
            copy.take(record)
        lost = {"damaged_chunks": str(salvage.damaged), "cut": salvage.cut or ""}
        copy.writer.add_metadata("recovered", lost)
        copy.writer.finish()
    return copy
