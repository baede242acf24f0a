"""Engine side of recordings and log files: sends compact records to a child, without waiting.

The child side is in diffbotctl.recording.writer. Nothing here formats text or touches a disk.
"""

from __future__ import annotations

import socket
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

from diffbotctl.config.configuration import Configuration
from diffbotctl.engine.loop import INTERRUPTED, RunOutcome
from diffbotctl.errors import Problem, RunError
from diffbotctl.graph import Sink
from diffbotctl.messages import REACHED_UNSURE, LogLevel, LogLine
from diffbotctl.processes.child_process import ANSWER_TIMEOUT_S, ChildSender
from diffbotctl.recording.writer import start_log_writer
from diffbotctl.time import MILLISECOND

BATCH_INSTANTS = 256  # that an unpaced run gathers before it sends them
BATCH_PERIOD = 100 * MILLISECOND  # of a paced run: waking the child costs more than its work


class Recorder:
    """Gathers instants, or log lines, and sends them in batches.

    `waits`: an unpaced run waits for the child; a paced one never does, and on overflow the
    recording is given up and the run continues. `on_loss` is called once, with the reason, when the
    recording has become incomplete. `immediate`: a paced run sends without gathering.
    """

    def __init__(
        self,
        channel: socket.socket,
        waits: bool,
        on_loss: Callable[[str], None],
        immediate: bool = False,
    ) -> None:
        self.sender = ChildSender(channel, waits, on_loss)
        self.waits = waits
        self.immediate = immediate and not waits
        self.pending: list[tuple[Any, ...]] = []
        self.record: Callable[[tuple[Any, ...]], object] = self.pending.append

    @property
    def lost(self) -> str | None:
        """Why the recording is incomplete; None while it is complete."""
        return self.sender.lost

    def drain(self) -> None:
        """Send a full batch. Called in the loop's idle time, after commands have left."""
        pending = self.pending
        if not pending:
            return
        is_batch = len(pending) >= BATCH_INSTANTS or (not self.waits and spans_batch(pending))
        if not (is_batch or self.immediate):
            return
        self.sender.send(pending)
        pending.clear()
        self._check_child()

    def close(self, summary: dict[str, str] | None = None) -> None:
        """Send the rest, wait for the child and end it.

        Without loss a recording ends complete, with `summary` in it.
        """
        self.sender.channel.settimeout(ANSWER_TIMEOUT_S)
        self._check_child()
        self.sender.send(self.pending)
        if summary is not None:
            self.sender.send(summary)
        self.sender.finish()
        trouble = self.sender.close()
        if trouble:
            self.sender.give_up(trouble)

    def _check_child(self) -> None:
        trouble = self.sender.receive()  # the child reports nothing else
        if trouble is not None:
            self.sender.give_up(trouble)


def spans_batch(instants: list[tuple[Any, ...]]) -> bool:
    return bool(instants[-1][0] - instants[0][0] >= BATCH_PERIOD)


# By exit code.
END_LEVELS: dict[int, LogLevel] = {0: "info", REACHED_UNSURE: "warning", INTERRUPTED: "warning"}
FINAL_STOP = {None: "", True: "; final stop confirmed", False: "; final stop NOT CONFIRMED"}


def open_log(
    configuration: Configuration, path: Path, waits: bool, warn: Callable[[str], None]
) -> tuple[Recorder, int]:
    """Start the log file of `run --log`, with its first line. Returns its recorder and writer pid.

    `waits` is the Recorder's; `warn` is called once, when no more can be written. Raises RunError.
    """
    try:
        channel, pid = start_log_writer(path, time.time_ns())
    except OSError as error:
        cause = f"cannot write there: {error.strerror}"
        raise RunError(Problem("E-LOG", str(path), cause, "give another file")) from error

    def on_loss(cause: str) -> None:
        warn(f"LOG STOPPED: {path}: {cause}; the run continues, the file is incomplete")

    recorder = Recorder(channel, waits, on_loss, immediate=True)
    robot = configuration.robot_file
    on_robot = "" if robot is None else f" on robot {robot}"
    recorder.record(LogLine(0, "info", "engine", f"started: {configuration.file}{on_robot}"))
    return recorder, pid


def log_sink(log: Recorder) -> Sink:
    def sink(now: int, line: Any) -> None:
        log.record(line)

    return sink


def last_line(outcome: RunOutcome) -> LogLine:
    text = f"ended: {outcome.cause}{FINAL_STOP[outcome.stopped]}"
    return LogLine(outcome.time, END_LEVELS.get(outcome.code, "error"), "engine", text)
