"""Connections to an engine on another computer, through ssh.

ssh runs a few lines of Python there, without any package, that find the engine's socket and pass
bytes between it and their standard input and output. So anyone who may log in there as the user of
the engine may use its socket, and nothing listens on the network. When ssh ends, however it does,
the engine sees a client that has disconnected; when the link is cut it receives nothing, and its
own timeouts stop the robot.
"""

from __future__ import annotations

import re
import shlex
import socket
import subprocess
import time
from contextlib import suppress
from getpass import getuser
from typing import Any

from diffbotctl.control_socket.protocol import DRIVE_LEASE_S
from diffbotctl.errors import Problem, RunError, UsageError

# A first character other than `-`: ssh takes what begins so for an option.
HOST = re.compile(r"[A-Za-z0-9_\[][A-Za-z0-9_.@:%\[\]-]*")
SSH_OPTIONS = (
    "-T",
    "-oBatchMode=yes",  # without a terminal it cannot ask
    "-oClearAllForwardings=yes",
    "-oConnectTimeout=5",
    "-oServerAliveInterval=1",  # s; a link that is cut is noticed after three
    "-oServerAliveCountMax=3",
)
END_TIMEOUT_S = 0.5
FAILURE_TIMEOUT_S = 0.2  # for ssh to end when its connection has
ERROR_MAX_BYTES = 4096

BRIDGE = r"""
import glob, json, os, select, socket, sys
def sockets():
    own = os.environ.get("XDG_RUNTIME_DIR", "")
    own = own if os.path.isabs(own) else ""
    # Without a login session ssh does not set it, but the engine may have been started in one.
    folders = [own or "/run/user/%d" % os.getuid()]
    folders = [folder + "/diffbotctl" for folder in folders]
    folders += [] if own else ["/tmp/diffbotctl-%d" % os.getuid()]
    run = os.environ.get("DIFFBOTCTL_RUN", "/run")
    for folder in [*folders, *glob.glob(run + "/diffbotctl-*")]:
        yield from sorted(glob.glob(folder + "/*.socket"))
found, chosen = {}, sys.argv[1]
for path in sockets():
    name, end = os.path.basename(path)[:-7], socket.socket(socket.AF_UNIX)
    try:
        end.connect(path)
    except OSError:
        continue
    if not chosen or name == chosen:
        found.setdefault(name, end)
if len(found) != 1:
    code = "E-SEVERAL-ENGINES" if found else "E-NO-ENGINE"
    print(json.dumps({"ok": False, "error": code, "engines": list(found)}), flush=True)
    sys.exit(1)
end = list(found.values())[0]
for other in found.values():
    if other is not end:
        other.close()
while True:
    for ready in select.select([0, end], [], [])[0]:
        data = os.read(0, 65536) if ready == 0 else end.recv(65536)
        if not data:
            sys.exit(0)
        if ready == 0:
            end.sendall(data)
        else:
            view = memoryview(data)
            while view:
                view = view[os.write(1, view):]
"""


def check_host(at: str) -> None:
    """Raise UsageError for a text that names no computer."""
    if not HOST.fullmatch(at):
        raise UsageError(Problem("E-SSH", "--at", f"'{at}' is no host", "write user@host"))


class SshConnection:
    """An ssh process whose standard input and output is `socket`, at our end."""

    def __init__(self, at: str, engine: str) -> None:
        """Start ssh; whether it gets through is seen by what comes. Raises UserError."""
        check_host(at)
        self.at = at
        self.socket, theirs = socket.socketpair()
        command = f"exec python3 -c {shlex.quote(BRIDGE)} {shlex.quote(engine)}"
        try:
            self.process = subprocess.Popen(
                ["ssh", *SSH_OPTIONS, "--", at, command],
                stdin=theirs.fileno(),
                stdout=theirs.fileno(),
                stderr=subprocess.PIPE,
                start_new_session=True,  # Ctrl-C must not end it before the last command is sent
            )
        except OSError as error:
            self.socket.close()
            cause, fix = f"ssh cannot be started: {error.strerror}", "install openssh-client"
            raise RunError(Problem("E-SSH", at, cause, fix)) from error
        finally:
            theirs.close()

    def failure(self, cause: str) -> RunError:
        """The error when nothing comes: the message of ssh, or else `cause`."""
        with suppress(subprocess.TimeoutExpired):
            self.process.wait(FAILURE_TIMEOUT_S)
        code = self.process.poll()
        self.process.kill()  # nothing more gets through
        fix = "if the robot moves, switch it off; "
        if code == 255 and self.process.stderr is not None:
            lines = self.process.stderr.read(ERROR_MAX_BYTES).decode(errors="replace").split("\n")
            errors = [line.strip() for line in lines if line.strip()]
            cause = errors[-1][:200] if errors else "ssh did not get through"
            fix += f"`ssh {self.at} true` must work without a question: use a key"
        else:
            fix += f"`ssh {self.at} true` shows whether ssh works"
        return RunError(Problem("E-SSH", self.at, f"the engine cannot be reached: {cause}", fix))

    def close(self) -> None:
        """End ssh; what was sent before still gets through if the link works."""
        self.socket.close()
        try:
            self.process.wait(END_TIMEOUT_S)
        except subprocess.TimeoutExpired:
            self.process.kill()
            self.process.wait()
        if self.process.stderr is not None:
            self.process.stderr.close()


def person() -> str:
    """The user of this program here, as the engine's log names a far client."""
    try:
        user = getuser()
    except (KeyError, OSError):
        user = "somebody"
    return f"{user}@{socket.gethostname()}"


class EngineTime:
    """The engine's logical time, as a client estimates it: never later than it is.

    A time that comes in a line was true before the line was sent. The largest difference to our
    clock is that of the line with the shortest delay.
    """

    def __init__(self) -> None:
        self.offset: int | None = None  # ns

    def note(self, fields: dict[str, Any]) -> None:
        message = fields.get("message", fields)
        stamp = message.get("time") if isinstance(message, dict) else None
        if isinstance(stamp, int) and stamp > 0:
            offset = stamp - time.monotonic_ns()
            self.offset = offset if self.offset is None else max(self.offset, offset)

    def lease(self) -> dict[str, float]:
        """The fields `time` and `lease` of a command to drive; none before any time has come."""
        if self.offset is None:
            return {}
        now = max(time.monotonic_ns() + self.offset, 0)
        return {"time": float(now), "lease": DRIVE_LEASE_S}


class SeveralEnginesError(UsageError):
    """More than one engine is running there; `engines` are their names."""

    def __init__(self, at: str, engines: list[str]) -> None:
        cause = f"several engines are running there: {', '.join(engines)}"
        super().__init__(Problem("E-SEVERAL-ENGINES", at, cause, f"give --engine {engines[0]}"))
        self.engines = engines


def no_engine(at: str, name: str, reply: dict[str, Any]) -> UsageError:
    """The error when there is no engine there, or more than one."""
    names = [str(engine) for engine in reply.get("engines", [])]
    if names:
        return SeveralEnginesError(at, names)
    cause = f"no engine called '{name}' is running there" if name else "no engine runs there"
    fix = "start one there as the user with whom you log in"
    return UsageError(Problem("E-NO-ENGINE", at, cause, fix))
