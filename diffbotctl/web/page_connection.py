"""One open page: what it sees, its commands, and its dead-man."""

from __future__ import annotations

import time
from collections import deque
from collections.abc import Iterator
from typing import Any, Protocol

from aiohttp import WSMsgType, web

from diffbotctl.blocks.slam import place_arguments
from diffbotctl.client.web_socket_connection import WebSocketConnection
from diffbotctl.control_socket.address import EngineAddress
from diffbotctl.control_socket.connection import TokenBucket
from diffbotctl.control_socket.protocol import Fields, RefusalError
from diffbotctl.web.deadman import BeatNumbers, DriveResult, PageDeadman, PageLoss
from diffbotctl.web.engine_feed import EngineFeed, encode
from diffbotctl.web.page_commands import (
    DriveCommand,
    drive_command,
    goal_fields,
    parse_command,
    plotted_fields,
    read_request,
    whole_number,
)
from diffbotctl.web.plot_samples import PlotSamples
from diffbotctl.web.sessions import Session

MESSAGE_MAX_BYTES = 4096  # a command has some hundred
MESSAGES_PER_SECOND = 60.0  # 20 of them drive
MESSAGE_BURST = 60.0
NOTES_MAX = 100  # small messages that wait for a page which reads slowly
HEARTBEAT_S = 4.0  # of the web socket, for pages that only watch
LOSSES = {"hidden": PageLoss.HIDDEN, "blurred": PageLoss.BLURRED}


class PageHost(Protocol):
    """What a page needs of its server."""

    engine: EngineAddress
    numbers: BeatNumbers
    feed: EngineFeed

    def add(self, page: PageConnection) -> None:
        """A page has been opened."""

    def remove(self, page: PageConnection) -> None:
        """A page has been closed."""

    def require_control(self, page: PageConnection) -> None:
        """Give control to `page` if no page has it. Raises RefusalError if another page has."""

    def take_control(self, page: PageConnection) -> None:
        """Give control to `page`. Raises RefusalError while another one drives by hand."""

    def give_control(self, page: PageConnection) -> None:
        """End the control of `page`."""

    def tell_roles(self) -> None:
        """Notify each page who is in control."""


class PageConnection(WebSocketConnection):
    """Serves one web socket of `session`."""

    def __init__(self, server: PageHost, session: Session) -> None:
        socket = web.WebSocketResponse(
            protocols=[session.proof],
            compress=False,
            max_msg_size=MESSAGE_MAX_BYTES,
            heartbeat=HEARTBEAT_S,
            timeout=1.0,
        )
        super().__init__(socket, TokenBucket(MESSAGES_PER_SECOND, MESSAGE_BURST, time.monotonic()))
        self.server = server
        self.session = session
        self.deadman = PageDeadman(session.ended, self._send_request, self._on_loss)
        self.late_press = 0
        self.notes: deque[str] = deque(maxlen=NOTES_MAX)
        self.picture: str | None = None  # the newest that was not sent yet
        self.plotted = PlotSamples()
        self.wants_whole = True

    @property
    def name(self) -> str:
        """The device, as the cause of a stop names it."""
        return self.session.name

    async def serve(self, request: web.Request) -> web.WebSocketResponse:
        return await self.serve_client(request, self.server.engine, self.name)

    def _refusal_text(self, cause: str) -> str:
        return encode({"refused": cause})

    def _on_open(self) -> None:
        self.server.add(self)

    def _on_close(self) -> None:
        self.deadman.lose(PageLoss.CLOSED)
        self.server.remove(self)

    def note(self, **fields: object) -> None:
        self.notes.append(encode(fields))
        self.has_news.set()

    def show(self, picture: str) -> None:
        """Queue a picture of changes; a page that has fallen behind gets everything instead."""
        self.wants_whole |= self.picture is not None
        self.picture = picture
        self.has_news.set()

    def _waiting(self) -> Iterator[str]:
        while self.notes:
            yield self.notes.popleft()
        text = self._next_picture()
        if text is not None:
            yield text
            if samples := self.plotted.drain():
                yield encode({"plot": samples})

    def _next_picture(self) -> str | None:
        text, self.picture = self.picture, None
        if self.wants_whole:
            self.wants_whole = False
            return self.server.feed.whole()
        return text

    # Commands.

    def _frame_received(self, kind: WSMsgType, data: Any) -> bool:
        if kind is not WSMsgType.TEXT:
            return False
        try:
            self._follow(*parse_command(data))
        except RefusalError as refusal:
            self.refuse(refusal.cause)
        return True

    def refuse(self, cause: str) -> None:
        """Show on the page why something was not done."""
        self.note(refused=cause)

    def _follow(self, name: str, fields: Fields) -> None:
        match name:
            case "stop":  # anyone may stop the robot
                self._send_request("stop", reason="STOP was pressed on its page")
            case "release":
                self.deadman.release(whole_number(fields, "press"))
            case "lost":
                self.deadman.lose(LOSSES.get(str(fields.get("reason")), PageLoss.HIDDEN))
            case "take":
                self.server.take_control(self)
            case "give":
                self.server.give_control(self)
            case "read":
                self.start(self._read(*read_request(fields)))
            case "plot":
                self._plot(plotted_fields(fields, self.server.feed.topics))
            case _:
                self.server.require_control(self)
                self._follow_driver(name, fields)

    def _follow_driver(self, name: str, fields: Fields) -> None:
        """A command that only the page in control may give."""
        match name:
            case "drive":
                self._drive(drive_command(fields))
            case "resume":
                self.start(self._request("resume", {}))
            case "allow_goals":
                self.session.sets_goals = True
                self.server.tell_roles()
            case "goto":
                goal = goal_fields(fields)
                if not self.session.sets_goals:
                    raise RefusalError("E-REQUEST", "goals were not allowed for this session")
                self.start(self._request("goto", goal))
            case "place":
                place = place_arguments(**{"heading": None, **goal_fields(fields)})
                action = f"{self.server.feed.picture.view.map_block}.place"
                self.start(self._request("call_action", {"action": action, "arguments": place}))
            case "set":
                names = ("parameter", "value")
                setting = {each: fields.get(each) for each in names}
                self.start(self._request("set_parameter", setting))

    def _drive(self, command: DriveCommand) -> None:
        now, sent_at = time.monotonic(), self.server.numbers.sent_at(command.number)
        result = self.deadman.drive(now, command.press, sent_at, command.linear, command.angular)
        if result is DriveResult.LATE and command.press != self.late_press:
            self.late_press = command.press  # the page is notified once
            self.refuse("the connection is too slow to drive now")

    async def _request(self, method: str, fields: Fields) -> None:
        try:
            await self.client.request(method, **fields)
            self.note(done=method)
        except RefusalError as refusal:
            self.refuse(refusal.text)

    async def _read(self, method: str, fields: Fields) -> None:
        try:
            self.note(read=method, reply=await self.client.request(method, **fields))
        except RefusalError as refusal:
            self.refuse(refusal.cause)

    def _plot(self, names: list[str]) -> None:
        """Send every sample of these fields from now on, after what is known of the new ones."""
        before = self.plotted.topics
        for name in self.plotted.choose(names):
            self.plotted.add_history(name, self.server.feed.history(name))
        after = self.plotted.topics
        for topic in sorted(before - after):
            self._send_request("unsubscribe", topic=topic)
        for topic in sorted(after - before):
            self._send_request("subscribe", topic=topic)

    # The engine.

    def _on_line(self, line: Fields) -> None:
        if "message" in line:
            self.plotted.take(line["topic"], line["message"])
        elif line.get("ok") is False:
            if line.get("id") == "drive":
                self.deadman.on_refusal()
                self.note(lost=line.get("cause", ""))
            else:
                self.refuse(str(line.get("cause", "")))

    def _on_loss(self, cause: str) -> None:
        self.note(lost=cause)

    def _on_run_end(self) -> None:
        self.note(ended=True)
