"""A page without a browser: a web socket of `diffbotctl web` with a session, also as a load.

`python -m tests.support.plain_page NAME` starts the server of the engine's page, opens one
page and reads it. `--sockets` adds connections that send nothing, `--frames` big frames of other
pages, `--refused` requests that it must refuse, `--slow` a page that never reads.
"""

from __future__ import annotations

import argparse
import asyncio
import json
import os
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from typing import Any, Self

import aiohttp

from tests.support.page_server import PageServer, serving

TIMEOUT_S = 60.0  # for what must come; a test fails by itself afterwards
BIG_FRAME_BYTES = 1 << 20
REFUSED_PERIOD_S = 0.005  # from one refused request to the next


class PlainPage:
    """A web socket with the `headers` of a session."""

    def __init__(self, server: PageServer, headers: dict[str, str]) -> None:
        self.address = f"{server.scheme}://127.0.0.1:{server.port}"
        self.headers = headers

    async def __aenter__(self) -> Self:
        self.session = aiohttp.ClientSession()
        self.socket = await self.session.ws_connect(
            f"{self.address}/socket", headers=self.headers, ssl=False, max_msg_size=1 << 20
        )
        return self

    async def __aexit__(self, *_: object) -> None:
        await self.session.close()

    async def until(self, seen: Callable[[dict[str, Any]], bool]) -> dict[str, Any] | None:
        """Read until `seen(message)`; returns that message, or None when the socket is closed."""
        async with asyncio.timeout(TIMEOUT_S):
            async for message in self.socket:
                fields: dict[str, Any] = json.loads(message.data)
                if seen(fields):
                    return fields
        return None

    async def send(self, **fields: object) -> None:
        """Send one command."""
        await self.socket.send_str(json.dumps(fields))


async def _hold_sockets(port: int, count: int) -> None:
    """Keep `count` connections open that send nothing; those that are dropped come again."""
    while True:
        writers = []
        for _ in range(count):
            with suppress(OSError):
                writers.append((await asyncio.open_connection("127.0.0.1", port))[1])
        await asyncio.sleep(1.0)
        for writer in writers:
            writer.close()


async def _send_frames(server: PageServer, headers: dict[str, str]) -> None:
    """Send big frames, one page after the other: each is disconnected for it."""
    while True:
        with suppress(aiohttp.ClientError, OSError):
            async with PlainPage(server, headers) as page:
                await page.socket.send_str("x" * BIG_FRAME_BYTES)
                await page.until(lambda fields: False)


async def _send_refused(server: PageServer) -> None:
    """No session, a wrong code, a wrong Origin and a wrong Host, one after the other."""
    address = f"{server.scheme}://127.0.0.1:{server.port}"
    async with aiohttp.ClientSession() as session:
        while True:
            for method, path, headers in (
                ("GET", "/session", {}),
                ("POST", "/session", {"Origin": address}),
                ("GET", "/socket", {"Origin": "https://stranger.example"}),
                ("GET", "/", {"Host": "stranger.example"}),
            ):
                with suppress(aiohttp.ClientError, OSError):
                    async with session.request(
                        method, address + path, headers=headers, data="wrong", ssl=False
                    ) as reply:
                        await reply.read()
                await asyncio.sleep(REFUSED_PERIOD_S)


async def _never_read(server: PageServer, headers: dict[str, str]) -> None:
    """Open a page and read nothing; one that is disconnected for it comes again."""
    while True:
        with suppress(aiohttp.ClientError, OSError):
            async with PlainPage(server, headers) as page:
                while not page.socket.closed:
                    await asyncio.sleep(1.0)


async def _load(
    server: PageServer, sockets: int, frames: bool, refused: bool, is_slow: bool
) -> None:
    headers = server.enter(server.next_link())
    others = []
    if refused:
        others.append(asyncio.create_task(_send_refused(server)))
    if is_slow:
        others.append(asyncio.create_task(_never_read(server, headers)))
    if sockets:
        others.append(asyncio.create_task(_hold_sockets(server.port, sockets)))
    if frames:
        others.append(asyncio.create_task(_send_frames(server, headers)))
    async with PlainPage(server, headers) as page:
        async for _ in page.socket:
            pass


def main() -> None:
    """Be a load until this process is ended."""
    parser = argparse.ArgumentParser()
    parser.add_argument("engine")
    parser.add_argument("--sockets", type=int, default=0)
    for name in ("--frames", "--refused", "--slow"):
        parser.add_argument(name, action="store_true")
    options = parser.parse_args()
    folder = Path(os.environ["XDG_RUNTIME_DIR"])
    with serving(folder, "--engine", options.engine) as server:
        asyncio.run(_load(server, options.sockets, options.frames, options.refused, options.slow))


if __name__ == "__main__":
    main()
