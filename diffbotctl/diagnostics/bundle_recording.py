"""A copy of a recording without private contents, for a helper."""

from __future__ import annotations

import json
from io import BytesIO
from pathlib import Path
from typing import Any, NamedTuple

from mcap.records import Attachment, Channel, Message, Metadata

from diffbotctl.diagnostics.private_text import PrivateText
from diffbotctl.errors import Problem, RunError
from diffbotctl.recording.reader import open_recording
from diffbotctl.recording.recover import ReadableRecords, RecordingCopy
from diffbotctl.recording.writer import STATE

FILES = "files"  # key of the metadata with the texts of the run's files


class SharedRecording(NamedTuple):
    """The copy as bytes, the files of its run by path, and what was left out."""

    data: bytes
    files: dict[str, str]
    notes: tuple[str, ...]


def share_recording(path: Path, private: PrivateText) -> SharedRecording:
    """Copy a recording without what is private. Raises RunError when it cannot be read."""
    output = BytesIO()
    copy, readable = RecordingCopy(output), ReadableRecords()
    files: dict[str, str] = {}
    notes: list[str] = []
    with open_recording(path) as file:
        for record in readable.records(file):
            shared, note = _shared(record, private)
            if note:
                notes.append(note)
            if shared is not None:
                copy.add(shared)
            if isinstance(shared, Metadata):
                files |= _files(shared.metadata)
    copy.writer.finish()
    if not copy.is_recording:
        cause = "the beginning of a recording of diffbotctl cannot be read"
        raise RunError(Problem("E-RECORDING", str(path), cause))
    if readable.damaged or readable.cut is not None:
        notes.append("it is damaged; this is what can be read")
    return SharedRecording(output.getvalue(), files, tuple(notes))


def _shared(record: Any, private: PrivateText) -> tuple[Any, str]:
    """The record to write, or None, and why not."""
    match record:
        case Metadata():
            record.metadata = private.without_in_json(record.metadata)
        case Channel() if record.message_encoding != "json":
            return None, f"without {record.topic}: its format is unknown"
        case Channel():
            record.topic = private.without(record.topic)
        case Message():
            try:
                value = json.loads(record.data)
            except (ValueError, RecursionError):
                return None, ""
            record.data = json.dumps(private.without_in_json(value)).encode()
        case Attachment() if record.name == STATE:
            if private.is_in(record.data):
                return None, "without the state of its blocks, so that it cannot be replayed"
        case Attachment():
            record.data = private.without(record.data.decode("utf-8", "replace")).encode()
    return record, ""


def _files(metadata: dict[str, str]) -> dict[str, str]:
    try:
        files = json.loads(metadata.get(FILES, "{}"))
    except (ValueError, RecursionError):
        return {}
    is_known = isinstance(files, dict) and all(isinstance(text, str) for text in files.values())
    return files if is_known else {}
