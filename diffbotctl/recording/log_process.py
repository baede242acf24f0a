"""The writer of `run --log`: a child process that puts lines of the log into a file, as JSON.

It ends when the engine does. When it cannot write, it says so once, on the channel it reads from,
and from then on only keeps the channel empty.

The file of `run --log`: how it is opened, and its first and last line.
"""

from __future__ import annotations

import json
import os
import socket
import time
from collections.abc import Callable
from datetime import UTC, datetime
from pathlib import Path
from typing import IO, Any

from diffbotctl.config.configuration import Configuration
from diffbotctl.engine.loop import INTERRUPTED, RunOutcome
from diffbotctl.errors import Problem, RunError
from diffbotctl.graph import Sink
from diffbotctl.messages import LogLevel, LogLine
from diffbotctl.processes.fork import fork_with_channel
from diffbotctl.recording.recorder import Recorder
from diffbotctl.recording.writer_process import read_items, report
from diffbotctl.time import SECOND


def start_log_writer(path: Path, epoch: int) -> tuple[socket.socket, int]:
    """Open `path` to add to it, and fork the writer. Returns the engine's end, and the pid.

    `epoch`: when logical time began, in ns since 1970. Raises OSError when the file cannot be
    opened: in the engine, before anything has started.
    """
    file = open(path, "a", encoding="utf-8")  # noqa: SIM115 - the child closes it
    channel, pid = fork_with_channel(lambda ours: _write(ours, file, epoch), buffer=None)
    file.close()
    return channel, pid


def _write(channel: socket.socket, file: IO[str], epoch: int) -> int:
    coming = read_items(channel)
    try:
        for several in coming:
            for line in several or ():
                file.write(log_text(line, epoch))
            file.flush()  # whoever follows the file sees each line at once
    except OSError as error:
        report(channel, os.strerror(error.errno or 0))
        for _ in coming:
            pass
        return 1
    return 0


def log_text(line: LogLine, epoch: int) -> str:
    """One line of the file: `at` is the time of day in UTC, `time` the run's, in ns."""
    seconds, rest = divmod(epoch + line.time, SECOND)
    at = datetime.fromtimestamp(seconds, UTC).replace(microsecond=rest // 1000)
    fields: dict[str, Any] = {"at": at.isoformat(timespec="microseconds"), **line._asdict()}
    return json.dumps(fields) + "\n"


LEVELS: dict[int, LogLevel] = {0: "info", INTERRUPTED: "warning"}  # of the end, by exit code
PROOF = {None: "", True: "; final stop confirmed", False: "; final stop NOT CONFIRMED"}


def open_log(
    configuration: Configuration, path: Path, waits: bool, tell: Callable[[str], None]
) -> tuple[Recorder, int]:
    """The engine's end of the file, with its first line, and its writer's pid. Raises RunError.

    `waits` is the Recorder's; `tell` is called once, when no more can be written.
    """
    # only when asked: it costs memory

    try:
        channel, pid = start_log_writer(path, time.time_ns())
    except OSError as error:
        cause = f"cannot write there: {error.strerror}"
        raise RunError(Problem("E-LOG", str(path), cause, "give another file")) from error

    def lost(cause: str) -> None:
        tell(f"LOG STOPPED: {path}: {cause}; the run goes on, the file is incomplete")

    made = Recorder(channel, waits, lost, at_once=True)
    robot = configuration.robot_file
    on = "" if robot is None else f" on robot {robot}"
    made.record(LogLine(0, "info", "engine", f"started: {configuration.file}{on}"))
    return made, pid


def log_sink(file: Recorder) -> Sink:
    """What hands the lines of the log on to `file`."""
    record = file.record

    def hear(now: int, line: Any) -> None:
        record(line)

    return hear


def last_line(ending: RunOutcome) -> LogLine:
    """How a run ended."""
    text = f"ended: {ending.cause}{PROOF[ending.stopped]}"
    return LogLine(ending.time, LEVELS.get(ending.code, "error"), "engine", text)
