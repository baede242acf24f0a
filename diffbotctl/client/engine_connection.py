"""A bridge as a client of the control socket: one connection that drives, one that asks."""

from __future__ import annotations

import threading
from collections.abc import Iterable, Iterator
from contextlib import suppress
from socket import SHUT_RDWR
from typing import Any

from diffbotctl.control_socket.address import EngineAddress
from diffbotctl.control_socket.client import ControlClient
from diffbotctl.control_socket.protocol import Fields


class EngineConnection:
    """Both connections. Raises RunError as ControlClient does.

    Streams and the lease of the one who drives belong to the first, so that a frozen or killed
    bridge ends its lease. Requests with replies use the second, from any thread.
    """

    def __init__(self, address: EngineAddress, client_name: str) -> None:
        self.streaming = ControlClient(address, client_name)
        self.asking = ControlClient(address, client_name)
        self.about = self.streaming.about
        self._sends = threading.Lock()
        self._asks = threading.Lock()

    def subscribe(self, wires: Iterable[str]) -> None:
        """Stream these wires; the newest message of each comes first."""
        for wire in wires:
            self.send("subscribe", topic=wire, last=True)

    def send(self, method: str, **fields: Any) -> None:
        """Send a request without waiting; its reply comes with the stream, its `id` the method."""
        with self._sends:
            self.streaming.send(method, id=method, **fields)

    def lines(self) -> Iterator[Fields]:
        """Messages of the subscriptions and replies to what was sent, up to the end of the run."""
        return self.streaming.stream()

    def request(self, method: str, **fields: Any) -> Fields:
        """Send a request and wait for its reply. Raises RunError when it is refused."""
        with self._asks:
            return self.asking.request(method, **fields)

    def close(self) -> None:
        """Disconnect: a robot that moves is stopped, and `lines` ends. Both sockets stay open for
        threads that still use them, until the process ends."""
        for client in (self.streaming, self.asking):
            with suppress(OSError):  # the run has ended
                client.connection.shutdown(SHUT_RDWR)
