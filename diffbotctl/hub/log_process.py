"""The writer of `run --log`: a child process that puts lines of the log into a file, as JSON.

It ends when the engine does. When it cannot write, it says so once, on the channel it reads from,
and from then on only keeps the channel empty.
"""

from __future__ import annotations

import json
import os
import socket
from datetime import UTC, datetime
from pathlib import Path
from typing import IO, Any

from diffbotctl.hub.child import fork_with_channel
from diffbotctl.hub.recorder_process import items, report
from diffbotctl.messages import LogLine

SECOND = 1_000_000_000


def start(path: Path, epoch: int) -> tuple[socket.socket, int]:
    """Open `path` to add to it, and fork the writer. Returns the engine's end, and the pid.

    `epoch`: when logical time began, in ns since 1970. Raises OSError when the file cannot be
    opened: in the engine, before anything has started.
    """
    file = open(path, "a", encoding="utf-8")  # noqa: SIM115 - the child closes it
    channel, pid = fork_with_channel(lambda ours: _write(ours, file, epoch), buffer=None)
    file.close()
    return channel, pid


def _write(channel: socket.socket, file: IO[str], epoch: int) -> int:
    coming = items(channel)
    try:
        for several in coming:
            for line in several or ():
                file.write(text(line, epoch))
            file.flush()  # whoever follows the file sees each line at once
    except OSError as error:
        report(channel, os.strerror(error.errno or 0))
        for _ in coming:
            pass
        return 1
    return 0


def text(line: LogLine, epoch: int) -> str:
    """One line of the file: `at` is the time of day in UTC, `time` the run's, in ns."""
    seconds, rest = divmod(epoch + line.time, SECOND)
    at = datetime.fromtimestamp(seconds, UTC).replace(microsecond=rest // 1000)
    fields: dict[str, Any] = {"at": at.isoformat(timespec="microseconds"), **line._asdict()}
    return json.dumps(fields) + "\n"
