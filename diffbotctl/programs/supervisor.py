"""Supervisor process: starts the programs of a pipeline, and starts them again when they end.

It is a child of the engine, so that neither a slow start nor a lost process delays the engine. For
each start it makes a socket pair: one end is the program's standard input and output, the other one
goes to the engine. When the engine ends, however it does, the programs are ended too.
"""

from __future__ import annotations

import ctypes
import os
import pickle
import select
import signal
import socket
import subprocess
import time
from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path
from typing import Any, NamedTuple

from diffbotctl.config.configuration import ProgramUse
from diffbotctl.control_socket.address import SOCKET_VARIABLE
from diffbotctl.processes.child_process import close_inherited_files, fork

BACK_OFF_S = (0.5, 1.0, 2.0, 4.0, 8.0, 16.0, 30.0)  # before each start again
HEALTHY_S = 30.0  # after this the back-off begins again
TERM_TIMEOUT_S = 0.5  # from SIGTERM to SIGKILL at the end of the run
STDERR_LINES_PER_SECOND = 20
STDERR_LINE_BYTES = 300
RECORD_MAX_BYTES = 1 << 12
PR_SET_PDEATHSIG = 1  # prctl(2)
PR_SET_CHILD_SUBREAPER = 36
SWEEPS_MAX = 100  # each kills all that is left; what is killed can have started another one
LIBC = ctypes.CDLL(None)


class Order(NamedTuple):
    """From the engine: start a program, or kill it and start it again later."""

    kind: str  # start, kill
    program: str


class Event(NamedTuple):
    """From the supervisor: `started` (with the socket), `ended`, `failed` or `line` of stderr.

    `text` is how it ended, why it cannot be started, or the line.
    """

    kind: str
    program: str
    pid: int = 0
    text: str = ""


def start_supervisor(
    programs: Sequence[ProgramUse], control_socket: Path | None
) -> tuple[socket.socket, int]:
    """Fork the supervisor. Returns the engine's end of its channel and the pid.

    `control_socket` is that of the engine, whose path the programs get as SOCKET_VARIABLE.
    """
    ours, theirs = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)

    def run() -> int:
        close_inherited_files({theirs.fileno()}, 0)
        os.environ[SOCKET_VARIABLE] = "" if control_socket is None else str(control_socket)
        return _Supervisor(theirs, programs).run()

    pid = fork(run)
    theirs.close()
    return ours, pid


class _Child:
    """One program: its process, when it may start, and the rest of its standard error."""

    def __init__(self, use: ProgramUse) -> None:
        self.use = use
        self.process: subprocess.Popen[bytes] | None = None
        self.pid_file = -1
        self.errors = -1  # the end of its standard error
        self.rest = b""
        self.last_line = ""
        self.lines_from = 0.0
        self.lines = 0
        self.started = 0.0
        self.start_at: float | None = None
        self.failures = 0


class _Supervisor:
    def __init__(self, channel: socket.socket, programs: Sequence[ProgramUse]) -> None:
        self.channel = channel
        self.children = {use.name: _Child(use) for use in programs}

    def run(self) -> int:
        """Supervise until the engine closes its end of the channel."""
        # What a program starts in a session of its own becomes a child of this process when the
        # program ends, and can be ended too.
        LIBC.prctl(PR_SET_CHILD_SUBREAPER, 1)
        is_open = True
        while is_open:
            ready = self._wait()
            if self.channel.fileno() in ready:
                is_open = self._read_order()
            for child in self.children.values():
                if child.errors in ready:
                    self._read_errors(child)
                if child.process is not None and child.pid_file in ready:
                    self._end(child)
                if child.start_at is not None and time.monotonic() >= child.start_at:
                    self._start(child)
        self._end_all()
        return 0

    def _wait(self) -> set[int]:
        files = [self.channel.fileno()]
        starts = [child.start_at for child in self.children.values() if child.start_at is not None]
        for child in self.children.values():
            files += [file for file in (child.pid_file, child.errors) if file >= 0]
        timeout = None if not starts else max(min(starts) - time.monotonic(), 0.0)
        return set(select.select(files, [], [], timeout)[0])

    def _read_order(self) -> bool:
        try:
            data = self.channel.recv(RECORD_MAX_BYTES)
        except OSError:
            return False
        if not data:
            return False
        order = Order(*pickle.loads(data))
        child = self.children[order.program]
        if order.kind == "start":
            child.start_at = time.monotonic()
        elif child.process is not None:
            self._kill(child, signal.SIGKILL)
        return True

    def _start(self, child: _Child) -> None:
        child.start_at = None
        child.started = time.monotonic()
        child.last_line, child.rest = "", b""
        ours, theirs = socket.socketpair()
        errors, errors_end = os.pipe2(os.O_CLOEXEC | os.O_NONBLOCK)
        try:
            child.process = subprocess.Popen(
                child.use.words,
                cwd=child.use.folder,
                stdin=theirs.fileno(),
                stdout=theirs.fileno(),
                stderr=errors_end,
                start_new_session=True,
                preexec_fn=_become_a_program,
            )
        except (OSError, subprocess.SubprocessError) as error:
            os.close(errors)
            cause = getattr(error, "strerror", None) or str(error)
            self._send(Event("failed", child.use.name, 0, f"it cannot be started: {cause}"))
            self._back_off(child)
        else:
            child.pid_file = os.pidfd_open(child.process.pid)
            child.errors = errors
            event = Event("started", child.use.name, child.process.pid)
            with suppress(OSError):
                socket.send_fds(self.channel, [pickle.dumps(tuple(event))], [ours.fileno()])
        finally:
            os.close(errors_end)
            ours.close()
            theirs.close()

    def _end(self, child: _Child) -> None:
        """Report that a program has ended, and start it again later."""
        assert child.process is not None
        self._read_errors(child)
        pid, code = child.process.pid, child.process.wait()
        self._kill(child, signal.SIGKILL)  # what it has started itself
        text = exit_text(code)
        if child.last_line:
            text += f": {child.last_line}"
        self._forget(child)
        self._reap()
        self._send(Event("ended", child.use.name, pid, text))
        self._back_off(child)

    def _forget(self, child: _Child) -> None:
        for file in (child.pid_file, child.errors):
            if file >= 0:
                os.close(file)
        child.process, child.pid_file, child.errors = None, -1, -1

    def _back_off(self, child: _Child) -> None:
        now = time.monotonic()
        if now - child.started > HEALTHY_S:
            child.failures = 0
        child.start_at = now + BACK_OFF_S[min(child.failures, len(BACK_OFF_S) - 1)]
        child.failures += 1

    def _read_errors(self, child: _Child) -> None:
        """Pass on what the program writes to its standard error, a limited number of lines."""
        try:
            data = os.read(child.errors, 1 << 14)
        except OSError:
            return
        if not data:  # closed while the program runs on
            os.close(child.errors)
            child.errors = -1
        *lines, child.rest = (child.rest + data).split(b"\n")
        child.rest = child.rest[:STDERR_LINE_BYTES]
        now = time.monotonic()
        if now - child.lines_from > 1.0:
            child.lines_from, child.lines = now, 0
        for line in lines:
            text = line[:STDERR_LINE_BYTES].decode(errors="replace").strip()
            if not text:
                continue
            child.last_line = text
            child.lines += 1
            if child.lines <= STDERR_LINES_PER_SECOND:
                self._send(Event("line", child.use.name, 0, text), socket.MSG_DONTWAIT)

    def _send(self, event: Event, flags: int = 0) -> None:
        with suppress(OSError):  # the engine has ended, or lines are too many
            self.channel.send(pickle.dumps(tuple(event)), flags)

    def _kill(self, child: _Child, number: int) -> None:
        """Send a signal to the program and to what it has started."""
        if child.process is not None:
            with suppress(ProcessLookupError, PermissionError):
                os.killpg(child.process.pid, number)

    def _end_all(self) -> None:
        """End all programs: SIGTERM, and SIGKILL to those that do not end."""
        for child in self.children.values():
            self._kill(child, signal.SIGTERM)
        deadline = time.monotonic() + TERM_TIMEOUT_S
        for child in self.children.values():
            if child.process is None:
                continue
            with suppress(subprocess.TimeoutExpired):
                child.process.wait(max(deadline - time.monotonic(), 0.01))
            self._kill(child, signal.SIGKILL)
            child.process.wait()
        for _ in range(SWEEPS_MAX):
            if not (left := _children()):
                break
            for pid in left:
                with suppress(ProcessLookupError, PermissionError):
                    os.kill(pid, signal.SIGKILL)
                with suppress(ChildProcessError):
                    os.waitpid(pid, 0)

    def _reap(self) -> None:
        """Collect what ended after the program that had started it."""
        programs = {child.process.pid for child in self.children.values() if child.process}
        for pid in _children():
            if pid not in programs:
                with suppress(ChildProcessError):
                    os.waitpid(pid, os.WNOHANG)


def _children() -> list[int]:
    """The processes whose parent is this one."""
    pid = os.getpid()
    return [int(child) for child in Path(f"/proc/{pid}/task/{pid}/children").read_text().split()]


def exit_text(code: int) -> str:
    """How a process ended, from its exit code, or minus the signal that ended it."""
    return f"was ended by {signal.Signals(-code).name}" if code < 0 else f"ended with code {code}"


def end_of(pid: int) -> str:
    """How a process ended that the supervisor may not have waited for yet; empty if it runs."""
    try:
        fields = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()
    except (FileNotFoundError, ProcessLookupError):
        return "has ended"
    return exit_text(os.waitstatus_to_exitcode(int(fields[-1]))) if fields[0] == "Z" else ""


def _become_a_program() -> None:
    """Default signals again, and an end with the supervisor even if that is killed."""
    for number in (signal.SIGINT, signal.SIGQUIT, signal.SIGTERM, signal.SIGHUP):
        signal.signal(number, signal.SIG_DFL)
    LIBC.prctl(PR_SET_PDEATHSIG, signal.SIGKILL)


def read_events(channel: socket.socket) -> tuple[list[tuple[Event, int]], bool]:
    """The events that have come, each with a socket's file or -1, and whether more can come."""
    events: list[tuple[Event, int]] = []
    while True:
        try:
            data, files, _, _ = socket.recv_fds(channel, RECORD_MAX_BYTES, 1, socket.MSG_DONTWAIT)
        except BlockingIOError:
            return events, True
        except OSError:
            return events, False
        if not data:
            return events, False
        record: Any = pickle.loads(data)
        events.append((Event(*record), files[0] if files else -1))
