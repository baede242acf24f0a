"""A person who drives through a terminal and is lost: killed, frozen, cut off, behind ssh."""

import re
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from diffbotctl.recording.reader import RecordingReader
from diffbotctl.time import NEVER
from tests.support.running import PlainClient, command, moves
from tests.support.terminal import SCREEN_TIMEOUT_S, Terminal

SSH = [
    "-o",
    "StrictHostKeyChecking=no",
    "-o",
    "UserKnownHostsFile=/dev/null",
    "-o",
    "LogLevel=ERROR",
]
REPEAT = 0.03  # s between two repeats of a key that is held


@contextmanager
def ssh_server(folder: Path, *words: object) -> Iterator[list[str]]:
    """An ssh server that gives `diffbotctl words` to whoever connects: the client's command."""
    line, environment = command(folder, *words)
    place = folder / "port"
    server = subprocess.Popen(
        [sys.executable, "-m", "tests.support.ssh_server", str(place), *line], env=environment
    )
    try:
        deadline = time.monotonic() + SCREEN_TIMEOUT_S
        while not place.exists():
            assert server.poll() is None and time.monotonic() < deadline, "no ssh server"
        yield ["ssh", "-tt", *SSH, "-p", place.read_text(), "127.0.0.1"]
    finally:
        server.kill()
        server.wait()


def drive(terminal: Terminal, watcher: PlainClient, mode: str) -> None:
    """Hold or press the key for forward until the robot drives."""
    if mode == "latched":
        terminal.until(lambda text: re.search(r"terminal +\d+ ms", text), "the first answer")
        if "no latched mode" in terminal.text:  # that answer was late on a busy machine
            terminal.type("b")
        terminal.type("i")
        terminal.until(lambda text: "DRIVING" in text, "driving")
    status = watcher.request("status")
    while not (moves(status) and status["operator.goal"]["number"] == 0):
        if mode == "hold":
            terminal.type("i")
        terminal.look(REPEAT)
        status = watcher.request("status")


def lose(terminal: Terminal, how: str) -> None:
    """Lose the person; the logical time is that of the last word before."""
    if how == "SIGKILL":
        terminal.process.kill()
    elif how == "SIGSTOP":
        terminal.process.send_signal(signal.SIGSTOP)
    elif how == "closed":
        terminal.hang_up()


def last_command_and_motion(path: Path, end: int = NEVER) -> tuple[int, int]:
    """Times until `end` of the last command of an operator, and of the last one to turn a wheel."""
    commands, motions = [0], [0]
    for item in RecordingReader(path).messages():
        if item.time <= end and item.wire == "operator.twist":
            commands.append(item.time)
        elif item.time <= end and item.wire == "gate.wheels" and any(tuple(item.message)[1:]):
            motions.append(item.time)
    return max(commands), max(motions)
