"""Commands of diffbotctl in confined processes, with what they print, cost and return.

A server process imports the package once and forks for each command, so that a command takes
milliseconds and its memory is that of the command, not that of the test.
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
from collections.abc import Sequence
from importlib import import_module
from pathlib import Path
from typing import NamedTuple

from diffbotctl.cli.main import main
from diffbotctl.printable import CONTROL

MEMORY_MAX_BYTES = 2 << 30  # of addresses; protects the machine, the figure is `peak_bytes`
CPU_MAX_S = 20
TIMEOUT_S = 60
OUTPUT_MAX_BYTES = 1 << 20
PRELOADED = ("cli.bag", "cli.check", "cli.replay", "cli.run", "cli.calibrate", "cli.blocks")


class ConfinedOutcome(NamedTuple):
    """What became of one command. `code` is negative for a signal that killed it."""

    words: tuple[str, ...]
    code: int
    output: str
    cpu_s: float
    peak_bytes: int

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


class ConfinedCommands:
    """Runs commands in `folder`, one after the other. A context manager."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        environment = {**os.environ, "XDG_STATE_HOME": str(folder), "NO_COLOR": "1"}
        environment["XDG_RUNTIME_DIR"] = str(folder)
        environment["PYTHONPATH"] = str(Path(__file__).resolve().parents[2])  # of this module
        self.process = subprocess.Popen(
            [sys.executable, "-m", __name__],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            cwd=folder,
            env=environment,
            text=True,
        )

    def __enter__(self) -> ConfinedCommands:
        return self

    def __exit__(self, *error: object) -> None:
        assert self.process.stdin is not None
        self.process.stdin.close()
        self.process.wait()

    def run(self, *words: str | Path) -> ConfinedOutcome:
        """Run `diffbotctl words` to its end."""
        assert self.process.stdin is not None and self.process.stdout is not None
        arguments = tuple(map(str, words))
        self.process.stdin.write(json.dumps(arguments) + "\n")
        self.process.stdin.flush()
        record = json.loads(self.process.stdout.readline())
        return ConfinedOutcome(arguments, *record)


def _serve() -> None:
    for name in PRELOADED:
        import_module(f"diffbotctl.{name}")
    for name in ("yaml", "mcap.stream_reader", "zstandard", "numpy"):
        import_module(name)
    for line in sys.stdin:
        print(json.dumps(_run(json.loads(line))), flush=True)


def _run(words: Sequence[str]) -> tuple[int, str, float, int]:
    with tempfile.TemporaryFile() as output:
        pid = os.fork()
        if not pid:
            _become_command(words, output.fileno())
        deadline = time.monotonic() + TIMEOUT_S
        while True:
            ended, status, usage = os.wait4(pid, os.WNOHANG)
            if ended:
                break
            if time.monotonic() > deadline:
                os.kill(pid, signal.SIGKILL)
            time.sleep(0.001)
        code = os.waitstatus_to_exitcode(status)
        output.seek(0)
        text = output.read(OUTPUT_MAX_BYTES).decode("utf-8", "replace")
        return code, text, usage.ru_utime + usage.ru_stime, usage.ru_maxrss * 1024


def _become_command(words: Sequence[str], output: int) -> None:
    null = os.open(os.devnull, os.O_RDONLY)
    os.dup2(null, 0)
    os.dup2(output, 1)
    os.dup2(output, 2)
    resource.setrlimit(resource.RLIMIT_AS, (MEMORY_MAX_BYTES, MEMORY_MAX_BYTES))
    resource.setrlimit(resource.RLIMIT_CPU, (CPU_MAX_S, CPU_MAX_S))
    sys.stdin = open(0, encoding="utf-8", closefd=False)  # noqa: SIM115
    sys.stdout = open(1, "w", encoding="utf-8", closefd=False)  # noqa: SIM115
    sys.stderr = open(2, "w", encoding="utf-8", closefd=False)  # noqa: SIM115
    sys.argv = ["diffbotctl", *words]
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
