"""A viewer without a window, written from the specification of Foxglove's WebSocket protocol.

It has none of the server's code, so that both must agree with the specification.
`python -m tests.support.foxglove_viewer ADDRESS drive` publishes a velocity until it is ended,
`... ADDRESS watch` subscribes to every topic.
"""

from __future__ import annotations

import asyncio
import json
import re
import struct
import subprocess
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any, NamedTuple, Self

import aiohttp

from tests.support.command_process import start_in_pipe
from tests.support.page_server import free_port
from tests.support.running import command

ADDRESS = re.compile(r"ws://127\.0\.0\.1:(\d+)/(\S+)")
TIMEOUT_S = 60.0  # for what must come; a test fails by itself afterwards
DRIVE_PERIOD_S = 0.05
Fields = dict[str, Any]


class DataFrame(NamedTuple):
    """A message of a channel."""

    topic: str
    time: int
    message: Fields


class FoxgloveViewer:
    """A connection to `address`; `frames` are all JSON operations that have come."""

    def __init__(
        self, address: str, subprotocol: str = "foxglove.sdk.v1", origin: str = ""
    ) -> None:
        self.address = address
        self.subprotocol = subprotocol
        self.headers = {"Origin": origin} if origin else {}
        self.frames: list[Fields] = []
        self.channels: dict[str, Fields] = {}
        self.services: dict[str, Fields] = {}
        self.subscribed: dict[int, str] = {}
        self.numbers = 0

    async def __aenter__(self) -> Self:
        self.session = aiohttp.ClientSession()
        try:
            self.socket = await self.session.ws_connect(
                self.address,
                protocols=[self.subprotocol],
                headers=self.headers,
                max_msg_size=1 << 22,
            )
        except BaseException:
            await self.session.close()
            raise
        return self

    async def __aexit__(self, *_: object) -> None:
        await self.session.close()

    async def operate(self, name: str, **fields: object) -> None:
        """Send a JSON operation."""
        await self.socket.send_str(json.dumps({"op": name, **fields}))

    async def subscribe(self, *topics: str) -> None:
        """Subscribe to topics that were advertised."""
        rows = []
        for topic in topics:
            self.numbers += 1
            self.subscribed[self.numbers] = topic
            rows.append({"id": self.numbers, "channelId": self.channels[topic]["id"]})
        await self.operate("subscribe", subscriptions=rows)

    async def advertise(self, number: int, topic: str, schema_name: str) -> None:
        """Announce an own channel."""
        row = {"id": number, "topic": topic, "encoding": "json", "schemaName": schema_name}
        await self.operate("advertise", channels=[row])

    async def publish(self, number: int, message: Fields) -> None:
        """Publish on an own channel."""
        await self.socket.send_bytes(struct.pack("<BI", 1, number) + json.dumps(message).encode())

    async def call(self, service: str, number: int) -> Fields:
        """Call a service; its response."""
        data = struct.pack("<BIII", 2, self.services[service]["id"], number, 4) + b"json{}"
        await self.socket.send_bytes(data)
        frame = await self.until(lambda frame: frame.get("call") == number)
        response: Fields = frame["response"]
        return response

    async def data(self, topic: str, accepts: Callable[[Fields], bool] = bool) -> DataFrame:
        """The next message of a topic that `accepts`."""
        frame = await self.until(
            lambda frame: frame.get("topic") == topic and accepts(frame["message"])
        )
        return DataFrame(topic, frame["time"], frame["message"])

    async def until(self, seen: Callable[[Fields], bool]) -> Fields:
        """Read until `seen(frame)`; binary frames are given as fields, too."""
        async with asyncio.timeout(TIMEOUT_S):
            while True:
                received = await self.socket.receive()
                if received.type is aiohttp.WSMsgType.TEXT:
                    frame = json.loads(received.data)
                    self._note(frame)
                elif received.type is aiohttp.WSMsgType.BINARY:
                    frame = self._binary(received.data)
                else:
                    raise ConnectionError(f"the server closed the connection: {received}")
                if seen(frame):
                    return dict(frame)

    async def greeted(self) -> None:
        """Read the first messages of the server."""
        await self.until(lambda frame: frame.get("op") == "advertiseServices")

    def _note(self, frame: Fields) -> None:
        self.frames.append(frame)
        if frame["op"] == "advertise":
            self.channels |= {row["topic"]: row for row in frame["channels"]}
        elif frame["op"] == "advertiseServices":
            self.services |= {row["name"]: row for row in frame["services"]}

    def _binary(self, data: bytes) -> Fields:
        if data[0] == 1:
            subscription, time = struct.unpack_from("<IQ", data, 1)
            topic = self.subscribed[subscription]
            return {"topic": topic, "time": time, "message": json.loads(data[13:])}
        if data[0] == 3:
            service, call, length = struct.unpack_from("<III", data, 1)
            body = data[13 + length :]
            return {"service": service, "call": call, "response": json.loads(body)}
        if data[0] == 4:
            request, status, length = struct.unpack_from("<IBI", data, 1)
            end = 10 + length
            return {"asset": request, "status": status, "error": data[10:end], "data": data[end:]}
        raise ValueError(f"a frame of the unknown kind {data[0]}")


def twist(linear: float, angular: float = 0.0) -> Fields:
    """A geometry_msgs/Twist as the Teleop panel publishes it."""
    still = {"x": 0.0, "y": 0.0, "z": 0.0}
    return {"linear": {**still, "x": linear}, "angular": {**still, "z": angular}}


class FoxgloveProcess(NamedTuple):
    """A `diffbotctl foxglove` that viewers can connect to."""

    process: subprocess.Popen[str]
    port: int
    address: str


@contextmanager
def serving_viewers(folder: Path, *words: str) -> Iterator[FoxgloveProcess]:
    """`diffbotctl foxglove words` for the run whose sockets are in `folder`."""
    line, environment = command(folder, "foxglove", "--tcp-port", str(free_port()), *words)
    process = start_in_pipe(line, env=environment)
    lines: list[str] = []
    try:
        assert process.stdout is not None
        for text in process.stdout:
            lines.append(text)
            match = ADDRESS.search(text)
            if match is not None:
                yield FoxgloveProcess(process, int(match[1]), match[0])
                break
        else:
            raise AssertionError(f"it printed no address: {lines}")
    finally:
        process.kill()
        rest = process.communicate()[0]
        assert "Traceback" not in rest and "never awaited" not in rest, rest


async def _work(address: str, task: str) -> None:
    async with FoxgloveViewer(address) as viewer:
        await viewer.greeted()
        if task == "watch":
            await viewer.subscribe(*viewer.channels)
            async for _ in viewer.socket:
                pass
        await viewer.advertise(1, "/cmd_vel", "geometry_msgs/Twist")
        while True:
            await viewer.publish(1, twist(0.1))
            await asyncio.sleep(DRIVE_PERIOD_S)


if __name__ == "__main__":
    asyncio.run(_work(*sys.argv[1:]))
