"""The files of an engine's control socket: where they are, and how the socket is made.

There is one folder a user, or one a group under /run. Beside NAME.socket there is NAME.engine with
the engine's process, so that `stop` can end it by a signal when the socket does not answer.
"""

from __future__ import annotations

import errno
import json
import os
import re
import socket
import stat
from collections.abc import Iterator
from contextlib import suppress
from grp import getgrnam
from itertools import count
from pathlib import Path
from typing import NamedTuple

from diffbotctl.errors import Problem, RunError

RUN_VARIABLE = "DIFFBOTCTL_RUN"  # where the folders of groups are, instead of /run
SOCKET_VARIABLE = "DIFFBOTCTL_SOCKET"  # of a program: the socket of the engine that started it
PREFIX = "diffbotctl"
NAME_MAX_LENGTH = 40  # characters; the whole path of a socket must fit in 107 bytes
NAME = re.compile(rf"[A-Za-z0-9_-]{{1,{NAME_MAX_LENGTH}}}")
SOCKET_PATH_MAX_BYTES = 107  # sun_path of sockaddr_un, unix(7), without its end
BACKLOG = 1024  # connections that may wait to be accepted


class Process(NamedTuple):
    """A process, distinguished from a later one of the same number by its start time in ticks."""

    pid: int
    started: int

    @property
    def is_alive(self) -> bool:
        """Whether this very process exists and is no zombie."""
        return start_time(self.pid) == self.started


class EngineAddress(NamedTuple):
    """A running engine as the file system shows it; on the computer `at` if that is not empty."""

    name: str
    socket: Path
    process: Process | None
    at: str = ""


def own_folder() -> Path:
    """The folder of this user's sockets: only the user may enter it."""
    runtime = os.environ.get("XDG_RUNTIME_DIR")
    if runtime and Path(runtime).is_absolute() and Path(runtime).is_dir():
        return Path(runtime) / PREFIX
    return Path("/tmp") / f"{PREFIX}-{os.getuid()}"


def group_folder(group: str) -> Path:
    """The folder of the sockets that the members of `group` may use."""
    return run_folder() / f"{PREFIX}-{group}"


def run_folder() -> Path:
    return Path(os.environ.get(RUN_VARIABLE, "/run"))


def start_time(pid: int) -> int | None:
    """When `pid` was started, in clock ticks since boot; None when it has ended or is a zombie."""
    try:
        text = Path(f"/proc/{pid}/stat").read_text()
    except OSError:
        return None
    fields = text.rpartition(")")[2].split()  # the name before it may hold anything
    return None if fields[0] in "ZX" else int(fields[19])


def engines() -> list[EngineAddress]:
    """Every engine that this user may access, and whose process or socket is alive."""
    folders = sorted(run_folder().glob(f"{PREFIX}-*"))
    shared = [path for path in folders if os.access(path, os.R_OK | os.X_OK)]
    addresses = (
        EngineAddress(path.stem, path, process_of(path))
        for folder in (own_folder(), *shared)
        for path in sorted(folder.glob("*.socket"))
    )
    return [
        address
        for address in addresses
        if (address.process.is_alive if address.process else answers(address.socket))
    ]


def answers(path: Path) -> bool:
    """Whether a process listens at the socket `path`; a stale socket refuses the connection."""
    with socket.socket(socket.AF_UNIX) as probe:
        probe.setblocking(False)
        try:
            probe.connect(str(path))
        except BlockingIOError:
            return True  # its queue is full: it is alive and busy
        except OSError:
            return False
    return True


def process_of(path: Path) -> Process | None:
    """The engine's process from the file beside the socket `path`."""
    try:
        record = json.loads(path.with_suffix(".engine").read_text())
        return Process(int(record["pid"]), int(record["started"]))
    except (OSError, ValueError, KeyError, TypeError):
        return None


def listen_on(name: str | None, fallback: str, group: str | None) -> tuple[socket.socket, Path]:
    """Listen as `name`; without a name as `fallback`, or `fallback-2` and so on where it is taken.

    Raises RunError when the name is taken or the folder cannot be made.
    """
    if name is not None and not NAME.fullmatch(name):
        cause = (
            f"'{name}' is not a valid name: use at most {NAME_MAX_LENGTH} letters, digits, - and _"
        )
        raise RunError(Problem("E-SOCKET", "--name", cause, "such as --name mower"))
    folder = own_folder() if group is None else group_folder(group)
    _check_length(folder, name or fallback)
    try:
        _make_folder(folder, group)
        for candidate in _names(fallback) if name is None else (name,):
            path = folder / f"{candidate}.socket"
            with suppress(_TakenError):
                return _listen(path, group), path
    except KeyError as error:
        fix = "name one of yours, which `groups` lists"
        problem = Problem("E-SOCKET", "--group", f"there is no group '{group}'", fix)
        raise RunError(problem) from error
    except OSError as error:
        cause = f"cannot make the control socket: {error.strerror}"
        fix = "correct the folder, or run with --no-socket"
        raise RunError(Problem("E-SOCKET", str(folder), cause, fix)) from error
    cause = f"an engine called '{name}' is already running"
    raise RunError(Problem("E-SOCKET", str(folder), cause, "give another --name"))


def _check_length(folder: Path, name: str) -> None:
    """Raises RunError when no socket called `name` fits below `folder`."""
    length = len(os.fsencode(folder / f"{name[:NAME_MAX_LENGTH]}-9.socket"))
    if length > SOCKET_PATH_MAX_BYTES:
        cause = (
            f"the path of the control socket has {length} bytes; at most "
            f"{SOCKET_PATH_MAX_BYTES} are possible"
        )
        fix = "set XDG_RUNTIME_DIR to a shorter folder, or run with --no-socket"
        raise RunError(Problem("E-SOCKET", str(folder), cause, fix))


def remove_socket(path: Path) -> None:
    for file in (path, path.with_suffix(".engine")):
        with suppress(OSError):
            file.unlink()


class _TakenError(Exception):
    """The name is in use."""


def _names(fallback: str) -> Iterator[str]:
    stem = re.sub(r"[^A-Za-z0-9_-]", "-", fallback)[:NAME_MAX_LENGTH] or "engine"
    yield stem
    yield from (f"{stem}-{number}" for number in count(2))


def _make_folder(folder: Path, group: str | None) -> None:
    folder.mkdir(mode=0o700, exist_ok=True)
    status = folder.lstat()
    if not stat.S_ISDIR(status.st_mode) or status.st_uid != os.getuid():
        raise PermissionError(1, "the folder belongs to another user")
    if group is None:
        folder.chmod(0o700)
    else:
        _share(folder, group, 0o750)


def _share(path: Path, group: str, mode: int) -> None:
    os.chown(path, -1, getgrnam(group).gr_gid)
    path.chmod(mode)


def _listen(path: Path, group: str | None) -> socket.socket:
    process = process_of(path)
    if answers(path) or (process is not None and process.is_alive):
        raise _TakenError
    remove_socket(path)
    listener = socket.socket(socket.AF_UNIX, socket.SOCK_STREAM | socket.SOCK_NONBLOCK)
    umask = os.umask(0o177)  # the file must never be open to others, not for a moment
    try:
        listener.bind(str(path))
        record = {"pid": os.getpid(), "started": start_time(os.getpid())}
        path.with_suffix(".engine").write_text(json.dumps(record))
    except OSError as error:
        listener.close()
        if error.errno == errno.EADDRINUSE:
            raise _TakenError from None  # another engine has just bound it
        raise
    finally:
        os.umask(umask)
    if group is not None:
        _share(path, group, 0o660)
        _share(path.with_suffix(".engine"), group, 0o640)
    listener.listen(BACKLOG)
    return listener
