"""A socket as a port: the serial channel of a Bluetooth module, or a Unix socket.

The radio delivers every byte in order or not at all: what was sent during an outage arrives late,
not damaged. A late command is not dangerous, because a host that receives nothing for a quarter of
a second sends only stops.
"""

from __future__ import annotations

import errno
import select
import socket
from contextlib import suppress

from diffbotctl.bluetooth.bluez import PORT_PREFIX, parse_port
from diffbotctl.errors import Problem, RunError

READ_SIZE = 4096  # bytes
SOCKET = "socket:"
CONNECT_TIMEOUT_S = 12.0  # a radio pages a module for 5 s before it gives up, and pairing is slow
SEND_BUFFER_BYTES = 2048  # a small request: the kernel then uses its minimum
# Cause and fix for each error of the kernel.
CONNECT_ERRORS = {
    errno.ECONNREFUSED: (
        "the module refuses the connection",
        "is it connected to another machine?",
    ),
    errno.EHOSTDOWN: ("the module does not answer", "is it switched on and within range?"),
    errno.ETIMEDOUT: ("the module does not answer", "is it switched on and within range?"),
    errno.EACCES: (
        "the module must be paired first",
        "pair it: diffbotctl bluetooth pair {address}",
    ),
    errno.EBUSY: (
        "it is in use",
        "close the other program on this machine that is connected to it",
    ),
    errno.EHOSTUNREACH: ("Bluetooth is off", "run `diffbotctl doctor` for the reason"),
    errno.ENETUNREACH: ("Bluetooth is off", "run `diffbotctl doctor` for the reason"),
    errno.ENODEV: ("this machine has no Bluetooth radio", "run `diffbotctl doctor` for details"),
    errno.EAFNOSUPPORT: ("this system has no Bluetooth", "run `diffbotctl doctor` for details"),
    errno.EPROTONOSUPPORT: ("this system has no Bluetooth", "run `diffbotctl doctor` for details"),
}


def is_socket(device: str) -> bool:
    """Whether a port of this name is a socket rather than a device file."""
    return device.startswith((PORT_PREFIX, SOCKET))


Address = tuple[str, int] | str


class SocketPort:
    """A connection, or an attempt to connect. `read` and `write` raise OSError when it is lost.

    During the attempt nothing can be read, and no bytes are accepted.
    """

    def __init__(
        self,
        device: str,
        baud: int,
        unconnected: socket.socket,
        address: Address,
        wait: float = 0.0,
    ) -> None:
        """Connect `unconnected` within `wait` seconds; with 0, in the background.

        Raises OSError.
        """
        self.device, self.baud = device, baud
        self._socket = unconnected
        self.fd = unconnected.fileno()
        try:
            unconnected.setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, SEND_BUFFER_BYTES)
            unconnected.settimeout(wait)
            self._connecting = not self._connect(address)
            unconnected.setblocking(False)
        except BaseException:
            unconnected.close()
            raise

    def _connect(self, address: Address) -> bool:
        """True if connected at once, False if the attempt continues."""
        try:
            self._socket.connect(address)
        except TimeoutError as error:
            raise OSError(errno.ETIMEDOUT, "no answer") from error
        except OSError as error:
            if error.errno != errno.EINPROGRESS:
                raise
            return False
        return True

    def read(self) -> bytes:
        """The bytes that have arrived, b"" for none. Raises OSError when disconnected."""
        if not self._connected():
            return b""
        try:
            data = self._socket.recv(READ_SIZE)
        except BlockingIOError:
            return b""
        if not data:
            raise OSError(errno.EIO, "the module disconnected")
        return data

    def write(self, data: bytes) -> int:
        """Pass bytes to the kernel. Returns how many it accepted."""
        if not self._connected():
            return 0
        try:
            return self._socket.send(data, socket.MSG_NOSIGNAL)
        except BlockingIOError:
            return 0

    def _connected(self) -> bool:
        if not self._connecting:
            return True
        poll = select.poll()
        poll.register(self.fd, select.POLLOUT)
        if not poll.poll(0):
            return False
        code = self._socket.getsockopt(socket.SOL_SOCKET, socket.SO_ERROR)
        if code:
            raise OSError(code, CONNECT_ERRORS.get(code, (errno.errorcode.get(code, "failed"),))[0])
        self._connecting = False
        return True

    def change_baud(self, baud: int) -> None:
        """Only noted: a radio has no rate, and the module keeps its own."""
        self.baud = baud

    def discard_unsent(self) -> None:
        """Does nothing: a socket's send buffer cannot be cleared (see the module's docstring)."""

    def close(self) -> None:
        """Disconnect, also for the watchdog process: the module accepts one connection only."""
        with suppress(OSError):
            self._socket.shutdown(socket.SHUT_RDWR)
        self._socket.close()


def connect_radio(device: str, baud: int, wait: float = 0.0) -> SocketPort:
    """Connect to a module. Raises OSError, UsageError for a wrong name, RunError."""
    unconnected, address = _new_socket(device)
    return SocketPort(device, baud, unconnected, address, wait)


def connect_socket(device: str, baud: int) -> SocketPort:
    """Connect to a module that must be there. Raises RunError, UsageError."""
    try:
        return connect_radio(device, baud, CONNECT_TIMEOUT_S)
    except OSError as error:
        raise unreachable(device, error) from error


def unreachable(device: str, error: OSError) -> RunError:
    """The error for a module that cannot be reached, or has disconnected."""
    cause, fix = CONNECT_ERRORS.get(
        error.errno or 0,
        (error.strerror or str(error), "switch the module off and on, then try again"),
    )
    if device.startswith(SOCKET):
        fix = "is the program that serves this socket running?"
    address = device.removeprefix(PORT_PREFIX)
    return RunError(
        Problem("E-BLUETOOTH-CONNECT", f"port {device}", cause, fix.format(address=address))
    )


def _new_socket(device: str) -> tuple[socket.socket, Address]:
    if device.startswith(SOCKET):
        return socket.socket(socket.AF_UNIX, socket.SOCK_STREAM), device.removeprefix(SOCKET)
    target = parse_port(device)
    family, protocol = (getattr(socket, name, None) for name in ("AF_BLUETOOTH", "BTPROTO_RFCOMM"))
    if family is None or protocol is None:
        fix = (
            "make the virtual environment with the system's Python: /usr/bin/python3 -m venv; "
            "or bind the module with rfcomm and use /dev/rfcomm0"
        )
        cause = "this Python was built without Bluetooth sockets"
        raise RunError(Problem("E-BLUETOOTH-PYTHON", f"port {device}", cause, fix))
    return socket.socket(family, socket.SOCK_STREAM, protocol), (target.address, target.channel)
