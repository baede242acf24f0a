"""A real run with its control socket in a folder of its own, and plain sockets to speak to it."""

import json
import os
import re
import socket
import subprocess
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from tests.support.command_process import command_line, start_in_pipe
from tests.support.confined import run_command

OPEN_FIELD = ["--set", "world.walls=[]"]
LIVE_LINE = re.compile(r" *\d+\.\d\d s ")  # begins with the run's time
LONGEST_WAIT = 60  # s that a test waits for a state of the run
REPLY_TIMEOUT_S = 60  # s that a test waits for what must come; it fails by itself afterwards


def command(folder: Path, *words: object) -> tuple[list[str], dict[str, str]]:
    """How to start `diffbotctl words` with its sockets in `folder`."""
    environment = {"DIFFBOTCTL_RUN": str(folder), **os.environ, "XDG_RUNTIME_DIR": str(folder)}
    return command_line(*words), environment


def cli(folder: Path, *words: str | Path, cwd: Path | None = None) -> tuple[int, str, str]:
    """Run `diffbotctl words` to its end: (exit code, what it printed, complaints)."""
    _, environment = command(folder)
    done = run_command(*words, folder=cwd, environment=environment)
    return done.code, done.printed, done.complaints


@contextmanager
def running(
    folder: Path,
    *words: object,
    name: str = "test",
    prefix: Sequence[str] = (),
    sets: Sequence[str] = OPEN_FIELD,
) -> Iterator[subprocess.Popen[str]]:
    """`diffbotctl run words` as a process of the command `prefix`, once its socket answers."""
    line, environment = command(folder, "run", *words, *sets, "--name", name)
    process = start_in_pipe([*prefix, *line], env=environment)
    try:
        assert process.stdout is not None
        for printed in process.stdout:
            if LIVE_LINE.match(printed):  # the first one after the headline: the socket is there
                break
        yield process
    finally:
        process.kill()
        process.communicate()


class PlainClient:
    """A client as any language would write it: a socket and lines of JSON."""

    def __init__(
        self, folder: Path, name: str = "test", hello: str = '{"hello": 2, "name": "plain"}'
    ) -> None:
        self.socket = socket.socket(socket.AF_UNIX)
        self.socket.connect(str(folder / "diffbotctl" / f"{name}.socket"))
        self.socket.settimeout(REPLY_TIMEOUT_S)
        self.lines = self.socket.makefile("rb")
        self.greeting = self.read()
        if hello:
            self.send(hello)

    def send(self, text: str | bytes) -> None:
        self.socket.sendall(text if isinstance(text, bytes) else text.encode() + b"\n")

    def read(self) -> Any:
        line = self.lines.readline()
        return json.loads(line) if line else None

    def request(self, method: str, **fields: object) -> Any:
        """The reply to one request; streamed lines before it are dropped."""
        self.send(json.dumps({"id": method, "method": method, **fields}))
        while (reply := self.read()) is not None:
            if reply.get("id") == method:
                return reply
        return None

    def until(self, seen: Callable[[dict[str, Any]], object]) -> dict[str, Any]:
        """Ask for the status again and again until `seen(status)`; fails after a minute."""
        deadline = time.monotonic() + LONGEST_WAIT
        while True:
            status: dict[str, Any] | None = self.request("status")
            assert status is not None, "the run has ended"
            if seen(status):
                return status
            assert time.monotonic() < deadline, f"it never came; the status is {status}"

    def close(self) -> None:
        self.lines.close()
        self.socket.close()


def moves(status: dict[str, Any]) -> bool:
    wheels = status["gate.wheels"]
    return wheels is not None and (wheels["left"] != 0 or wheels["right"] != 0)


def stands(status: dict[str, Any]) -> bool:
    return not moves(status)


def release(folder: Path, name: str = "test") -> None:
    """Resume what a busy machine has stopped in the test before, of the same engine."""
    client = PlainClient(folder, name)
    if client.request("status")["held"]:
        client.request("resume")
        client.until(lambda status: not status["held"])
    client.close()
