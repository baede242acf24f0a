"""What is said with one client: its hello, then requests, each with its answer or a command.

The hub: stands between any number of clients and one engine, and can slow none of them.
"""

from __future__ import annotations

import os
import select
import socket
import time
from collections.abc import Callable
from typing import Any

from diffbotctl.control_socket.connection import Client, peer_of
from diffbotctl.control_socket.dispatch import dispatch
from diffbotctl.control_socket.engine_channel import EngineUpdate
from diffbotctl.control_socket.engine_link import EngineLink
from diffbotctl.control_socket.protocol import (
    PROTOCOL,
    RefusalError,
    check_hello,
    encode_line,
    parse_request,
)
from diffbotctl.control_socket.request_context import CommandDraft, RequestContext
from diffbotctl.control_socket.run_state import RunInfo, RunState
from diffbotctl.control_socket.subscriptions import Subscriptions
from diffbotctl.recording.black_box_store import BlackBoxStore

Log = Callable[[dict[str, Any]], None]


class Dispatcher:
    """Answers from the desk, or sends what is wanted to the engine; who asked is logged."""

    def __init__(self, desk: RequestContext, engine: EngineLink, log: Log) -> None:
        self.desk = desk
        self.engine = engine
        self.log = log

    def line(self, client: Client, data: bytes) -> None:
        """Take one line of `client`. Raises RefusalError for a hello that ends it all."""
        if not client.name:
            client.name = check_hello(parse_request(data)) or "client"
            self.log({"event": "connected", "name": client.name, **client.peer._asdict()})
            return
        number: int | str | None = None
        try:
            asked = parse_request(data)
            number = asked.number
            said = dispatch(self.desk, client, asked)
        except RefusalError as refusal:
            client.answer({"id": number, **refusal.fields()})
            return
        if isinstance(said, CommandDraft):
            if said.verb != "drive":
                self.log({"event": said.verb, "values": list(said.values), "by": client.who})
            self.engine.command(client, number, said)
        else:
            client.answer({"id": number, "ok": True, **said})


MOST_CLIENTS = 100
AT_ONCE = 32  # connections accepted between two looks at the others
PERIOD = 0.05  # s; how long a client that asks too often waits, and how soon a dead engine shows
GREETING_TIME = 10.0  # s in which a client must have said hello
READ, WRITE, GONE = select.EPOLLIN, select.EPOLLOUT, select.EPOLLHUP | select.EPOLLERR


class Server:
    """Accepts clients at `listener`, speaks with the engine through `channel`.

    `shared`: any user whom the socket's permissions let through may speak, not only its own. The
    flight recorder's `keeper` is handed what comes for it, whatever the clients do.
    """

    def __init__(
        self,
        listener: socket.socket,
        channel: socket.socket,
        about: RunInfo,
        shared: bool,
        log: Log,
        keeper: BlackBoxStore | None = None,
    ) -> None:
        self.listener = listener
        self.engine = EngineLink(channel)
        self.shared = shared
        self.log = log
        self.knowledge = RunState(about.graph)
        desk = RequestContext(about, self.knowledge, self.engine.whisper)
        self.conversation = Dispatcher(desk, self.engine, log)
        self.streams = Subscriptions(about.graph.kinds)
        self.clients: dict[int, Client] = {}
        self.connected = 0
        self.epoll = select.epoll()
        self.epoll.register(listener, READ)
        self.epoll.register(channel, READ)
        self.keeper = keeper
        if keeper is not None:
            self.epoll.register(keeper, READ)
        hello = {"hello": PROTOCOL, "engine": about.name, "pid": about.pid}
        self.greeting = encode_line({**hello, "version": about.version})
        listener.setblocking(False)

    def run(self) -> None:
        """Serve until the engine has ended or died."""
        parent, looked = os.getppid(), 0.0
        while self.engine.lives and os.getppid() == parent:
            for file, state in self.epoll.poll(PERIOD):
                self._ready(file, state)
            self.engine.retry()
            now = time.monotonic()
            if now - looked >= PERIOD:
                looked = now
                self._look_round(now)

    def farewell(self, patience: float) -> None:
        """Tell all clients that it is over; they have `patience` seconds to take what waits."""
        self.listener.close()
        deadline = time.monotonic() + patience
        waiting = list(self.clients.values())
        for client in waiting:
            client.answer({"ended": True})
        while waiting and time.monotonic() < deadline:
            waiting = [client for client in waiting if client.write() and client.waits]
            select.select([], [client.connection for client in waiting], [], PERIOD)

    def _ready(self, file: int, state: int) -> None:
        if file == self.engine.channel.fileno():
            for news in self.engine.news():
                self._take(news)
        elif file == self.listener.fileno():
            self._accept()
        elif self.keeper is not None and file == self.keeper.fileno():
            self._keep(self.keeper)
        elif file in self.clients:
            client = self.clients[file]
            if client.hears:
                client.hears = client.read()
                self._follow(client, time.monotonic())
            elif state & GONE:
                self._part(client)
            self._serve(client)

    def _keep(self, keeper: BlackBoxStore) -> None:
        """Hand the flight recorder what came for it. Its failure must not silence the hub."""
        try:
            goes_on = keeper.read()
        except Exception:
            from traceback import format_exc

            self.log({"event": "flight recorder failed", "traceback": format_exc()})
            keeper.give_up()
            goes_on = False
        if not goes_on:
            self.epoll.unregister(keeper)

    def _accept(self) -> None:
        for _ in range(AT_ONCE):
            try:
                connection, _ = self.listener.accept()
            except OSError:
                return
            self._welcome(connection)

    def _welcome(self, connection: socket.socket) -> None:
        peer = peer_of(connection)
        self.connected += 1
        client = Client(connection, self.connected, peer, time.monotonic())
        self.clients[connection.fileno()] = client
        self.epoll.register(connection, READ)
        if not self.shared and peer.uid not in (0, os.getuid()):
            self.log({"event": "refused", **peer._asdict()})
            self._dismiss(client, RefusalError("E-SOCKET", "this engine obeys its own user alone"))
            return
        client.answers.append(self.greeting)
        if len(self.clients) > MOST_CLIENTS:
            strangers = [each for each in self.clients.values() if not each.name]
            self._dismiss(strangers[0], RefusalError("E-BUSY", "too many clients are connected"))
        self._serve(client)

    def _dismiss(self, client: Client, refusal: RefusalError) -> None:
        client.answer(refusal.fields())
        client.watched.clear()
        client.ending, client.hears = True, False
        self._serve(client)

    def _follow(self, client: Client, now: float) -> None:
        """Do what the client's whole lines say, as fast as it may ask."""
        try:
            while not client.ending and (data := client.next_line(now)) is not None:
                self.conversation.line(client, data)
        except RefusalError as refusal:  # of the line as such: what follows it cannot be trusted
            self._dismiss(client, refusal)

    def _take(self, news: EngineUpdate) -> None:
        self.knowledge.take(news)
        for answer in news.answers:
            client = self.engine.whose(answer)
            if client is not None:
                self._serve(client)
        watchers = [client for client in self.clients.values() if client.watched]
        self.streams.distribute(news, watchers)
        for client in watchers:
            self._serve(client)

    def _serve(self, client: Client) -> None:
        """Send what fits; wait for what must be waited for; part when all is said."""
        if client.connection.fileno() < 0:
            return
        if not client.write() or client.is_done:
            self._part(client)
            return
        reads = client.hears and not client.is_paused
        wanted = (READ if reads else 0) | (WRITE if client.waits else 0)
        self.epoll.modify(client.connection, wanted)

    def _part(self, client: Client) -> None:
        del self.clients[client.connection.fileno()]
        client.connection.close()
        if client.drives:
            self.engine.command(client, None, CommandDraft("leave"))

    def _look_round(self, now: float) -> None:
        """What must be done though nothing came: slow down the hasty, part from the silent."""
        for client in list(self.clients.values()):
            if client.is_paused:
                self._follow(client, now)
                self._serve(client)
            elif not client.name and not client.ending and now - client.since > GREETING_TIME:
                self._dismiss(client, RefusalError("E-PROTOCOL", "no hello came in time"))
