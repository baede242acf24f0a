"""Frames that wait for a viewer: its replies, and messages of channels that may be dropped."""

from __future__ import annotations

import asyncio
from collections import deque
from collections.abc import Callable
from typing import Any

from aiohttp import web

from diffbotctl.web.web_socket_connection import SEND_TIMEOUT_S

MESSAGES_MAX = 500  # that wait for a viewer which reads slowly; then the oldest is dropped
REPLIES_MAX = 1000  # that wait; a viewer that reads nothing is disconnected


class FrameQueue:
    """Sends frames over `socket`. `disconnect` is called for a viewer that reads nothing."""

    def __init__(self, socket: web.WebSocketResponse, disconnect: Callable[[], None]) -> None:
        self.socket = socket
        self.disconnect = disconnect
        self.replies: deque[str | bytes] = deque()
        self.messages: deque[bytes] = deque(maxlen=MESSAGES_MAX)
        self.has_news = asyncio.Event()

    def reply(self, frame: str | bytes) -> None:
        """Queue a frame that must not be lost."""
        self.replies.append(frame)
        self.has_news.set()
        if len(self.replies) > REPLIES_MAX:
            self.disconnect()

    def show(self, frame: bytes) -> None:
        """Queue a message of a channel."""
        self.messages.append(frame)
        self.has_news.set()

    async def run(self) -> None:
        """Send what waits, replies first, until the socket is closed or reads nothing."""
        try:
            while True:
                await self.has_news.wait()
                self.has_news.clear()
                while self.replies or self.messages:
                    queue: deque[Any] = self.replies or self.messages
                    await self._send(queue.popleft())
        except (OSError, TimeoutError, RuntimeError):
            self.disconnect()  # it reads nothing, or is gone

    async def _send(self, frame: str | bytes) -> None:
        async with asyncio.timeout(SEND_TIMEOUT_S):
            if isinstance(frame, str):
                await self.socket.send_str(frame)
            else:
                await self.socket.send_bytes(frame)
