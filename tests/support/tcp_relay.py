"""A TCP relay that can fall silent as a radio link does: nothing arrives, without an error."""

from __future__ import annotations

import selectors
import socket
from contextlib import suppress
from typing import cast

from tests.support.background import BackgroundDevice

POLL_PERIOD_S = 0.05
READ_BYTES = 1 << 16


class TcpRelay(BackgroundDevice):
    """Relays connections on `port` to `target`, a port of this machine, until `is_cut` is set."""

    def __init__(self, target: int) -> None:
        self.target = target
        self.is_cut = False
        self.listener = socket.create_server(("127.0.0.1", 0))
        self.port: int = self.listener.getsockname()[1]
        self.ends: list[socket.socket] = []
        self.selector = selectors.DefaultSelector()
        self.selector.register(self.listener, selectors.EVENT_READ)
        self.begin()

    def live(self) -> None:
        """Relay until the end. What comes while it is cut stays unread, and is relayed afterwards.

        TCP behaves so too when the gap is shorter than its patience: it sends everything again.
        """
        while not self.over.is_set():
            if self.is_cut:
                self.over.wait(POLL_PERIOD_S / 5)
                continue
            for key, _ in self.selector.select(POLL_PERIOD_S):
                if self.is_cut:
                    break
                if key.data is None:
                    self._accept()
                else:
                    self._relay(cast(socket.socket, key.fileobj), key.data)

    def _accept(self) -> None:
        near, _ = self.listener.accept()
        try:
            far = socket.create_connection(("127.0.0.1", self.target))
        except ConnectionRefusedError:
            near.close()
            return
        for end in (near, far):
            end.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        self.ends += [near, far]
        self.selector.register(near, selectors.EVENT_READ, far)
        self.selector.register(far, selectors.EVENT_READ, near)

    def _relay(self, source: socket.socket, sink: socket.socket) -> None:
        data = b""
        with suppress(OSError):
            data = source.recv(READ_BYTES)
            sink.sendall(data)
        if not data:
            for end in (source, sink):
                with suppress(KeyError, ValueError):
                    self.selector.unregister(end)
                end.close()

    def let_go(self) -> None:
        """Close everything."""
        for end in self.ends:
            end.close()
        self.listener.close()
        self.selector.close()
