"""Clients of the control socket: one that waits for replies, and one for asyncio programs."""

from __future__ import annotations

import asyncio
import json
import socket
import struct
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

from diffbotctl.control_socket.address import EngineAddress, engines
from diffbotctl.control_socket.far_engine import EngineTime, SshConnection, no_engine, person
from diffbotctl.control_socket.protocol import (
    PROTOCOL,
    Fields,
    LineBuffer,
    RefusalError,
    encode_line,
)
from diffbotctl.control_socket.requests import TEXT_MAX_LENGTH
from diffbotctl.errors import Problem, RunError, UsageError, UserError, closest_match
from diffbotctl.printable import printable_values

REPLY_TIMEOUT_S = 2.0  # the engine reads commands at each instant
FAR_CONNECT_TIMEOUT_S = 10.0  # for ssh to log in
READ_BYTES = 1 << 16  # at once
REPLY_MAX_BYTES = 1 << 20  # the one with all parameters has some ten thousand


def choose_engine(name: str | None, at: str = "") -> EngineAddress:
    """The engine called `name`, or the only one. Raises UsageError.

    On the computer `at` it is looked for when a client connects.
    """
    if at:
        return EngineAddress(name or "", Path(), None, at)
    running = engines()
    named = [engine for engine in running if name is None or engine.name == name]
    if len(named) == 1:
        return named[0]
    names = ", ".join(engine.name for engine in running)
    code, place = "E-NO-ENGINE", "--engine"
    if not running:
        place = place if name else "engine"  # the option may be unknown to who did not give it
        cause = "nothing is running"
        fix = "start one in another terminal: diffbotctl run goal"
    elif name is None:
        code, cause = "E-SEVERAL-ENGINES", f"several engines are running: {names}"
        fix = f"choose one: --engine {running[0].name}"
    elif named:
        code, cause = "E-SEVERAL-ENGINES", f"{len(named)} engines are called '{name}'"
        fix = "give them different names with --name"
    else:
        near = closest_match(name, [engine.name for engine in running])
        cause = f"there is no engine '{name}'"
        fix = f"did you mean {near}?" if near else f"there is {names}"
    raise UsageError(Problem(code, place, cause, fix))


class ControlClient:
    """A connection after its hello. Raises RunError when the engine does not answer, or refuses.

    `about` is the engine's hello. `deadline`: monotonic time by which all must be answered.
    """

    def __init__(self, engine: EngineAddress, name: str, deadline: float | None = None) -> None:
        self.engine = engine
        self.deadline = deadline
        self.lines = LineBuffer()
        self.streamed: list[Fields] = []
        self.number = 0
        self.time = EngineTime()
        self.ssh = SshConnection(engine.at, engine.name) if engine.at else None
        self.connection = _connect(engine.socket) if self.ssh is None else self.ssh.socket
        try:
            self._greet(name)
        except BaseException:
            self.close()
            raise

    def _greet(self, name: str) -> None:
        self._send({"hello": PROTOCOL, "name": _client_name(self.engine, name)})
        is_far = self.ssh is not None
        self.about = self._reply(self._limit(FAR_CONNECT_TIMEOUT_S if is_far else REPLY_TIMEOUT_S))
        if not self.about.get("hello"):
            raise self._refusal(self.about)
        if is_far:
            self.request("status")  # for the engine's time

    def _limit(self, timeout: float) -> float:
        end = time.monotonic() + timeout
        return end if self.deadline is None else min(end, self.deadline)

    def request(self, method: str, **fields: Any) -> Fields:
        """Send a request and wait for its reply. Raises RunError when it is refused."""
        self.number += 1
        if method == "drive" and self.ssh is not None:
            fields = {**fields, **self.time.lease()}
        self._send({"id": self.number, "method": method, **fields})
        deadline = self._limit(REPLY_TIMEOUT_S)
        while (reply := self._reply(deadline)).get("id") != self.number:
            if reply.get("ok") is False or reply.get("ended"):
                raise self._refusal(reply)  # the whole connection
            self.streamed.append(reply)
        if not reply.get("ok"):
            raise self._refusal(reply)
        return reply

    def send(self, method: str, **fields: Any) -> None:
        """Send a request without waiting; its reply comes with the stream."""
        self._send({"method": method, **fields})

    def stream(self, until: float | None = None) -> Iterator[Fields]:
        """The lines of subscriptions, up to the end of the run or the monotonic time `until`."""
        while True:
            while self.streamed:
                yield self.streamed.pop(0)
            try:
                line = self._next(until)
            except TimeoutError:
                return
            yield line
            if line.get("ended"):
                return

    def close(self) -> None:
        self.connection.close()
        if self.ssh is not None:
            self.ssh.close()

    def _send(self, fields: Fields) -> None:
        try:
            self.connection.sendall(encode_line(fields))
        except OSError as error:
            raise self._no_answer(f"{error.strerror}") from error

    def _no_answer(self, cause: str) -> RunError:
        if self.ssh is not None:
            return self.ssh.failure(cause)
        return _no_answer(self.engine.name, cause)

    def _refusal(self, reply: Fields) -> UserError:
        if self.ssh is not None and "engines" in reply:
            return no_engine(self.engine.at, self.engine.name, reply)
        if self.ssh is not None and reply.get("ended"):
            return self.ssh.failure("the connection has ended")
        return _refused(self.engine.name or self.engine.at, reply)

    def _reply(self, deadline: float) -> Fields:
        try:
            return self._next(deadline)
        except TimeoutError:
            cause = f"nothing came for {REPLY_TIMEOUT_S:g} s"
            raise self._no_answer(cause) from None

    def _next(self, deadline: float | None) -> Fields:
        """The next line. Raises TimeoutError at the monotonic time `deadline`."""
        while (line := self.lines.next()) is None:
            remaining = None if deadline is None else max(deadline - time.monotonic(), 0.001)
            self.connection.settimeout(remaining)
            try:
                data = self.connection.recv(READ_BYTES)
            except TimeoutError:
                raise
            except OSError as error:
                raise self._no_answer(f"{error.strerror}") from error
            if not data:
                return {"ended": True}
            self.lines.add(data)
        fields: Fields = json.loads(line)
        if self.ssh is not None:
            self.time.note(fields)
        return fields


def _client_name(engine: EngineAddress, name: str) -> str:
    """The name for the log; that of a far client names its user, because its process does not."""
    return f"{name} of {person()}"[:TEXT_MAX_LENGTH] if engine.at else name


def _connect(path: Path) -> socket.socket:
    connection = socket.socket(socket.AF_UNIX)
    # With a full queue a blocking connect waits this long; one with a timeout fails at once.
    timeout = struct.pack("ll", int(REPLY_TIMEOUT_S), 0)
    connection.setsockopt(socket.SOL_SOCKET, socket.SO_SNDTIMEO, timeout)
    try:
        connection.connect(str(path))
    except OSError as error:
        raise _no_answer(path.stem, f"{error.strerror or error}") from error
    return connection


def _no_answer(name: str, cause: str) -> RunError:
    fix = "`diffbotctl stop` ends the engine itself, by a signal"
    return RunError(Problem("E-NO-ANSWER", name, f"the engine does not answer: {cause}", fix))


def _refused(name: str, reply: Fields) -> RunError:
    if reply.get("ended"):
        return _no_answer(name, "the run has ended")
    code, cause = reply.get("error", "E-PROTOCOL"), reply.get("cause", "it uses another protocol")
    return RunError(Problem(code, name, cause, reply.get("fix", "")))


class AsyncControlClient:
    """A connection of an asyncio program. Subscribed lines, and replies to `send`, go to `on_line`.

    `on_end` is called once, when the run has ended or the engine is gone, but not after `close`.
    """

    def __init__(self, on_line: Callable[[Fields], None], on_end: Callable[[], None]) -> None:
        self.on_line, self.on_end = on_line, on_end
        self.number = 0
        self.waiting: dict[int, asyncio.Future[Fields]] = {}
        self.writer: asyncio.StreamWriter | None = None
        self.about: Fields = {}
        self.is_closed = False
        self.time = EngineTime()
        self.ssh: SshConnection | None = None

    async def connect(self, engine: EngineAddress, name: str) -> None:
        """Connect and greet the engine. Raises RunError when it does not answer."""
        if engine.at:
            self.ssh = SshConnection(engine.at, engine.name)
            self.ssh.socket.setblocking(False)
        try:
            async with asyncio.timeout(FAR_CONNECT_TIMEOUT_S if engine.at else REPLY_TIMEOUT_S):
                if self.ssh is None:
                    reader, self.writer = await asyncio.open_unix_connection(
                        engine.socket, limit=REPLY_MAX_BYTES
                    )
                else:
                    reader, self.writer = await asyncio.open_unix_connection(
                        sock=self.ssh.socket, limit=REPLY_MAX_BYTES
                    )
                hello = {"hello": PROTOCOL, "name": _client_name(engine, name)}
                self.writer.write(encode_line(hello))
                self.about = json.loads(await reader.readline())
        except (OSError, ValueError, TimeoutError) as error:
            if self.ssh is not None:
                raise self.ssh.failure(str(error or "nothing came")) from error
            raise _no_answer(engine.name, str(error or "nothing came")) from error
        if self.ssh is not None and "engines" in self.about:
            raise no_engine(engine.at, engine.name, self.about)
        self.reading = asyncio.create_task(self._read(reader))

    async def request(self, method: str, **fields: Any) -> Fields:
        """Send a request and await its reply. Raises RefusalError for a refusal or no reply."""
        self.number += 1
        number = self.number
        future: asyncio.Future[Fields] = asyncio.get_running_loop().create_future()
        self.waiting[number] = future
        self.send(number, method, **fields)
        try:
            async with asyncio.timeout(REPLY_TIMEOUT_S):
                reply = await future
        except TimeoutError:
            cause = f"nothing came for {REPLY_TIMEOUT_S:g} s"
            raise RefusalError("E-NO-ANSWER", cause) from None
        finally:
            self.waiting.pop(number, None)
        if not reply.get("ok"):
            raise RefusalError(reply.get("error", ""), reply.get("cause", ""), reply.get("fix", ""))
        return reply

    def send(self, request_id: int | str, method: str, **fields: Any) -> None:
        """Send a request without waiting; its reply goes to `on_line`."""
        if method == "drive" and self.ssh is not None:
            fields = {**fields, **self.time.lease()}
        if self.writer is not None and not self.writer.is_closing():
            self.writer.write(encode_line({"id": request_id, "method": method, **fields}))

    def close(self) -> None:
        """Disconnect; requests that were made are still sent."""
        self.is_closed = True
        if self.writer is not None:
            self.writer.close()

    async def _read(self, reader: asyncio.StreamReader) -> None:
        try:
            while data := await reader.readline():
                line = printable_values(json.loads(data))  # screens draw its texts
                if self.ssh is not None:
                    self.time.note(line)
                if line.get("ended"):
                    break
                future = self.waiting.get(line.get("id"))
                if future is None:
                    self.on_line(line)
                elif not future.done():
                    future.set_result(line)
        except (OSError, ValueError):
            pass
        if self.is_closed:
            return
        self.close()
        for future in self.waiting.values():
            if not future.done():
                ended = {"ok": False, "error": "E-NO-ANSWER", "cause": "the run has ended"}
                future.set_result(ended)
        self.on_end()
