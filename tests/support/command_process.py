"""`diffbotctl` as a process, as a user starts it: with its output in a pipe, or on a terminal."""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from tests.support.forked_command import FORKED_OPTIONS, ForkedCommand

MAIN = "from diffbotctl.cli.main import main; main()"
ROOT = Path(__file__).resolve().parents[2]
READ_AT_START = ("LANG", "LC_ALL", "LC_CTYPE", "PYTHONIOENCODING", "PYTHONUTF8", "PYTHONHASHSEED")


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
    options |= {"stdout": subprocess.PIPE, "stderr": subprocess.STDOUT}
    if _can_be_forked(line, options.get("env")) and options.keys() <= FORKED_OPTIONS:
        return ForkedCommand(line[3:], **options)
    return subprocess.Popen(line, text=True, **options)


def start_on_terminal(
    line: Sequence[str], slave: int, environment: Mapping[str, str] | None = None
) -> subprocess.Popen[str]:
    """Start a command line whose controlling terminal is the pseudo-terminal `slave`."""
    if _can_be_forked(line, environment):
        streams = dict.fromkeys(("stdin", "stdout", "stderr"), slave)
        options: dict[str, Any] = {**streams, "env": environment}
        return ForkedCommand(line[3:], has_terminal=True, **options)
    return subprocess.Popen(
        ["setsid", "--ctty", *line],
        env=environment,
        stdin=slave,
        stdout=slave,
        stderr=slave,
        text=True,
    )


def _can_be_forked(line: Sequence[str], environment: Mapping[str, str] | None) -> bool:
    """Whether it is a command of diffbotctl, and for an interpreter started like this one."""
    theirs = os.environ if environment is None else environment
    is_alike = all(theirs.get(name) == os.environ.get(name) for name in READ_AT_START)
    return is_alike and list(line[:3]) == command_line()


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
