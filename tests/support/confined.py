"""Commands of diffbotctl as processes that need not import it, with what they print and cost.

A server process imports the package once and forks for each command, so that a command takes
milliseconds and its memory is that of the command, not that of the test. A command can be confined:
to so much memory and processor time that a hostile file harms nothing but the command.
"""

from __future__ import annotations

import json
import os
import resource
import signal
import subprocess
import sys
import tempfile
import time
import traceback
from collections.abc import Mapping, Sequence
from importlib import import_module
from pathlib import Path
from typing import BinaryIO, NamedTuple, Self

from diffbotctl.cli.main import main
from diffbotctl.printable import CONTROL

MEMORY_MAX_BYTES = 2 << 30  # of addresses; protects the machine, the figure is `peak_bytes`
CPU_MAX_S = 20
TIMEOUT_S = 60
OUTPUT_MAX_BYTES = 1 << 20
PRELOADED = [
    *("bag", "blocks", "calibrate", "check", "drive", "engines", "log", "param"),
    *("replay", "run", "stop", "topic"),
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


class ForkedCommands:
    """Runs commands in `folder`, one after the other. A context manager."""

    is_confined = False

    def __init__(self, folder: Path, environment: Mapping[str, str]) -> None:
        self.folder = folder
        self.process = subprocess.Popen(
            [sys.executable, "-m", __name__],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            cwd=folder,
            env={**environment, "PYTHONPATH": str(Path(__file__).resolve().parents[2])},
            text=True,
        )

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *error: object) -> None:
        assert self.process.stdin is not None
        self.process.stdin.close()
        self.process.wait()

    def run(
        self,
        *words: str | Path,
        folder: Path | None = None,
        environment: Mapping[str, str] | None = None,
    ) -> ConfinedOutcome:
        """Run `diffbotctl words` to its end. None: in the folder and environment of the server."""
        assert self.process.stdin is not None and self.process.stdout is not None
        arguments = tuple(map(str, words))
        where = None if folder is None else str(folder)
        variables = None if environment is None else dict(environment)
        request = Request(arguments, where, variables, self.is_confined)
        self.process.stdin.write(json.dumps(request) + "\n")
        self.process.stdin.flush()
        return ConfinedOutcome(arguments, *json.loads(self.process.stdout.readline()))


class ConfinedCommands(ForkedCommands):
    """Runs confined commands in `folder`, where they keep their state too."""

    is_confined = True

    def __init__(self, folder: Path) -> None:
        own = {"XDG_STATE_HOME": str(folder), "XDG_RUNTIME_DIR": str(folder), "NO_COLOR": "1"}
        super().__init__(folder, {**os.environ, **own})


class Request(NamedTuple):
    """One command to fork for: `folder` and `environment` are None for those of the server."""

    words: Sequence[str]
    folder: str | None
    environment: dict[str, str] | None
    is_confined: bool


def _serve() -> None:
    for name in PRELOADED:
        import_module(f"diffbotctl.cli.{name}")
    for name in ("yaml", "mcap.stream_reader", "zstandard", "numpy"):
        import_module(name)
    for line in sys.stdin:
        print(json.dumps(_run(Request(*json.loads(line)))), flush=True)


def _run(request: Request) -> tuple[int, str, str, float, int]:
    with tempfile.TemporaryFile() as output, tempfile.TemporaryFile() as complaints:
        pid = os.fork()
        if not pid:
            _become_command(request, output.fileno(), complaints.fileno())
        deadline = time.monotonic() + TIMEOUT_S
        while True:
            ended, status, usage = os.wait4(pid, os.WNOHANG)
            if ended:
                break
            if time.monotonic() > deadline:
                os.kill(pid, signal.SIGKILL)
            time.sleep(0.001)
        code = os.waitstatus_to_exitcode(status)
        cpu_s, peak_bytes = usage.ru_utime + usage.ru_stime, usage.ru_maxrss * 1024
        return code, _written(output), _written(complaints), cpu_s, peak_bytes


def _written(file: BinaryIO) -> str:
    file.seek(0)
    return file.read(OUTPUT_MAX_BYTES).decode("utf-8", "replace")


def _become_command(request: Request, output: int, complaints: int) -> None:
    if request.environment is not None:
        os.environ.clear()
        os.environ.update(request.environment)
        places = os.environ.get("PYTHONPATH", "").split(os.pathsep)
        sys.path[:0] = [place for place in places if place not in ("", *sys.path)]
    if request.folder is not None:
        os.chdir(request.folder)
    null = os.open(os.devnull, os.O_RDONLY)
    os.dup2(null, 0)
    os.dup2(output, 1)
    os.dup2(complaints, 2)
    if request.is_confined:
        resource.setrlimit(resource.RLIMIT_AS, (MEMORY_MAX_BYTES, MEMORY_MAX_BYTES))
        resource.setrlimit(resource.RLIMIT_CPU, (CPU_MAX_S, CPU_MAX_S))
    sys.stdin = open(0, encoding="utf-8", closefd=False)  # noqa: SIM115
    sys.stdout = open(1, "w", encoding="utf-8", closefd=False)  # noqa: SIM115
    sys.stderr = open(2, "w", encoding="utf-8", closefd=False)  # noqa: SIM115
    sys.argv = ["diffbotctl", *request.words]
    code = 70
    try:
        main()
    except SystemExit as end:
        code = end.code if isinstance(end.code, int) else 0
    except BaseException:
        traceback.print_exc()
    finally:
        for stream in (sys.stdout, sys.stderr):
            stream.flush()
        os._exit(code)


if __name__ == "__main__":
    _serve()
