"""One viewer: its subscriptions and channels, its parameters, its services."""

from __future__ import annotations

import json
import time
from collections import deque
from collections.abc import Coroutine, Iterable, Iterator
from typing import Any, Protocol

from aiohttp import WSMsgType, web

from diffbotctl.client.velocity_driver import VelocityDriver
from diffbotctl.client.velocity_rules import Limits, VelocityRules, VelocitySource
from diffbotctl.client.web_socket_connection import WebSocketConnection
from diffbotctl.control_socket.address import EngineAddress
from diffbotctl.control_socket.connection import TokenBucket
from diffbotctl.control_socket.protocol import RefusalError
from diffbotctl.foxglove import commands, protocol
from diffbotctl.foxglove.channels import ChannelMessage, RunChannels
from diffbotctl.foxglove.commands import Command, RobotService
from diffbotctl.foxglove.parameters import Values, parameter_rows
from diffbotctl.foxglove.protocol import ClientMessage, Fields, FrameError, ServiceCall

FRAME_MAX_BYTES = 64 << 10
FRAMES_PER_SECOND = 200.0  # panels publish at most 60 velocities a second
FRAME_BURST = 400.0  # at the start a viewer subscribes, perhaps one topic a frame
MESSAGES_MAX = 500  # that wait for a viewer which reads slowly; then the oldest is dropped
REPLIES_MAX = 1000  # that wait; a viewer that reads nothing is disconnected
NAMES_MAX = 1000  # subscriptions, own channels and parameters of a viewer


class ViewerHost(Protocol):
    """What a viewer needs of its server."""

    engine: EngineAddress
    channels: RunChannels
    allowed: frozenset[Command]
    services: list[RobotService]
    limits: Limits

    def subscriptions_changed(self) -> None:
        """A viewer has subscribed or unsubscribed."""

    async def read_parameters(self) -> Values:
        """The parameters of the run. Raises RefusalError."""

    async def read_graph(self) -> Fields:
        """The connection graph of the run. Raises RefusalError."""

    def parameters_changed(self, values: Values, names: Iterable[str]) -> None:
        """Parameters have changed; notify those who follow them."""


class ViewerConnection(WebSocketConnection):
    """Serves one web socket. `name` is unique, such as `viewer 1`."""

    def __init__(self, server: ViewerHost, name: str) -> None:
        socket = web.WebSocketResponse(
            protocols=protocol.SUBPROTOCOLS,
            compress=False,
            max_msg_size=FRAME_MAX_BYTES,
            timeout=1.0,
        )
        super().__init__(socket, TokenBucket(FRAMES_PER_SECOND, FRAME_BURST, time.monotonic()))
        self.server = server
        self.name = name
        self.greeting: Iterable[str] = ()
        self.source = VelocitySource(frozenset({name}), name)
        self.driving = VelocityDriver(VelocityRules(server.limits), self._send_request, self.warn)
        self.subscriptions: dict[int, int] = {}  # subscription to channel
        self.published: dict[int, Command] = {}  # the viewer's channel to what it is
        self.followed: set[str] = set()  # parameters
        self.replies: deque[str | bytes] = deque()
        self.messages: deque[bytes] = deque(maxlen=MESSAGES_MAX)

    async def serve(self, request: web.Request, greeting: Iterable[str]) -> web.WebSocketResponse:
        """Send `greeting`, and serve until the socket is closed."""
        self.greeting = greeting
        return await self.serve_client(request, self.server.engine, f"foxglove {self.name}")

    def _refusal_text(self, cause: str) -> str:
        return protocol.status(protocol.ERROR, cause)

    def _waiting(self) -> Iterator[str | bytes]:
        while self.replies or self.messages:
            yield self.replies.popleft() if self.replies else self.messages.popleft()

    def _on_open(self) -> None:
        for text in self.greeting:
            self.reply(text)

    def _on_close(self) -> None:
        self.driving.publishers_changed(frozenset())
        self.subscriptions.clear()
        self.server.subscriptions_changed()

    # What is sent.

    def reply(self, frame: str | bytes) -> None:
        """Queue a frame that must not be lost."""
        self.replies.append(frame)
        self.has_news.set()
        if len(self.replies) > REPLIES_MAX:
            self.disconnect()

    def show(self, message: ChannelMessage) -> None:
        for subscription, channel in self.subscriptions.items():
            if channel == message.channel:
                self._show(subscription, message)

    def show_parameters(self, values: Values, names: Iterable[str]) -> None:
        """Send the viewer those of the parameters `names` that it follows."""
        followed = [name for name in names if name in self.followed]
        if followed:
            self._reply_parameters(values, followed, None)

    def _show(self, subscription: int, message: ChannelMessage) -> None:
        self.messages.append(protocol.message_data(subscription, message.time, message.data))
        self.has_news.set()

    def warn(self, text: str) -> None:
        """Show a sentence in the viewer's list of problems."""
        self.reply(protocol.status(protocol.WARNING, text))

    def _refuse(self, refusal: RefusalError) -> None:
        self.reply(protocol.status(protocol.ERROR, refusal.text))

    def _reply_parameters(self, values: Values, names: list[str], request: object) -> None:
        extra = {"id": request} if isinstance(request, str) else {}
        rows = parameter_rows(values, names)
        self.reply(protocol.operation("parameterValues", parameters=rows, **extra))

    # What is received.

    def _frame_received(self, kind: WSMsgType, data: Any) -> bool:
        try:
            if kind is WSMsgType.TEXT:
                self._operation_received(*protocol.parse_operation(data))
            elif kind is WSMsgType.BINARY:
                frame = protocol.parse_binary(data)
                if isinstance(frame, ClientMessage):
                    self._message_received(frame)
                else:
                    self._start(self._call(frame))
            else:
                return False
        except FrameError as error:
            self.reply(protocol.status(protocol.ERROR, str(error)))
        except RefusalError as refusal:
            self._refuse(refusal)
        return True

    def _operation_received(self, name: str, fields: Fields) -> None:
        match name:
            case "subscribe":
                self._subscribe(protocol.rows(fields, "subscriptions", ("id", "channelId")))
            case "unsubscribe":
                for subscription in protocol.numbers(fields, "subscriptionIds"):
                    self.subscriptions.pop(subscription, None)
                self.server.subscriptions_changed()
            case "advertise":
                self._advertise(protocol.rows(fields, "channels", ("id",)))
            case "unadvertise":
                for channel in protocol.numbers(fields, "channelIds"):
                    self.published.pop(channel, None)
            case "fetchAsset":
                self._send_file(fields)
            case "subscribeConnectionGraph":
                self._start(self._show_graph())
            case "unsubscribeConnectionGraph":
                pass  # the graph of a run does not change
            case _:
                self._parameter_operation(name, fields)

    def _parameter_operation(self, name: str, fields: Fields) -> None:
        match name:
            case "getParameters":
                names = protocol.texts(fields, "parameterNames")
                self._start(self._show_parameters(names, fields.get("id")))
            case "setParameters":
                rows = protocol.rows(fields, "parameters", ())
                self._start(self._set_parameters(rows, fields.get("id")))
            case "subscribeParameterUpdates":
                names = protocol.texts(fields, "parameterNames")
                self.followed |= set(names[:NAMES_MAX])
                if len(self.followed) > NAMES_MAX:
                    self.followed = set(names[:NAMES_MAX])
            case "unsubscribeParameterUpdates":
                self.followed -= set(protocol.texts(fields, "parameterNames"))
            case _:
                raise FrameError(f"there is no operation '{name[:40]}'")

    def _subscribe(self, rows: list[Fields]) -> None:
        channels = self.server.channels
        for row in rows:
            subscription, channel = row["id"], row["channelId"]
            if channel not in channels.topics:
                raise FrameError(f"there is no channel {channel}")
            if len(self.subscriptions) >= NAMES_MAX:
                raise FrameError(f"more than {NAMES_MAX} subscriptions")
            self.subscriptions[subscription] = channel
            for message in channels.begin(channel):
                self._show(subscription, message)
        self.server.subscriptions_changed()

    def _advertise(self, rows: list[Fields]) -> None:
        for row in rows:
            if len(self.published) >= NAMES_MAX:
                raise FrameError(f"more than {NAMES_MAX} channels")
            topic, encoding = str(row.get("topic"))[:100], str(row.get("encoding"))
            command = commands.command_of(topic, encoding, self.server.allowed)
            self.published[row["id"]] = command

    def _message_received(self, message: ClientMessage) -> None:
        match self.published.get(message.channel):
            case Command.VELOCITY:
                linear, angular = commands.velocity(message.data)
                self.driving.velocity_received(time.monotonic(), linear, angular, self.source)
            case Command.GOAL:
                self._start(self._request("goto", commands.goal(message.data)))
            case None:
                raise FrameError(f"channel {message.channel} was not advertised")

    def _send_file(self, fields: Fields) -> None:
        request, uri = fields.get("requestId"), fields.get("uri")
        if type(request) is not int or not 0 <= request < 1 << 32:
            raise FrameError("requestId is no number")
        data = self.server.channels.file(uri) if isinstance(uri, str) else None
        self.reply(protocol.asset_response(request, data))

    # Requests to the engine.

    def _start(self, work: Coroutine[Any, Any, None]) -> None:
        # Closed, one that is cancelled before it begins causes no warning on the terminal.
        self.start(self._guard(work)).add_done_callback(lambda _: work.close())

    async def _guard(self, work: Coroutine[Any, Any, None]) -> None:
        try:
            await work
        except RefusalError as refusal:
            self._refuse(refusal)
        except ValueError:  # JSON of another program may have NaN
            self._refuse(RefusalError("E-REQUEST", "a value is no finite number"))

    async def _request(self, method: str, fields: Fields) -> None:
        await self.client.request(method, **fields)

    async def _call(self, call: ServiceCall) -> None:
        service = next((each for each in self.server.services if each.number == call.service), None)
        if service is None:
            text = f"there is no service {call.service}"
            self.reply(
                protocol.operation(
                    "serviceCallFailure", serviceId=call.service, callId=call.call, message=text
                )
            )
            return
        cause = ""
        reason = {"reason": f"service {service.name} of {self.name}"}
        try:
            await self.client.request(service.method, **(reason if service.name == "stop" else {}))
        except RefusalError as refusal:
            cause = refusal.cause
        answer = json.dumps({"success": not cause, "message": cause}).encode()
        self.reply(protocol.service_response(call, answer))

    async def _show_graph(self) -> None:
        self.reply(protocol.operation("connectionGraphUpdate", **await self.server.read_graph()))

    async def _show_parameters(self, names: list[str], request: object) -> None:
        self._reply_parameters(await self.server.read_parameters(), names, request)

    async def _set_parameters(self, rows: list[Fields], request: object) -> None:
        """Set them one after the other; the reply has the values in force afterwards."""
        if not self.server.allowed:
            fix = "start the server with --allow"
            raise RefusalError("E-REQUEST", "viewers may not set parameters", fix)
        names = [str(row.get("name")) for row in rows[:NAMES_MAX]]
        for name, row in zip(names, rows, strict=False):
            try:
                await self.client.request("set_parameter", parameter=name, value=row.get("value"))
            except RefusalError as refusal:
                self._refuse(refusal)
        values = await self.server.read_parameters()
        if isinstance(request, str):
            self._reply_parameters(values, names, request)
        self.server.parameters_changed(values, names)

    # The engine.

    def _on_line(self, line: Fields) -> None:
        self.driving.reply_received(line)

    def _on_run_end(self) -> None:
        """The server has a client of its own, and warns all viewers."""
