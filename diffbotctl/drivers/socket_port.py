"""A socket as the loop wants a port: a Bluetooth module's serial channel, or a Unix socket.

The radio delivers every byte in order or not at all: what was sent during an outage comes late, not
damaged. So the protocol must not send what would be dangerous late, and it does not: a host that
hears nothing for a quarter of a second sends stops alone.
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
LONGEST_CONNECT = 12.0  # s; a radio calls a module for 5 s before it gives up, and pairing is slow
UNSENT = 2048  # bytes that may wait in the kernel; it takes its least for such wishes
# What the kernel's errors mean of a module.
MEANINGS = {
    errno.ECONNREFUSED: ("the module refuses", "is it connected to another machine?"),
    errno.EHOSTDOWN: ("the module does not answer", "is it switched on, and near?"),
    errno.ETIMEDOUT: ("the module does not answer", "is it switched on, and near?"),
    errno.EACCES: ("the module wants to be paired", "pair it: diffbotctl bluetooth pair {address}"),
    errno.EBUSY: ("it is in use", "end the other program of this machine that is connected to it"),
    errno.EHOSTUNREACH: ("Bluetooth is off", "`diffbotctl doctor` tells why"),
    errno.ENETUNREACH: ("Bluetooth is off", "`diffbotctl doctor` tells why"),
    errno.ENODEV: ("this machine has no Bluetooth radio", "`diffbotctl doctor` tells more"),
    errno.EAFNOSUPPORT: ("this system has no Bluetooth", "`diffbotctl doctor` tells more"),
    errno.EPROTONOSUPPORT: ("this system has no Bluetooth", "`diffbotctl doctor` tells more"),
}


def is_socket(device: str) -> bool:
    """Whether a port of this name is a socket rather than a device file."""
    return device.startswith((PORT_PREFIX, SOCKET))


Address = tuple[str, int] | str


class SocketPort:
    """A connection, or the attempt at one. Raises OSError from `read` and `write` when it is gone.

    While the attempt lasts nothing can be read, and what is written is not taken.
    """

    def __init__(
        self, device: str, baud: int, made: socket.socket, address: Address, wait: float = 0.0
    ) -> None:
        """Connect `made`, waiting so many seconds for success at most; with 0, carry on meanwhile.

        Raises OSError.
        """
        self.device, self.baud = device, baud
        self._socket = made
        self.fd = made.fileno()
        try:
            made.setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, UNSENT)
            made.settimeout(wait)
            self._connecting = not self._connect(address)
            made.setblocking(False)
        except BaseException:
            made.close()
            raise

    def _connect(self, address: Address) -> bool:
        """Whether it is connected already."""
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
        """What has arrived; b"" when nothing has. Raises OSError when the connection is gone."""
        if not self._connected():
            return b""
        try:
            data = self._socket.recv(READ_SIZE)
        except BlockingIOError:
            return b""
        if not data:
            raise OSError(errno.EIO, "the module hung up")
        return data

    def write(self, data: bytes) -> int:
        """Hand bytes to the kernel; returns how many it took."""
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
            raise OSError(code, MEANINGS.get(code, (errno.errorcode.get(code, "failed"),))[0])
        self._connecting = False
        return True

    def change_baud(self, baud: int) -> None:
        """The radio has no rate to set; the module's own stays what it was set to."""
        self.baud = baud

    def discard_unsent(self) -> None:
        """What the kernel has taken of a socket cannot be taken back; see the module's words."""

    def close(self) -> None:
        """Hang up, also for whoever else holds this socket: the module takes one caller only."""
        with suppress(OSError):
            self._socket.shutdown(socket.SHUT_RDWR)
        self._socket.close()


def connect_radio(device: str, baud: int, wait: float = 0.0) -> SocketPort:
    """Call the module of that name. Raises OSError, UsageError for a wrong name, RunError."""
    made, address = _made(device)
    return SocketPort(device, baud, made, address, wait)


def connect_socket(device: str, baud: int) -> SocketPort:
    """Connect to a module that must answer. Raises RunError, UsageError."""
    try:
        return connect_radio(device, baud, LONGEST_CONNECT)
    except OSError as error:
        raise unreachable(device, error) from error


def unreachable(device: str, error: OSError) -> RunError:
    """What to tell of a module that cannot be reached, or no longer."""
    cause, fix = MEANINGS.get(
        error.errno or 0,
        (error.strerror or str(error), "switch the module off and on, and try again"),
    )
    if device.startswith(SOCKET):
        fix = "does whoever serves that socket run?"
    address = device.removeprefix(PORT_PREFIX)
    return RunError(
        Problem("E-BLUETOOTH-CONNECT", f"port {device}", cause, fix.format(address=address))
    )


def _made(device: str) -> tuple[socket.socket, Address]:
    """A socket and where it is to connect."""
    if device.startswith(SOCKET):
        return socket.socket(socket.AF_UNIX, socket.SOCK_STREAM), device.removeprefix(SOCKET)
    wanted = parse_port(device)
    family, protocol = (getattr(socket, name, None) for name in ("AF_BLUETOOTH", "BTPROTO_RFCOMM"))
    if family is None or protocol is None:
        fix = (
            "make the virtual environment with the system's Python: /usr/bin/python3 -m venv; "
            "or bind the module with rfcomm and use /dev/rfcomm0"
        )
        cause = "this Python was built without Bluetooth sockets"
        raise RunError(Problem("E-BLUETOOTH-PYTHON", f"port {device}", cause, fix))
    return socket.socket(family, socket.SOCK_STREAM, protocol), (wanted.address, wanted.channel)
