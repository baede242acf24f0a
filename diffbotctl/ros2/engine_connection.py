"""The bridge as a client of the control socket: one connection that drives, one that asks."""

from __future__ import annotations

import threading
from collections.abc import Iterable, Iterator
from contextlib import suppress
from socket import SHUT_RDWR
from typing import Any

from diffbotctl.control_socket.address import EngineAddress
from diffbotctl.control_socket.client import ControlClient
from diffbotctl.control_socket.protocol import Fields
from diffbotctl.ros2.velocity_rules import EngineOrder

CLIENT_NAME = "ros2 bridge"


class EngineConnection:
    """Both connections. Raises RunError as ControlClient does.

    Streams and the lease of the one who drives belong to the first, so that a frozen or killed
    bridge ends its lease. Requests with replies use the second, from any thread.
    """

    def __init__(self, address: EngineAddress) -> None:
        self.streaming = ControlClient(address, CLIENT_NAME)
        self.asking = ControlClient(address, CLIENT_NAME)
        self.about = self.streaming.about
        self._sends = threading.Lock()
        self._asks = threading.Lock()

    def subscribe(self, wires: Iterable[str]) -> None:
        """Stream these wires; the newest message of each comes first."""
        for wire in wires:
            self._send("subscribe", topic=wire, last=True)

    def order(self, order: EngineOrder) -> None:
        """Send an order of the velocity rules without waiting; its reply comes with the stream."""
        match order.method:
            case "drive":
                self._send("drive", id="drive", linear=order.linear, angular=order.angular)
            case "release" | "rearm":
                self._send(order.method, id=order.method)
            case _:
                self._send(order.method, id=order.method, reason=order.reason[:200])

    def lines(self) -> Iterator[Fields]:
        """Messages of the subscriptions and replies to orders, up to the end of the run."""
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

    def _send(self, method: str, **fields: Any) -> None:
        with self._sends:
            self.streaming.send(method, **fields)
