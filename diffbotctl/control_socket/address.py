"""Where an engine's control socket lies: one folder a user, or one a group under /run.

Beside the socket NAME.socket stands NAME.engine with the engine's process, for the day when the
socket no longer answers.

Making an engine's control socket: closed to others from its first moment; no two of a name.
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
from pathlib import Path
from typing import NamedTuple

from diffbotctl.errors import Problem, RunError

RUN = Path("/run")
PREFIX = "diffbotctl"


class Process(NamedTuple):
    """A process, told from a later one of the same number by its start time in clock ticks."""

    pid: int
    started: int

    @property
    def is_alive(self) -> bool:
        """True while that very process exists and is no zombie."""
        return started(self.pid) == self.started


class EngineAddress(NamedTuple):
    """A running engine as the file system shows it."""

    name: str
    socket: Path
    process: Process | None


def own_folder() -> Path:
    """The folder of this user's sockets: only the user may enter it."""
    runtime = os.environ.get("XDG_RUNTIME_DIR")
    if runtime and Path(runtime).is_dir():
        return Path(runtime) / PREFIX
    return Path("/tmp") / f"{PREFIX}-{os.getuid()}"


def group_folder(group: str) -> Path:
    """The folder of the sockets that the members of `group` may use."""
    return RUN / f"{PREFIX}-{group}"


def started(pid: int) -> int | None:
    """When `pid` was started, in clock ticks since boot; None when it is gone or a zombie."""
    try:
        text = Path(f"/proc/{pid}/stat").read_text()
    except OSError:
        return None
    fields = text.rpartition(")")[2].split()  # the name before it may hold anything
    return None if fields[0] in "ZX" else int(fields[19])


def engines() -> list[EngineAddress]:
    """Every engine that this user may speak to, and whose process or socket is alive."""
    found = []
    for folder in _folders():
        for path in sorted(folder.glob("*.socket")):
            engine = EngineAddress(path.stem, path, process_of(path))
            if engine.process.is_alive if engine.process else answers(path):
                found.append(engine)
    return found


def answers(path: Path) -> bool:
    """True when something listens at the socket `path`; a stale socket refuses the connection."""
    with socket.socket(socket.AF_UNIX) as probe:
        probe.setblocking(False)
        try:
            probe.connect(str(path))
        except BlockingIOError:
            return True  # its queue is full: it lives, and is busy
        except OSError:
            return False
    return True


def _folders() -> list[Path]:
    shared = [
        path for path in sorted(RUN.glob(f"{PREFIX}-*")) if os.access(path, os.R_OK | os.X_OK)
    ]
    return [own_folder(), *shared]


def process_of(path: Path) -> Process | None:
    try:
        said = json.loads(path.with_suffix(".engine").read_text())
        return Process(int(said["pid"]), int(said["started"]))
    except (OSError, ValueError, KeyError, TypeError):
        return None


LONGEST_NAME = 40  # characters; a socket's whole path must fit in 107 bytes
NAME = re.compile(rf"[A-Za-z0-9_-]{{1,{LONGEST_NAME}}}")
BACKLOG = 1024  # connections that may wait to be accepted


def listen_on(name: str | None, fallback: str, group: str | None) -> tuple[socket.socket, Path]:
    """Listen as `name`; without a name as `fallback`, or `fallback-2` and on where taken.

    Raises RunError when the name is taken or the folder cannot be made.
    """
    if name is not None and not NAME.fullmatch(name):
        cause = f"'{name}' is no name: letters, digits, - and _, {LONGEST_NAME} at most"
        raise RunError(Problem("E-SOCKET", "--name", cause, "such as --name mower"))
    folder = own_folder() if group is None else group_folder(group)
    try:
        _make(folder, group)
        if name is not None:
            return _listen(_path(folder, name), group), _path(folder, name)
        for path in _candidates(folder, fallback):
            with suppress(_TakenError):
                return _listen(path, group), path
    except _TakenError:
        cause = f"an engine called '{name}' runs already"
        raise RunError(Problem("E-SOCKET", str(folder), cause, "give another --name")) from None
    except (OSError, KeyError) as error:
        words = error.strerror if isinstance(error, OSError) else f"there is no group '{group}'"
        cause = f"cannot make the control socket: {words}"
        raise RunError(Problem("E-SOCKET", str(folder), cause, FIX)) from error
    raise AssertionError


FIX = "mend the folder, or run with --no-socket"


def remove_socket(path: Path) -> None:
    """Remove the socket and what stands beside it."""
    for each in (path, path.with_suffix(".engine")):
        with suppress(OSError):
            each.unlink()


class _TakenError(Exception):
    """The name is in use."""


def _path(folder: Path, name: str) -> Path:
    return folder / f"{name}.socket"


def _candidates(folder: Path, fallback: str) -> Iterator[Path]:
    stem = re.sub(r"[^A-Za-z0-9_-]", "-", fallback)[:LONGEST_NAME] or "engine"
    yield _path(folder, stem)
    number = 2
    while True:
        yield _path(folder, f"{stem}-{number}")
        number += 1


def _make(folder: Path, group: str | None) -> None:
    folder.mkdir(mode=0o700, exist_ok=True)
    found = folder.lstat()
    if not stat.S_ISDIR(found.st_mode) or found.st_uid != os.getuid():
        raise PermissionError(1, "the folder belongs to another user")
    if group is None:
        folder.chmod(0o700)
        return
    from grp import getgrnam

    os.chown(folder, -1, getgrnam(group).gr_gid)
    folder.chmod(0o750)


def _listen(path: Path, group: str | None) -> socket.socket:
    process = process_of(path)
    if answers(path) or (process is not None and process.is_alive):
        raise _TakenError
    remove_socket(path)
    made = socket.socket(socket.AF_UNIX, socket.SOCK_STREAM | socket.SOCK_NONBLOCK)
    before = os.umask(0o177)  # the file must never be open to others, not for a moment
    try:
        made.bind(str(path))
        record = {"pid": os.getpid(), "started": started(os.getpid())}
        path.with_suffix(".engine").write_text(json.dumps(record))
    except OSError as error:
        made.close()
        if error.errno == errno.EADDRINUSE:
            raise _TakenError from None  # another engine was faster by a hair
        raise
    finally:
        os.umask(before)
    if group is not None:
        from grp import getgrnam

        for each in (path, path.with_suffix(".engine")):
            os.chown(each, -1, getgrnam(group).gr_gid)
            each.chmod(0o660 if each == path else 0o640)
    made.listen(BACKLOG)
    return made
