"""The server for viewers: who may connect, and what they receive of the run.

A client of the control socket without rights of its own. It listens on the loopback address only.
Every program and every web page of the machine can reach that, so each connection must name this
server as Host, come from an origin that is allowed, and carry the token of the printed address.
"""

from __future__ import annotations

import asyncio
import secrets
import socket
import time
from collections.abc import Callable, Iterable
from contextlib import suppress
from typing import NamedTuple

from aiohttp import web

from diffbotctl.client.connections import Peer, serving
from diffbotctl.client.request_check import RequestRefusalError, ServerOrigin
from diffbotctl.client.velocity_rules import BEAT_PERIOD_S, RESUMED, Limits
from diffbotctl.config.configuration import Configuration
from diffbotctl.control_socket.address import EngineAddress
from diffbotctl.control_socket.client import AsyncControlClient
from diffbotctl.control_socket.protocol import RefusalError
from diffbotctl.errors import UserError
from diffbotctl.foxglove import protocol
from diffbotctl.foxglove.channels import ChannelMessage, RunChannels, RunTopic
from diffbotctl.foxglove.commands import TOPICS, Command, service_row, services
from diffbotctl.foxglove.parameters import Values, connection_graph, parameter_values
from diffbotctl.foxglove.protocol import Fields
from diffbotctl.foxglove.viewer_connection import ViewerConnection
from diffbotctl.recording.viewer_model import viewer_model
from diffbotctl.ros2.robot_model import configuration_of_run

VIEWERS_MAX = 8
KEEPALIVE_S = 5.0  # that an idle connection stays open
PARAMETERS_PERIOD_S = 2.0
TOKEN_BYTES = 16
# Foxglove in a browser, and desktop programs; these still need the token.
KNOWN_ORIGINS = frozenset({"https://app.foxglove.dev", "file://"})
HEADERS = {"X-Content-Type-Options": "nosniff", "Cache-Control": "no-store"}


class ViewerRules(NamedTuple):
    """What viewers may do, and from which web origins they may come."""

    allowed: frozenset[Command] = frozenset()
    origins: frozenset[str] = KNOWN_ORIGINS


class FoxgloveServer:
    """Serves the run of `engine` on `listener`, which must be on the loopback address.

    `report` gets a sentence when a viewer comes, goes or is refused.
    """

    def __init__(
        self,
        engine: EngineAddress,
        listener: socket.socket,
        rules: ViewerRules,
        report: Callable[[str], None],
    ) -> None:
        self.engine = engine
        self.listener = listener
        self.allowed = rules.allowed
        self.origins = rules.origins
        self.report = report
        self.services = services(rules.allowed)
        self.limits = Limits()
        self.token = secrets.token_urlsafe(TOKEN_BYTES)
        self.port: int = listener.getsockname()[1]
        self.host = ServerOrigin("ws", self.port, {"localhost"})
        self.viewers: dict[ViewerConnection, None] = {}
        self.count = 0
        self.subscribed: set[str] = set()
        self.refused: set[str] = set()  # causes that were reported
        self.ended = asyncio.Event()
        self.client = AsyncControlClient(self._on_line, self.ended.set)

    @property
    def address(self) -> str:
        """The address to enter in the viewer; it carries the token."""
        return f"ws://127.0.0.1:{self.port}/{self.token}"

    async def run(self, is_ready: Callable[[], None]) -> None:
        """Serve until the run has ended. `is_ready` is called when viewers can connect."""
        await self.client.connect(self.engine, "foxglove")
        await self._read_run()
        application = web.Application()
        application.router.add_get("/{token:.*}", self._open)
        async with serving(application, self.listener, None, self._is_viewer, KEEPALIVE_S):
            tasks = [
                asyncio.create_task(work) for work in (self._beat(), self._follow_parameters())
            ]
            is_ready()
            try:
                await self.ended.wait()
                for viewer in self.viewers:
                    viewer.warn("the run has ended")
                await asyncio.sleep(BEAT_PERIOD_S)  # for the viewers to receive it
            finally:
                for task in tasks:
                    task.cancel()

    async def _read_run(self) -> None:
        """Ask for what does not change during the run."""
        status = await self.client.request("status")
        epoch = time.time_ns() - status["time"]
        self.limits = Limits.of_run(status)
        scene = await self.client.request("scene")
        topics = []
        for row in (await self.client.request("list_topics"))["topics"]:
            fields = await self.client.request("describe_topic", topic=row["topic"])
            topics.append(RunTopic(row["topic"], fields["type"], fields["schema"]))
        model = viewer_model(self._configuration(status), scene)
        commands = {str(command): TOPICS[command] for command in self.allowed}
        self.channels = RunChannels(topics, model, epoch, commands)
        await self._read_map()
        if self.allowed:
            self.subscribed.add(RESUMED)
            self.client.send("subscribe", "subscribe", topic=RESUMED)

    async def _read_map(self) -> None:
        """The tiles of the map so far; what changes comes from the subscription."""
        for wire in self.channels.map_wires:
            self.subscribed.add(wire)
            self.client.send("subscribe", "subscribe", topic=wire)
            tiles, ask = self.channels.viewers.map_tiles, self.client.request
            while tiles.take_reply(await ask("read_map", map=tiles.map, since=tiles.read)):
                pass

    def _configuration(self, status: Fields) -> Configuration | None:
        try:
            return configuration_of_run(status)
        except UserError as error:
            problem = error.problems[0]
            self.report(f"no robot is drawn: {problem.file}: {problem.cause}")
            return None

    # Who may connect.

    async def _open(self, request: web.Request) -> web.StreamResponse:
        try:
            self._check(request)
        except RequestRefusalError as refusal:
            text = f"{refusal.cause}\n"
            return web.Response(status=refusal.status, text=text, headers=HEADERS)
        self.count += 1
        viewer = ViewerConnection(self, f"viewer {self.count}")
        self.viewers[viewer] = None
        self.report(f"{viewer.name} has connected")
        try:
            return await viewer.serve(request, self._greeting())
        finally:
            self.viewers.pop(viewer, None)
            self.report(f"{viewer.name} has disconnected")

    def _check(self, request: web.Request) -> None:
        """Raise RequestRefusalError unless the request may open a connection."""
        transport = request.transport
        address = transport.get_extra_info("sockname")[0] if transport else ""
        if request.headers.get("Host", "").lower() not in self.host.hosts(address):
            raise RequestRefusalError(421, "this server is not called that")
        origin = request.headers.get("Origin")
        if origin is not None and origin not in self.origins:
            self._report_refusal(f"a viewer of the origin {origin[:100]}", "--origin allows it")
            raise RequestRefusalError(403, "this origin is not allowed; see --origin")
        token = request.match_info["token"].encode("utf-8", "replace")
        if not secrets.compare_digest(token, self.token.encode()):
            self._report_refusal("a viewer without the token", "use the address printed above")
            raise RequestRefusalError(401, "the token is missing or wrong; use the printed address")
        offered = request.headers.get("Sec-WebSocket-Protocol", "")
        if not {each.strip() for each in offered.split(",")} & set(protocol.SUBPROTOCOLS):
            text = f"this is a web socket with the protocol {' or '.join(protocol.SUBPROTOCOLS)}"
            raise RequestRefusalError(400, text)
        if len(self.viewers) >= VIEWERS_MAX:
            raise RequestRefusalError(503, f"{VIEWERS_MAX} viewers are connected; close one")

    def _report_refusal(self, who: str, fix: str) -> None:
        """Report each kind of refusal once."""
        if who not in self.refused and len(self.refused) < VIEWERS_MAX:
            self.refused.add(who)
            self.report(f"{who} was refused; {fix}")

    def _is_viewer(self, peer: Peer) -> bool:
        return any(viewer.peer == peer for viewer in self.viewers)

    def _greeting(self) -> Iterable[str]:
        """The first messages to each viewer."""
        capabilities = ["parameters", "parametersSubscribe", "services", "connectionGraph"]
        capabilities += ["assets", *(["clientPublish"] if self.allowed else [])]
        yield protocol.operation(
            "serverInfo",
            name=f"diffbotctl {self.engine.name}",
            capabilities=capabilities,
            supportedEncodings=[protocol.ENCODING],
            metadata={},
            sessionId=self.token[:8] + str(self.channels.epoch),
        )
        yield protocol.operation("advertise", channels=self.channels.rows)
        rows = [service_row(service) for service in self.services]
        yield protocol.operation("advertiseServices", services=rows)

    # The run.

    def _on_line(self, line: Fields) -> None:
        wire = line.get("topic")
        if wire not in self.channels.numbers or "message" not in line:
            return
        if wire == RESUMED:
            for viewer in self.viewers:
                viewer.driving.stop_ended()
        for message in self.channels.take(wire, line["message"]):
            self._show(message)

    def _show(self, message: ChannelMessage) -> None:
        for viewer in self.viewers:
            viewer.show(message)

    def subscriptions_changed(self) -> None:
        """Subscribe to what the viewers need of the run, and to nothing else."""
        channels: set[int] = set()
        for viewer in self.viewers:
            channels |= set(viewer.subscriptions.values())
        needed = self.channels.wires(channels)
        if self.allowed:
            needed.add(RESUMED)
        for wire in sorted(needed - self.subscribed):
            self.client.send("subscribe", "subscribe", topic=wire, last=True)
        for wire in sorted(self.subscribed - needed):
            self.client.send("unsubscribe", "unsubscribe", topic=wire)
        self.channels.forget(self.subscribed - needed)
        self.subscribed = needed

    async def _beat(self) -> None:
        while True:
            await asyncio.sleep(BEAT_PERIOD_S)
            now = time.monotonic()
            for viewer in self.viewers:
                viewer.driving.beat(now)

    async def _follow_parameters(self) -> None:
        """Notify the viewers of what other clients of the run have changed."""
        known: Values = {}
        while True:
            await asyncio.sleep(PARAMETERS_PERIOD_S)
            if not any(viewer.followed for viewer in self.viewers):
                continue
            with suppress(RefusalError):  # the engine is late, or has ended
                values = await self.read_parameters()
                changed = [name for name in values if known.get(name) != values[name]]
                known = values
                self.parameters_changed(values, changed)

    async def read_parameters(self) -> Values:
        """The parameters of the run. Raises RefusalError."""
        return parameter_values(await self.client.request("list_parameters"))

    async def read_graph(self) -> Fields:
        """The connection graph of the run. Raises RefusalError."""
        wires = (await self.client.request("list_wires"))["wires"]
        names = [service.name for service in self.services]
        return connection_graph(self.channels.run_topics, wires, names)

    def parameters_changed(self, values: Values, names: Iterable[str]) -> None:
        """Notify the viewers who follow them."""
        names = list(names)
        for viewer in self.viewers:
            viewer.show_parameters(values, names)
