"""The connections to a server of this machine; their number is bounded."""

from __future__ import annotations

import asyncio
import logging
import socket
import ssl
from collections.abc import AsyncIterator, Callable
from contextlib import asynccontextmanager, suppress

from aiohttp import web

from diffbotctl.errors import Problem, RunError

CONNECTIONS_MAX = 96  # besides those of open pages
TLS_TIMEOUT_S = 5.0
RETRY_S = 0.2  # when the system refuses to open another file
CLEANUP_TIMEOUT_S = 1.0
Peer = tuple[str, int]


def listen(address: str, port: int, code: str, subject: str) -> socket.socket:
    """A socket that listens there for `subject`. Raises RunError with `code`."""
    listener = socket.socket(socket.AF_INET, socket.SOCK_STREAM)
    listener.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
    try:
        listener.bind((address, port))
        listener.listen()
    except OSError as error:
        listener.close()
        cause = f"{subject} cannot be served there: {error.strerror}"
        fix = "choose another port with --tcp-port"
        raise RunError(Problem(code, f"{address}:{port}", cause, fix)) from error
    return listener


class ConnectionLimiter:
    """Accepts at `listener`. A connection is dropped when CONNECTIONS_MAX later ones have come.

    Those for which `is_kept` is true stay. `make_protocol` makes the protocol of a connection.
    """

    def __init__(
        self,
        listener: socket.socket,
        context: ssl.SSLContext | None,
        make_protocol: Callable[[], asyncio.Protocol],
        is_kept: Callable[[Peer], bool],
    ) -> None:
        self.listener = listener
        self.context = context
        self.make_protocol = make_protocol
        self.is_kept = is_kept
        self.recent: dict[Peer, socket.socket] = {}  # the oldest first
        self.starting: set[asyncio.Task[None]] = set()

    async def run(self) -> None:
        """Accept until this is cancelled."""
        self.listener.setblocking(False)
        loop = asyncio.get_running_loop()
        while True:
            try:
                connection, peer = await loop.sock_accept(self.listener)
            except OSError:
                await asyncio.sleep(RETRY_S)
                continue
            self._admit(connection, peer)

    def _admit(self, connection: socket.socket, peer: Peer) -> None:
        self.recent.pop(peer, None)  # an earlier connection from the same port has ended
        self.recent[peer] = connection
        if len(self.recent) > CONNECTIONS_MAX:
            oldest = next(iter(self.recent))
            dropped = self.recent.pop(oldest)
            if not self.is_kept(oldest):
                with suppress(OSError):  # it has ended
                    dropped.shutdown(socket.SHUT_RDWR)
        task = asyncio.create_task(self._start(connection))
        self.starting.add(task)
        task.add_done_callback(self.starting.discard)

    async def _start(self, connection: socket.socket) -> None:
        timeout = None if self.context is None else TLS_TIMEOUT_S
        try:
            await asyncio.get_running_loop().connect_accepted_socket(
                self.make_protocol, connection, ssl=self.context, ssl_handshake_timeout=timeout
            )
        except OSError:  # also no TLS, such as plain HTTP
            connection.close()


@asynccontextmanager
async def serving(
    application: web.Application,
    listener: socket.socket,
    context: ssl.SSLContext | None,
    is_kept: Callable[[Peer], bool],
    keepalive_s: float,
) -> AsyncIterator[None]:
    """Serve `application` at `listener`, which is closed at the end; see `ConnectionLimiter`."""
    for library in ("aiohttp", "asyncio"):  # bad requests are not shown in the terminal
        logging.getLogger(library).setLevel(logging.CRITICAL)
    runner = web.AppRunner(
        application, access_log=None, handle_signals=False, keepalive_timeout=keepalive_s
    )
    await runner.setup()
    assert runner.server is not None
    limiter = ConnectionLimiter(listener, context, runner.server, is_kept)
    accepting = asyncio.create_task(limiter.run())
    try:
        yield
    finally:
        accepting.cancel()
        listener.close()
        with suppress(TimeoutError):
            async with asyncio.timeout(CLEANUP_TIMEOUT_S):
                await runner.cleanup()
