"""One open web socket: its limits, and its client of the control socket, from begin to end."""

from __future__ import annotations

import asyncio
import time
from abc import ABC, abstractmethod
from collections.abc import Coroutine, Iterator
from contextlib import suppress
from typing import Any

from aiohttp import WSMsgType, web

from diffbotctl.control_socket.address import EngineAddress
from diffbotctl.control_socket.client import AsyncControlClient
from diffbotctl.control_socket.connection import TokenBucket
from diffbotctl.control_socket.protocol import Fields, RefusalError
from diffbotctl.errors import RunError

SEND_TIMEOUT_S = 5.0  # then a browser or viewer that reads nothing is disconnected


class WebSocketConnection(ABC):
    """Serves `socket`. Each one is a client of its own of the engine, which knows its loss."""

    def __init__(self, socket: web.WebSocketResponse, frames: TokenBucket) -> None:
        """`frames` limits the rate of what is received."""
        self.socket = socket
        self.frames = frames
        self.client = AsyncControlClient(self._on_line, self._on_run_end)
        self.transport: asyncio.Transport | None = None
        self.peer: Any = None
        self.tasks: set[asyncio.Task[None]] = set()
        self.has_news = asyncio.Event()  # something waits

    async def serve_client(
        self, request: web.Request, engine: EngineAddress, client_name: str
    ) -> web.WebSocketResponse:
        self.transport = request.transport
        self.peer = request.transport and request.transport.get_extra_info("peername")
        await self.socket.prepare(request)
        try:
            await self.client.connect(engine, client_name)
        except RunError as error:
            await self.socket.send_str(self._refusal_text(str(error)))
            await self.socket.close()
            return self.socket
        self.start(self._send_all())
        try:
            self._on_open()
            async for message in self.socket:
                if not self._allows() or not self._frame_received(message.type, message.data):
                    break
        finally:
            self._on_close()
            for task in self.tasks:
                task.cancel()
            # A socket that is closed with replies unread may lose what was written to it: the
            # reply to a last request shows that the loss has been read.
            with suppress(RefusalError):
                await self.client.request("status")
            self.client.close()
        await self.socket.close()
        return self.socket

    def start(self, work: Coroutine[Any, Any, None]) -> asyncio.Task[None]:
        """Do `work` beside; the end of the connection cancels it."""
        task = asyncio.create_task(work)
        self.tasks.add(task)
        task.add_done_callback(self.tasks.discard)
        return task

    def disconnect(self) -> None:
        """Disconnect at once one that reads nothing, or is gone."""
        if self.transport is not None:
            self.transport.abort()

    async def _send_all(self) -> None:
        """Send what waits, until the socket is closed or reads nothing."""
        try:
            while True:
                await self.has_news.wait()
                self.has_news.clear()
                for frame in self._waiting():
                    async with asyncio.timeout(SEND_TIMEOUT_S):
                        if isinstance(frame, str):
                            await self.socket.send_str(frame)
                        else:
                            await self.socket.send_bytes(frame)
        except (OSError, TimeoutError, RuntimeError):
            self.disconnect()

    def _allows(self) -> bool:
        is_allowed = self.frames.allows(time.monotonic())
        self.frames.spend()
        return is_allowed

    def _send_request(self, method: str, **fields: object) -> None:
        self.client.send(method, method, **fields)

    @abstractmethod
    def _refusal_text(self, cause: str) -> str:
        """The frame for a connection that the engine refuses."""

    @abstractmethod
    def _waiting(self) -> Iterator[str | bytes]:
        """Take the frames that wait, each just before it is sent."""

    @abstractmethod
    def _on_open(self) -> None:
        """The engine has accepted the client."""

    @abstractmethod
    def _on_close(self) -> None:
        """The connection ends; what it drives must stop."""

    @abstractmethod
    def _frame_received(self, kind: WSMsgType, data: Any) -> bool:
        """Follow one frame. Returns whether the connection goes on."""

    @abstractmethod
    def _on_line(self, line: Fields) -> None:
        """A line of the engine: a reply to `_send_request`, or of a subscription."""

    @abstractmethod
    def _on_run_end(self) -> None:
        """The run has ended, or the engine is gone."""
