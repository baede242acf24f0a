"""`diffbotctl` as a process, as a user starts it: with its output in a pipe, or on a terminal."""

from __future__ import annotations

import ctypes
import os
import signal
import subprocess
import sys
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

MAIN = "from diffbotctl.cli.main import main; main()"
PR_SET_PDEATHSIG = 1  # prctl(2)
ROOT = Path(__file__).resolve().parents[2]


def command_line(*words: object) -> list[str]:
    """How this Python starts `diffbotctl words`."""
    return [sys.executable, "-c", MAIN, *map(str, words)]


def command_line_with_block(name: str, place: str, *words: object) -> list[str]:
    """The same with a further block `name`: the class at `place` (module:Class), which may be in
    `tests`."""
    offer = f"import sys\nsys.path.append({str(ROOT)!r})\n"
    offer += f"from diffbotctl.config import registry\nregistry.BLOCKS['{name}'] = '{place}'\n"
    return [sys.executable, "-c", offer + MAIN, *map(str, words)]


def start_in_pipe(line: Sequence[str], **options: Any) -> subprocess.Popen[str]:
    """Start a command line; both its outputs are one pipe of text."""
    return subprocess.Popen(
        line, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, **options
    )


def start_on_terminal(
    line: Sequence[str], slave: int, environment: Mapping[str, str] | None = None
) -> subprocess.Popen[str]:
    """Start a command line whose controlling terminal is the pseudo-terminal `slave`."""
    return subprocess.Popen(
        ["setsid", "--ctty", *line],
        env=environment,
        stdin=slave,
        stdout=slave,
        stderr=slave,
        text=True,
    )


def end_with_parent() -> None:
    """Let the kernel kill this process when its parent ends, also by SIGKILL."""
    ctypes.CDLL(None).prctl(PR_SET_PDEATHSIG, signal.SIGKILL)


def processor_s(pid: int) -> float:
    """Processor time that a process has used, without its children (s); 0 when it has ended."""
    try:
        text = Path(f"/proc/{pid}/stat").read_text()
    except (FileNotFoundError, ProcessLookupError):
        return 0.0
    fields = text.rpartition(")")[2].split()
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")


def children_of(pid: int) -> list[int]:
    """Process numbers of the children of a process; none of one that has ended."""
    try:
        text = Path(f"/proc/{pid}/task/{pid}/children").read_text()
    except (FileNotFoundError, ProcessLookupError):
        return []
    return [int(word) for word in text.split()]
