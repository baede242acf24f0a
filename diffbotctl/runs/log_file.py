"""The file of `run --log`: how it is opened, and its first and last line."""

from __future__ import annotations

import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

from diffbotctl.config.configuration import Configuration
from diffbotctl.engine.loop import INTERRUPTED, Ending
from diffbotctl.engine.recorder import Recorder
from diffbotctl.errors import Problem, RunError
from diffbotctl.graph import Sink
from diffbotctl.messages import LogLine

LEVELS = {0: "info", INTERRUPTED: "warning"}  # of the end, by exit code
PROOF = {None: "", True: "; final stop confirmed", False: "; final stop NOT CONFIRMED"}


def opened(
    configuration: Configuration, path: Path, waits: bool, tell: Callable[[str], None]
) -> tuple[Recorder, int]:
    """The engine's end of the file, with its first line, and its writer's pid. Raises RunError.

    `waits` is the Recorder's; `tell` is called once, when no more can be written.
    """
    from diffbotctl.hub import log_process  # only when asked: it costs memory

    try:
        channel, pid = log_process.start(path, time.time_ns())
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


def sink(file: Recorder) -> Sink:
    """What hands the lines of the log on to `file`."""
    record = file.record

    def hear(now: int, line: Any) -> None:
        record(line)

    return hear


def last_line(ending: Ending) -> LogLine:
    """How a run ended."""
    text = f"ended: {ending.cause}{PROOF[ending.stopped]}"
    return LogLine(ending.time, LEVELS.get(ending.code, "error"), "engine", text)
