"""The server of the control socket: between any number of clients and one engine.

A client that is slow, sends too much or dies delays neither the engine nor other clients.
"""

from __future__ import annotations

import os
import select
import socket
import time
from traceback import format_exc

from diffbotctl.control_socket.connection import Client, peer_of
from diffbotctl.control_socket.dispatch import AccessLog, Dispatcher
from diffbotctl.control_socket.engine_channel import ClientDisconnected, EngineLink, EngineUpdate
from diffbotctl.control_socket.protocol import PROTOCOL, RefusalError, encode_line
from diffbotctl.control_socket.run_state import RunInfo, RunState
from diffbotctl.recording.black_box_store import BlackBoxStore

CLIENTS_MAX = 100
STOP_CLIENTS_MAX = 8  # further clients, which may only stop the robot
STOP_CLIENT_TIMEOUT_S = 5.0  # after which such a client is disconnected
ACCEPTS_AT_ONCE = 32  # connections accepted between two polls of the others
LINES_AT_ONCE = 2  # of one client, before the next client has its turn
ROUND_S = 0.01  # for the lines of all clients, between two polls
POLL_PERIOD_S = 0.05  # also the wait of a client that asks too often
TOO_MANY = RefusalError("E-BUSY", "too many clients are connected")
READ, WRITE, GONE = select.EPOLLIN, select.EPOLLOUT, select.EPOLLHUP | select.EPOLLERR


class Server:
    """Accepts clients at `listener`, and talks to the engine through `channel`.

    `shared`: any user whom the permissions of the socket admit is served, not only its owner. The
    black box's `store` gets what comes for it, whatever the clients do.
    """

    def __init__(
        self,
        listener: socket.socket,
        channel: socket.socket,
        info: RunInfo,
        shared: bool,
        log: AccessLog,
        store: BlackBoxStore | None = None,
    ) -> None:
        self.listener = listener
        self.engine = EngineLink(channel)
        self.shared = shared
        self.log = log
        self.state = RunState(info.graph)
        self.dispatcher = Dispatcher(info, self.state, self.engine, log, store)
        self.clients: dict[int, Client] = {}
        self.waiting: dict[Client, None] = {}  # with lines to handle; whose turn it is comes first
        self.connected = 0
        self.epoll = select.epoll()
        self.epoll.register(listener, READ)
        self.epoll.register(channel, READ)
        self.store = store
        if store is not None:
            self.epoll.register(store, READ)
        hello = {"hello": PROTOCOL, "engine": info.name, "pid": info.pid, "version": info.version}
        self.greeting = encode_line({**hello, "epoch": None})  # reserved
        listener.setblocking(False)

    def run(self) -> None:
        """Serve until the engine has ended or died."""
        parent, checked = os.getppid(), 0.0
        while self.engine.is_open and os.getppid() == parent:
            for file, events in self.epoll.poll(0.0 if self.waiting else POLL_PERIOD_S):
                self._ready(file, events)
            self._handle_waiting()
            self.engine.retry()
            now = time.monotonic()
            if now - checked >= POLL_PERIOD_S:
                checked = now
                self._check_clients(now)

    def finish(self, timeout: float) -> None:
        """Notify all clients of the run's end; they have `timeout` seconds to read the rest."""
        self.listener.close()
        deadline = time.monotonic() + timeout
        waiting = list(self.clients.values())
        for client in waiting:
            client.answer({"ended": True})
        while waiting and time.monotonic() < deadline:
            waiting = [client for client in waiting if client.write() and client.waits]
            select.select([], [client.connection for client in waiting], [], POLL_PERIOD_S)

    def _ready(self, file: int, events: int) -> None:
        if file == self.engine.channel.fileno():
            for update in self.engine.updates():
                self._update(update)
        elif file == self.listener.fileno():
            self._accept_all()
        elif self.store is not None and file == self.store.fileno():
            self._read_black_box(self.store)
        elif file in self.clients:
            client = self.clients[file]
            if client.is_readable:
                client.is_readable = client.read()
                self.waiting.setdefault(client)
            elif events & GONE:
                self._close(client)
            self._serve(client)

    def _read_black_box(self, store: BlackBoxStore) -> None:
        """Pass on what came for the black box. Its failure must not end the server."""
        try:
            is_running = store.read()
        except Exception:
            self.log({"event": "black box failed", "traceback": format_exc()})
            store.give_up()
            is_running = False
        if not is_running:
            self.epoll.unregister(store)

    def _accept_all(self) -> None:
        for _ in range(ACCEPTS_AT_ONCE):
            try:
                connection, _ = self.listener.accept()
            except OSError:
                return
            self._accept(connection)

    def _accept(self, connection: socket.socket) -> None:
        peer = peer_of(connection)
        self.connected += 1
        client = Client(connection, self.connected, peer, time.monotonic())
        self.clients[connection.fileno()] = client
        self.epoll.register(connection, client.events)
        if not self.shared and peer.uid not in (0, os.getuid()):
            self.log({"event": "refused", **peer._asdict()})
            self._refuse(
                client, RefusalError("E-SOCKET", "only the user of this engine may use its socket")
            )
            return
        client.replies.append(self.greeting)
        if len(self.clients) > CLIENTS_MAX + STOP_CLIENTS_MAX:
            self._refuse(self._dispensable(client), TOO_MANY)
        self._serve(client)

    def _dispensable(self, newcomer: Client) -> Client:
        """The client to disconnect for `newcomer`: one without a hello, else the first stop client.

        So a client that connects in order to stop the robot always succeeds.
        """
        others = [client for client in self.clients.values() if client is not newcomer]
        silent = (client for client in others if not client.name)
        stopping = (client for client in others if client.is_for_stop and not client.unanswered)
        return next(silent, None) or next(stopping, newcomer)

    def _classify(self, client: Client) -> None:
        """Accept a client that has just greeted as an ordinary one, or for `stop` alone."""
        ordinary = sum(bool(each.name) and not each.is_for_stop for each in self.clients.values())
        client.is_for_stop = ordinary > CLIENTS_MAX

    def _refuse(self, client: Client, refusal: RefusalError) -> None:
        client.answer(refusal.fields())
        client.topics.clear()
        client.is_closing, client.is_readable = True, False
        self._serve(client)

    def _handle_waiting(self) -> None:
        """Handle lines in turn for a short time: a flood of requests must not delay a stop.

        Clients that greet or ask for a stop come first.
        """
        now = time.monotonic()
        for client in sorted(self.waiting, key=lambda client: not client.is_urgent):
            if not client.is_urgent and time.monotonic() > now + ROUND_S:
                break
            del self.waiting[client]
            if client.connection.fileno() < 0:
                continue
            self._handle_lines(client, now)
            if client.is_paused and not client.is_closing and client.bucket.allows(now):
                self.waiting[client] = None  # behind the others
            self._serve(client)

    def _handle_lines(self, client: Client, now: float) -> None:
        """Handle the client's next complete lines, as fast as it may ask."""
        try:
            for _ in range(LINES_AT_ONCE):
                if client.is_closing or (data := client.next_line(now)) is None:
                    break
                is_greeting = not client.name
                self.dispatcher.line(client, data)
                if is_greeting:
                    self._classify(client)
        except RefusalError as refusal:  # of the line as such: what follows it cannot be trusted
            self._refuse(client, refusal)

    def _update(self, update: EngineUpdate) -> None:
        # Answers and messages leave in one piece, before the state follows: clients wait for them.
        subscribers = [client for client in self.clients.values() if client.topics]
        self.state.subscriptions.distribute(update.instants, update.lost, subscribers)
        served = dict.fromkeys(subscribers)
        for result in update.results:
            client = self.engine.answer(result)
            if client is not None:
                served[client] = None
        for client in served:
            self._serve(client)
        self.state.update(update)

    def _serve(self, client: Client) -> None:
        """Send what fits, choose the events to wait for, and close a connection that is done."""
        if client.connection.fileno() < 0:
            return
        if not client.write() or client.is_done:
            self._close(client)
            return
        reads = client.is_readable and not client.is_paused
        events = (READ if reads else 0) | (WRITE if client.waits else 0)
        if events != client.events:
            client.events = events
            self.epoll.modify(client.connection, events)

    def _close(self, client: Client) -> None:
        del self.clients[client.connection.fileno()]
        self.waiting.pop(client, None)
        client.connection.close()
        if client.has_driven:
            self.engine.command(client, None, ClientDisconnected())

    def _check_clients(self, now: float) -> None:
        """Handle lines that waited because of the rate limit; refuse clients without a hello."""
        for client in list(self.clients.values()):
            if client.reads_nothing(now):
                self.log({"event": "disconnected: it reads no replies", "by": client.who})
                self._close(client)
            elif client.is_paused:
                self.waiting.setdefault(client)
            elif client.is_closing:
                continue
            elif client.is_late(now):
                self._refuse(client, RefusalError("E-PROTOCOL", "no hello came in time"))
            elif client.is_for_stop and now - client.connected_at > STOP_CLIENT_TIMEOUT_S:
                self._refuse(client, TOO_MANY)
