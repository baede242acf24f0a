"""The connections to a server of this machine; their number is bounded."""

from __future__ import annotations

import asyncio
import gc
import logging
import socket
import ssl
from collections import Counter
from collections.abc import AsyncIterator, Callable
from contextlib import asynccontextmanager, suppress
from ipaddress import IPv6Address, IPv6Network, ip_address

from aiohttp import web

from diffbotctl.errors import Problem, RunError

# Besides those of open pages. One with TLS takes a quarter of a megabyte.
CONNECTIONS_MAX = 48
HANDSHAKES_MAX = 16
HANDSHAKE_TIMEOUT_S = 5.0
COLLECTION_PERIOD = 16  # connections with TLS until those that have ended are freed
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


def client_name(address: str) -> str:
    """What one client has: an IPv4 address, or the /64 network of an IPv6 address."""
    name = ip_address(address.partition("%")[0])
    if not isinstance(name, IPv6Address):
        return str(name)
    return str(name.ipv4_mapped or IPv6Network((name, 64), strict=False))


class ConnectionLimiter:
    """Accepts at `listener`, at most CONNECTIONS_MAX, HANDSHAKES_MAX of them in their handshake.

    For a further one, the oldest of the client that has the most is dropped. Those for which
    `is_kept` is true stay. `make_protocol` makes the protocol of a connection.
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
        self.open: dict[Peer, socket.socket] = {}  # the oldest first; some have ended
        self.starting: dict[Peer, asyncio.Task[None]] = {}
        self.count = 0

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
            await asyncio.sleep(0)  # accepting does not wait while there are more: let others run

    def _admit(self, connection: socket.socket, peer: Peer) -> None:
        self.open.pop(peer, None)  # an earlier connection from the same port has ended
        self.open[peer] = connection
        self.count += 1
        if self.context is not None and self.count % COLLECTION_PERIOD == 0:
            gc.collect()  # asyncio's objects for TLS refer to each other
        task = asyncio.create_task(self._start(connection))
        self.starting[peer] = task
        task.add_done_callback(lambda task: self._has_started(peer, task))
        if len(self.starting) > HANDSHAKES_MAX:
            self._drop(list(self.starting))
        if len(self.open) > CONNECTIONS_MAX:
            self._drop([peer for peer in self.open if not self.is_kept(peer)])

    def _has_started(self, peer: Peer, task: asyncio.Task[None]) -> None:
        if self.starting.get(peer) is task:
            del self.starting[peer]

    def _drop(self, peers: list[Peer]) -> None:
        """Drop the oldest connection of the client that has the most of `peers`."""
        numbers = Counter(client_name(peer[0]) for peer in peers)
        name = max(numbers, key=numbers.__getitem__)
        oldest = next(peer for peer in peers if client_name(peer[0]) == name)
        self.starting.pop(oldest, None)
        with suppress(OSError):  # it has ended
            self.open.pop(oldest).shutdown(socket.SHUT_RDWR)

    async def _start(self, connection: socket.socket) -> None:
        timeout = None if self.context is None else HANDSHAKE_TIMEOUT_S
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
    gc.freeze()  # what is there now stays: ConnectionLimiter collects in a millisecond
    accepting = asyncio.create_task(limiter.run())
    try:
        yield
    finally:
        accepting.cancel()
        listener.close()
        with suppress(TimeoutError):
            async with asyncio.timeout(CLEANUP_TIMEOUT_S):
                await runner.cleanup()
