"""A serial port for the engine: locked, raw, non-blocking."""

from __future__ import annotations

import errno
import fcntl
import grp
import os
import stat
import struct
import termios
from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path
from typing import Protocol

from diffbotctl.drivers.socket_port import connect_radio, connect_socket, is_socket, unreachable
from diffbotctl.errors import Problem, RunError
from diffbotctl.ports.access import HIDDEN_USER, current_user, port_user
from diffbotctl.ports.diagnosis import (
    PERMISSION_CODES,
    PortReport,
    busy_problem,
    diagnose_name,
    missing_problem,
    survey_ports,
)

FIND_PORT = "look for the board under /dev/serial/by-id, or unplug it and see which name disappears"
READ_SIZE = 4096  # bytes; more than any board sends between two reads
RATE_ERROR_MAX = 0.025  # of a baud rate; half a bit in the ten of a byte is 0.05, for both ends
# The kernel's struct termios2 takes any rate (asm-generic/termbits.h, asm-generic/ioctls.h).
_TERMIOS2 = struct.Struct("4I B 19s 2I")
_TCGETS2, _TCSETS2 = 0x802C542A, 0x402C542B
_CBAUD, _BOTHER = 0o010017, 0o010000


class SerialPortDevice:
    """An open serial device. `read` and `write` raise OSError when it has disconnected."""

    def __init__(self, device: str, baud: int) -> None:
        self.device = device
        self.baud = baud
        self.fd = _open(device)
        try:
            _lock(self.fd, device)
            _make_raw(self.fd, baud)
            termios.tcflush(self.fd, termios.TCIOFLUSH)
        except BaseException:
            os.close(self.fd)
            raise

    def read(self) -> bytes:
        """The bytes that have arrived, b"" for none. Raises OSError when disconnected."""
        try:
            data = os.read(self.fd, READ_SIZE)
        except BlockingIOError:
            return b""
        if not data:
            raise OSError(errno.EIO, "the device disconnected")
        return data

    def write(self, data: bytes) -> int:
        """Pass bytes to the kernel. Returns how many it accepted."""
        try:
            return os.write(self.fd, data)
        except BlockingIOError:
            return 0

    def change_baud(self, baud: int) -> None:
        """Change the rate, and discard input received at the old one. Raises OSError, RunError."""
        if baud != self.baud:
            self.baud = baud
            _make_raw(self.fd, baud)
            termios.tcflush(self.fd, termios.TCIFLUSH)

    def discard_unsent(self) -> None:
        with suppress(termios.error):
            termios.tcflush(self.fd, termios.TCOFLUSH)

    def close(self) -> None:
        with suppress(OSError):
            os.close(self.fd)


class OpenPort(Protocol):
    """Interface of a port, of whatever kind."""

    device: str
    baud: int
    fd: int

    def read(self) -> bytes:
        """The bytes that have arrived, b"" for none. Raises OSError when disconnected."""

    def write(self, data: bytes) -> int:
        """Pass bytes to the kernel. Returns how many it accepted. Raises OSError."""

    def change_baud(self, baud: int) -> None:
        """Change the rate. Raises OSError."""

    def discard_unsent(self) -> None:
        """Discard what has not been transmitted, as far as possible."""

    def close(self) -> None:
        """Close the device."""


def reopen_port(device: str, baud: int) -> OpenPort:
    """Open a port that was lost. A Bluetooth connection is started, not awaited. Raises OSError."""
    return connect_radio(device, baud) if is_socket(device) else SerialPortDevice(device, baud)


def open_port(device: str, baud: int) -> OpenPort:
    """Open a port that must be there. Raises RunError."""
    if is_socket(device):
        return connect_socket(device, baud)
    try:
        return SerialPortDevice(device, baud)
    except FileNotFoundError as error:
        raise missing_port_error(device) from error
    except OSError as error:
        raise disconnected_error(device, error) from error


def disconnected_error(device: str, error: OSError) -> RunError:
    if is_socket(device):
        return unreachable(device, error)
    fix = f"is the board plugged in, or the Bluetooth module paired and bound? {FIND_PORT}"
    return _port_error("E-PORT-OPEN", device, error.strerror or str(error), fix)


def missing_port_error(device: str, words: Sequence[str] = ()) -> RunError:
    """The error for a device that is not there; `words` could be given in place of one."""
    return RunError(missing_problem(survey_ports(Path("/"), current_user()), device, words))


def _open(device: str) -> int:
    try:
        fd = os.open(device, os.O_RDWR | os.O_NOCTTY | os.O_NONBLOCK)
    except PermissionError as error:
        raise _permission_error(device) from error
    except OSError as error:
        if error.errno == errno.EBUSY:
            raise _busy_error(device) from error
        raise
    if not stat.S_ISCHR(os.fstat(fd).st_mode) or not os.isatty(fd):
        os.close(fd)
        raise _port_error("E-PORT-KIND", device, "it is not a serial port", FIND_PORT)
    return fd


def _lock(fd: int, device: str) -> None:
    try:
        fcntl.flock(fd, fcntl.LOCK_EX | fcntl.LOCK_NB)
        fcntl.ioctl(fd, termios.TIOCEXCL)
    except OSError as error:
        raise _busy_error(device) from error


def _port_error(code: str, device: str, cause: str, fix: str) -> RunError:
    return RunError(Problem(code, f"port {device}", cause, fix))


def _busy_error(device: str) -> RunError:
    user = port_user(Path("/"), os.path.abspath(device)) or HIDDEN_USER
    return RunError(busy_problem(device, user))


def _permission_error(device: str) -> RunError:
    """The error that `diffbotctl ports` reports; for an unlisted port, how to join its group."""
    root = Path("/")
    report = diagnose_name(root, survey_ports(root, current_user()), os.path.abspath(device))
    for problem in report.problems if isinstance(report, PortReport) else ():
        if problem.code in PERMISSION_CODES:
            return RunError(problem)
    group = _group(device)
    fix = f"join that group, then log out and in: sudo usermod -aG {group} $USER"
    cause = f"you have no permission to open it; it belongs to the group {group}"
    return _port_error("E-PORT-RIGHTS", device, cause, fix)


def _group(device: str) -> str:
    """The group that owns the device; Debian's `dialout` when that is root or unknown."""
    try:
        number = os.stat(device).st_gid
        return grp.getgrgid(number).gr_name if number else "dialout"
    except (OSError, KeyError):
        return "dialout"


def _make_raw(fd: int, baud: int) -> None:
    control = termios.CS8 | termios.CREAD | termios.CLOCAL
    speed = getattr(termios, f"B{baud}", None)
    usual = termios.B9600 if speed is None else speed
    try:
        special = termios.tcgetattr(fd)[6]
        special[termios.VMIN], special[termios.VTIME] = 1, 0  # an empty read then means a hang-up
        settings: list[object] = [0, 0, control, 0, usual, usual, special]
        termios.tcsetattr(fd, termios.TCSANOW, settings)  # type: ignore[arg-type]
    except termios.error as error:
        raise OSError(*error.args) from error
    if speed is None:
        _set_rate(fd, baud)


def _set_rate(fd: int, baud: int) -> None:
    """Set a rate for which termios has no constant. Raises OSError, or RunError if none is near."""
    settings = list(_TERMIOS2.unpack(fcntl.ioctl(fd, _TCGETS2, bytes(_TERMIOS2.size))))
    settings[2] = settings[2] & ~_CBAUD | _BOTHER
    settings[-2:] = baud, baud
    fcntl.ioctl(fd, _TCSETS2, _TERMIOS2.pack(*settings))
    actual = _TERMIOS2.unpack(fcntl.ioctl(fd, _TCGETS2, bytes(_TERMIOS2.size)))[-1]
    if abs(actual - baud) > RATE_ERROR_MAX * baud:
        cause = f"{baud} baud is not among its rates; the nearest one is {actual}"
        fix = "use another adapter, such as one with a CP2102"
        raise _port_error("E-PORT-BAUD", os.ttyname(fd), cause, fix)
