"""The picture of a running engine, polled once for all pages."""

from __future__ import annotations

import asyncio
import json
from collections.abc import Callable, Set

from diffbotctl.control_socket.address import EngineAddress
from diffbotctl.control_socket.client import AsyncControlClient
from diffbotctl.control_socket.protocol import Fields, RefusalError
from diffbotctl.ui.dash.state import REQUESTS, Request
from diffbotctl.ui.run_text import odometry_topic
from diffbotctl.web.picture import RunPicture

PICTURE_PERIOD_S = 0.1
IDLE_PERIOD_S = 0.2  # without a page: only the trail is kept
TOPICS_PERIOD_S = 2.0  # topics may appear, and their types are needed


def encode(fields: Fields) -> str:
    """A message to a page."""
    return json.dumps(fields, separators=(",", ":"), allow_nan=False)


class EngineFeed:
    """Polls the engine while it runs. `publish` takes each picture as JSON, when there are pages.

    `has_pages`: whether any page is open.
    """

    def __init__(self, publish: Callable[[str], None], has_pages: Callable[[], bool]) -> None:
        self.publish = publish
        self.has_pages = has_pages
        self.picture = RunPicture()
        self.ended = asyncio.Event()
        self.client = AsyncControlClient(lambda line: None, self.ended.set)

    async def connect(self, engine: EngineAddress) -> None:
        """Connect, and ask for what does not change. Raises RunError when nothing answers."""
        await self.client.connect(engine, "web page")
        await self._poll("scene", "list_topics", "snapshot")
        topic = odometry_topic(self.picture.view.snapshot)
        if topic is not None:
            self.picture.take_trail(await self._history(topic))

    async def run(self) -> None:
        """Read what pages may plot of the past, then poll until the run has ended."""
        for topic in self.topics:
            self.picture.view.take_history(topic, await self._history(topic))
        polls = 0
        while not self.ended.is_set():
            period = PICTURE_PERIOD_S if self.has_pages() else IDLE_PERIOD_S
            await asyncio.sleep(period)
            try:
                await self._poll("snapshot")
                polls += 1
                if polls % round(TOPICS_PERIOD_S / PICTURE_PERIOD_S) == 0:
                    await self._poll("list_topics")
            except RefusalError:
                continue  # the engine is late, or has ended
            if self.has_pages():
                self.publish(encode(self.picture.changes()))

    def whole(self) -> str:
        """Everything, for one page."""
        return encode(self.picture.whole())

    @property
    def topics(self) -> Set[str]:
        """The topics of the run."""
        return self.picture.view.rates.keys()

    def history(self, name: str) -> list[tuple[float, float]]:
        """Time (s) and value of a field, `block.port.field`, as the pictures had them."""
        return list(self.picture.view.numbers.get(name, ()))

    async def status(self) -> Fields:
        """The engine's status. Raises RefusalError."""
        return await self.client.request("status")

    async def _history(self, topic: str) -> Fields:
        try:
            return await self.client.request("read_history", topic=topic)
        except RefusalError:  # the run has ended
            return {"times": [], "fields": {}, "trail": []}

    async def _poll(self, *requests: Request) -> None:
        for request in requests:
            self.picture.take(request, await self.client.request(request, **REQUESTS[request]))
