"""A serial port as the loop wants it: locked, raw, never blocking."""

from __future__ import annotations

import errno
import fcntl
import os
import stat
import termios
from contextlib import suppress

from diffbotctl.errors import Problem, RunError

READ_SIZE = 4096  # bytes; more than any board sends between two looks


class Port:
    """An open serial device. Raises OSError from `read` and `write` when the device is gone."""

    def __init__(self, device: str, baud: int) -> None:
        self.device = device
        self.baud = baud
        self.fd = _open(device)
        try:
            _lock(self.fd, device)
            _make_raw(self.fd, baud)
        except BaseException:
            os.close(self.fd)
            raise

    def read(self) -> bytes:
        """What has arrived; b"" when nothing has. Raises OSError when the device is gone."""
        try:
            data = os.read(self.fd, READ_SIZE)
        except BlockingIOError:
            return b""
        if not data:
            raise OSError(errno.EIO, "the device hung up")
        return data

    def write(self, data: bytes) -> int:
        """Hand bytes to the kernel; returns how many it took."""
        try:
            return os.write(self.fd, data)
        except BlockingIOError:
            return 0

    def change_baud(self, baud: int) -> None:
        """Go on at another rate, once what was written is out."""
        if baud != self.baud:
            self.baud = baud
            _make_raw(self.fd, baud)

    def discard_unsent(self) -> None:
        """Throw away what the kernel has not put on the wire."""
        with suppress(termios.error):
            termios.tcflush(self.fd, termios.TCOFLUSH)

    def close(self) -> None:
        """Let the device go."""
        with suppress(OSError):
            os.close(self.fd)


def _open(device: str) -> int:
    try:
        fd = os.open(device, os.O_RDWR | os.O_NOCTTY | os.O_NONBLOCK)
    except PermissionError as error:
        fix = "join the group that owns it, then log out and in: sudo usermod -a -G dialout $USER"
        raise _trouble("E-PORT-RIGHTS", device, "you have no right to open it", fix) from error
    if not stat.S_ISCHR(os.fstat(fd).st_mode) or not os.isatty(fd):
        os.close(fd)
        raise _trouble("E-PORT-KIND", device, "it is no serial port", FIND_PORT)
    return fd


def _trouble(code: str, device: str, cause: str, fix: str) -> RunError:
    return RunError(Problem(code, f"port {device}", cause, fix))


FIND_PORT = "look for the board's name under /dev/serial/by-id, or unplug it and see what vanishes"


def _lock(fd: int, device: str) -> None:
    try:
        fcntl.flock(fd, fcntl.LOCK_EX | fcntl.LOCK_NB)
        fcntl.ioctl(fd, termios.TIOCEXCL)
    except OSError as error:
        fix = "end that program; two writers on one port garble each other's frames"
        cause = f"it is in use by {holder(device)}"
        raise _trouble("E-PORT-BUSY", device, cause, fix) from error


def _make_raw(fd: int, baud: int) -> None:
    speed = getattr(termios, f"B{baud}", None)
    if speed is None:
        problem = Problem(
            "E-PORT-BAUD", "link.baud", f"{baud} baud is no standard rate", "use 9600 or 115200"
        )
        raise RunError(problem)
    control = termios.CS8 | termios.CREAD | termios.CLOCAL
    try:
        special = termios.tcgetattr(fd)[6]
        special[termios.VMIN], special[termios.VTIME] = 1, 0  # so that empty means hung up
        settings: list[object] = [0, 0, control, 0, speed, speed, special]
        termios.tcsetattr(fd, termios.TCSANOW, settings)  # type: ignore[arg-type]
        termios.tcflush(fd, termios.TCIOFLUSH)
    except termios.error as error:
        raise OSError(*error.args) from error


def holder(device: str) -> str:
    """The programs that have `device` open, as far as /proc lets us see."""
    real = os.path.realpath(device)
    pids = [pid for pid in os.listdir("/proc") if pid.isdigit() and int(pid) != os.getpid()]
    found = [_called(pid) for pid in sorted(pids, key=int) if _holds(pid, real)]
    return " and ".join(found) or "another program"


def _holds(pid: str, real: str) -> bool:
    with suppress(OSError):
        for fd in os.listdir(f"/proc/{pid}/fd"):
            with suppress(OSError):
                if os.path.realpath(f"/proc/{pid}/fd/{fd}") == real:
                    return True
    return False


def _called(pid: str) -> str:
    with suppress(OSError), open(f"/proc/{pid}/comm") as name:
        return f"{name.read().strip()} (process {pid})"
    return f"process {pid}"
