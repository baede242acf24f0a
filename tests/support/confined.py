"""Commands of diffbotctl that run to their end, with what they print and cost.

A command can be confined: to so much memory and processor time that a hostile file harms nothing
but the command.
"""

from __future__ import annotations

import os
import resource
import tempfile
import time
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import BinaryIO, NamedTuple, Self

from diffbotctl.printable import CONTROL
from tests.support.forked_command import ForkedCommand, ForkServer

MEMORY_MAX_BYTES = 2 << 30  # of addresses; protects the machine, the figure is `peak_bytes`
CPU_MAX_S = 20
LIMITS = ((resource.RLIMIT_AS, MEMORY_MAX_BYTES), (resource.RLIMIT_CPU, CPU_MAX_S))
TIMEOUT_S = 60
OUTPUT_MAX_BYTES = 1 << 20
# What the confined commands need: all modules would be most of the memory that they may use.
PRELOADED = [
    *(f"diffbotctl.cli.{name}" for name in ("bag", "blocks", "calibrate", "check", "drive")),
    *(f"diffbotctl.cli.{name}" for name in ("engines", "log", "param", "replay", "run", "stop")),
    *("diffbotctl.cli.topic", "diffbotctl.drivers.simulated_robot", "diffbotctl.replay.replay"),
    *("diffbotctl.runs.control_socket", "diffbotctl.runs.robot_run"),
    *("yaml", "mcap.stream_reader", "zstandard", "numpy"),
]


class ConfinedOutcome(NamedTuple):
    """What became of one command. `code` is negative for a signal that killed it."""

    words: tuple[str, ...]
    code: int
    printed: str
    complaints: str
    cpu_s: float
    peak_bytes: int

    @property
    def output(self) -> str:
        """What it wrote to standard output, and then to standard error."""
        return self.printed + self.complaints

    @property
    def faults(self) -> list[str]:
        """What a command must never do, whatever its input."""
        faults = []
        if self.code not in (0, 1, 2):
            faults.append(f"exit code {self.code}")
        faults += [word for word in ("Traceback", "E-DEFECT") if word in self.output]
        if CONTROL.search(self.output):
            faults.append("control character")
        return faults


def run_command(
    *words: str | Path,
    folder: Path | None = None,
    environment: Mapping[str, str] | None = None,
    server: ForkServer | None = None,
    limits: Sequence[tuple[int, int]] = (),
) -> ConfinedOutcome:
    """Run `diffbotctl words` to its end, without input."""
    arguments = tuple(map(str, words))
    with (
        tempfile.TemporaryFile() as output,
        tempfile.TemporaryFile() as complaints,
        open(os.devnull, "rb") as nothing,
    ):
        process = ForkedCommand(
            arguments,
            server=server,
            limits=limits,
            stdin=nothing,
            stdout=output,
            stderr=complaints,
            cwd=folder,
            env=environment,
        )
        usage = _end_of(process)
        return ConfinedOutcome(
            arguments,
            process.returncode,
            _written(output),
            _written(complaints),
            usage.ru_utime + usage.ru_stime,
            usage.ru_maxrss * 1024,
        )


def _end_of(process: ForkedCommand) -> resource.struct_rusage:
    """Wait for the end, and kill what does not end; what it used."""
    deadline = time.monotonic() + TIMEOUT_S
    while True:
        ended, status, usage = os.wait4(process.pid, os.WNOHANG)
        if ended:
            process.returncode = os.waitstatus_to_exitcode(status)
            return usage
        if time.monotonic() > deadline:
            process.kill()
        time.sleep(0.001)


def _written(file: BinaryIO) -> str:
    file.seek(0)
    return file.read(OUTPUT_MAX_BYTES).decode("utf-8", "replace")


class ConfinedCommands:
    """Runs confined commands in `folder`, where they keep their state too. A context manager."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        own = {"XDG_STATE_HOME": str(folder), "XDG_RUNTIME_DIR": str(folder), "NO_COLOR": "1"}
        self.environment = {**os.environ, **own}
        self._server = ForkServer(PRELOADED)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *error: object) -> None:
        self._server.close()

    def run(self, *words: str | Path) -> ConfinedOutcome:
        """Run `diffbotctl words` to its end."""
        return run_command(
            *words,
            folder=self.folder,
            environment=self.environment,
            server=self._server,
            limits=LIMITS,
        )
