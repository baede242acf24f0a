"""An MCAP file that is being written: the metadata of its run, JSON channels, and its end."""

from __future__ import annotations

import errno
import fcntl
import os
import stat
from collections.abc import Mapping
from contextlib import suppress
from pathlib import Path
from typing import IO

CHUNK_BYTES = 256 << 10  # an unpaced run fills it in a few ms, a paced one flushes each second
IN_USE = "another run or `bag record` is writing this file now"


def open_locked(path: Path) -> IO[bytes]:
    """Open `path`, empty, for a process that writes it alone.

    The lock lasts until that process closes the file or ends, also when it is killed. A device such
    as /dev/null is not locked, since it keeps nothing that a second writer could destroy. Raises
    OSError, with IN_USE as its text while another process has the lock.
    """

    def lock(name: str, flags: int) -> int:
        # Emptied once it is locked: until then it may be the recording of another run.
        number = os.open(name, flags & ~os.O_TRUNC, 0o666)
        try:
            if stat.S_ISREG(os.fstat(number).st_mode):
                _lock(number)
                os.truncate(number, 0)
        except OSError:
            os.close(number)
            raise
        return number

    return open(path, "wb", opener=lock)


def _lock(number: int) -> None:
    try:
        fcntl.flock(number, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError as error:
        raise OSError(errno.EWOULDBLOCK, IN_USE) from error
    except OSError:
        return  # a file system without locks, such as some of a network


def is_being_written(path: Path) -> bool:
    """Whether a process has the file open as `open_locked` does; False where that is not known."""
    with suppress(OSError), path.open("rb") as file:
        try:
            fcntl.flock(file, fcntl.LOCK_SH | fcntl.LOCK_NB)
        except BlockingIOError:
            return True
    return False


class RecordingFile:
    """Writes to `file`. All methods may raise OSError, for example when the disk is full.

    A file that was completed carries the metadata record `end`; without it the file was cut, and is
    readable up to its last flush.
    """

    def __init__(self, file: IO[bytes], about: Mapping[str, str]) -> None:
        """`about` is the metadata of the run."""
        # heavy: only the writing process loads it
        from diffbotctl.recording.mcap_writer import McapWriter

        self.file = file
        self.writer = McapWriter(file, "diffbotctl", CHUNK_BYTES)
        self.writer.add_metadata("run", about)
        self.epoch = int(about["epoch"])
        self.instants = 0

    def add_schema(self, name: str, text: bytes) -> int:
        """Add a JSON Schema. Returns its number."""
        return self.writer.add_schema(name, "jsonschema", text)

    def add_channel(self, topic: str, schema: int, origin: str, kind: str) -> int:
        """Add the channel of a topic, whose messages are of class `kind`. Returns its number."""
        metadata = {"from": origin, "kind": kind}
        return self.writer.add_channel(topic, "json", schema, metadata)

    def flush(self) -> None:
        """Write everything to the disk, as a chunk that a reader can open."""
        self.writer.flush()
        self.file.flush()
        os.fsync(self.file.fileno())

    def finish(self, summary: Mapping[str, str]) -> None:
        """Complete the file; without this it counts as cut."""
        self.writer.add_metadata("end", summary)
        self.writer.finish()
        self.file.flush()
