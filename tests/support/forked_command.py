"""Commands of diffbotctl as processes that need not import it.

A server process imports the package once and forks for each command, which then starts in
milliseconds instead of a third of a second. The command is a child of the process that asks for it.
"""

from __future__ import annotations

import ctypes
import gc
import json
import os
import pkgutil
import resource
import signal
import socket
import subprocess
import sys
import threading
import time
import traceback
from collections.abc import Iterator, Mapping, Sequence
from contextlib import suppress
from fcntl import ioctl
from functools import cache
from importlib import import_module
from pathlib import Path
from termios import TIOCSCTTY
from typing import Any, NamedTuple, NoReturn

import diffbotctl
from diffbotctl.cli.main import main

ROOT = Path(__file__).resolve().parents[2]
PR_SET_PDEATHSIG, PR_SET_CHILD_SUBREAPER = 1, 36  # prctl(2)
REQUEST_MAX_BYTES = 1 << 18
FORKED_OPTIONS = {"stdin", "stdout", "stderr", "env", "cwd"}
# Run as scripts, or with another Python.
NOT_PRELOADED = ("diffbotctl.__main__", "diffbotctl.ros2")


class Request(NamedTuple):
    """One command to fork for; its standard streams are sent beside it."""

    words: Sequence[str]
    folder: str
    environment: dict[str, str]
    has_terminal: bool
    """the standard input becomes the controlling terminal of a session of its own"""
    limits: Sequence[tuple[int, int]]
    """resources of setrlimit(2) with their limits"""


class ForkServer:
    """Forks commands; it ends with the process that made it."""

    def __init__(self, modules: Sequence[str] = ()) -> None:
        """`modules` are imported before; none: all of the package."""
        ours, theirs = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
        self._socket, self._lock = ours, threading.Lock()
        self._process = subprocess.Popen(
            [sys.executable, "-m", __name__, str(theirs.fileno()), *modules],
            pass_fds=[theirs.fileno()],
            env={**os.environ, "PYTHONPATH": str(ROOT)},
            cwd=ROOT,
        )
        theirs.close()

    def fork(self, request: Request, files: Sequence[int]) -> int:
        """Fork a command with these standard streams; the number of the process, our child."""
        data = json.dumps(request).encode()
        assert len(data) <= REQUEST_MAX_BYTES
        prctl = ctypes.CDLL(None).prctl
        with self._lock:
            prctl(PR_SET_CHILD_SUBREAPER, 1)
            try:
                socket.send_fds(self._socket, [data], files)
                return int(self._socket.recv(20))
            finally:
                prctl(PR_SET_CHILD_SUBREAPER, 0)

    def close(self) -> None:
        """End the server; its commands go on."""
        self._socket.close()
        self._process.wait()


@cache
def fork_server() -> ForkServer:
    """The one of this process."""
    return ForkServer()


class ForkedCommand(subprocess.Popen[str]):
    """`diffbotctl words` as Popen starts it, but forked. Of Popen's options it has those for the
    standard streams, `env` and `cwd`."""

    def __init__(
        self,
        words: Sequence[str],
        *,
        server: ForkServer | None = None,
        has_terminal: bool = False,
        limits: Sequence[tuple[int, int]] = (),
        **options: Any,
    ) -> None:
        """`has_terminal` and `limits` as in Request."""
        assert options.keys() <= FORKED_OPTIONS, options
        self._server = server or fork_server()
        self._has_terminal, self._limits = has_terminal, limits
        super().__init__(words, text=True, **options)

    def _execute_child(
        self,
        args: Sequence[str],
        _executable: None,
        _preexec_fn: None,
        _close_fds: bool,
        _pass_fds: tuple[int, ...],
        cwd: str | Path | None,
        env: Mapping[str, str] | None,
        _startupinfo: None,
        _creationflags: int,
        _shell: bool,
        *pipes_and_rest: int,
    ) -> None:
        """Popen's own method would execute a program."""
        pipes = pipes_and_rest[:6]  # each pair: read and write end, or -1
        streams = zip((pipes[0], pipes[3], pipes[5]), range(3), strict=True)
        variables = dict(os.environ if env is None else env)
        request = Request(
            args, os.path.abspath(cwd or "."), variables, self._has_terminal, self._limits
        )
        self.pid = self._server.fork(request, [own if own >= 0 else ours for own, ours in streams])
        self._child_created = True
        self._close_pipe_fds(*pipes)  # type: ignore[attr-defined]


def _serve(requests: socket.socket, modules: Sequence[str]) -> None:
    for name in modules or _all_modules():
        import_module(name)
    gc.freeze()  # what is never collected is shared by all commands
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # is for the commands of a terminal
    while True:
        data, files, _, _ = socket.recv_fds(requests, REQUEST_MAX_BYTES, 3)
        if not data:
            return
        number, written = os.pipe()
        between = os.fork()
        if not between:
            between = os.getpid()
            if not (pid := os.fork()):
                _become_command(Request(*json.loads(data)), files, between)
            os.write(written, str(pid).encode())
            os._exit(0)
        os.waitpid(between, 0)  # the command has its parent now
        requests.send(os.read(number, 20))
        files += [number, written]
        for file in files:
            os.close(file)


def _all_modules() -> Iterator[str]:
    for module in pkgutil.walk_packages(diffbotctl.__path__, "diffbotctl."):
        if not module.name.startswith(NOT_PRELOADED):
            yield module.name


def _become_command(request: Request, files: Sequence[int], between: int) -> NoReturn:
    while os.getppid() == between:  # the parent is soon the process that asks for the command
        time.sleep(0.0005)
    ctypes.CDLL(None).prctl(PR_SET_PDEATHSIG, signal.SIGKILL)
    signal.signal(signal.SIGINT, signal.default_int_handler)
    for number, file in enumerate(files):
        os.dup2(file, number)
    os.closerange(3, os.sysconf("SC_OPEN_MAX"))
    if request.has_terminal:
        os.setsid()
        ioctl(0, TIOCSCTTY, 0)
    os.environ.clear()
    os.environ.update(request.environment)
    places = os.environ.get("PYTHONPATH", "").split(os.pathsep)
    sys.path[:1] = ["", *(place for place in places if place not in ("", *sys.path))]
    os.chdir(request.folder)
    for resource_number, limit in request.limits:
        resource.setrlimit(resource_number, (limit, limit))
    sys.argv = ["diffbotctl", *request.words]
    # Each knows what kind of file it has since it was made.
    streams = {
        "stdin": open(0, encoding="utf-8", closefd=False),  # noqa: SIM115
        "stdout": open(1, "w", encoding="utf-8", closefd=False),  # noqa: SIM115
        "stderr": open(2, "w", 1, "utf-8", "backslashreplace", closefd=False),  # noqa: SIM115
    }
    for name, stream in streams.items():
        setattr(sys, name, stream)
        setattr(sys, f"__{name}__", stream)
    code = 1
    try:
        main()
        code = 0
    except SystemExit as end:
        code = end.code if isinstance(end.code, int) else int(end.code is not None)
    except BaseException:
        traceback.print_exc()
    finally:
        for output in (sys.stdout, sys.stderr):
            with suppress(OSError, ValueError):  # its reader is gone; the command closed it
                output.flush()
        os._exit(code)


if __name__ == "__main__":
    _serve(socket.socket(fileno=int(sys.argv[1])), sys.argv[2:])
