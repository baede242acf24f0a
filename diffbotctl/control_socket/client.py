"""A client of the control socket: what the commands of the terminal speak through.

A client of the control socket for programs that also draw: it waits for nothing.
"""

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
from diffbotctl.control_socket.protocol import PROTOCOL, LineBuffer, RefusalError, encode_line
from diffbotctl.errors import Problem, RunError, UsageError, closest_match

PATIENCE = 2.0  # s for an answer; the engine looks for commands at each instant
READ = 1 << 16  # bytes at once

Fields = dict[str, Any]


def choose_engine(name: str | None) -> EngineAddress:
    """The engine called `name`, or the only one. Raises UsageError."""
    found = engines()
    named = [engine for engine in found if name is None or engine.name == name]
    if len(named) == 1:
        return named[0]
    names = ", ".join(engine.name for engine in found)
    if not found:
        cause, fix = "no engine is running that you may speak to", "start one: diffbotctl run goal"
    elif name is None:
        cause, fix = f"several engines are running: {names}", f"say which: --engine {found[0].name}"
    elif named:
        cause, fix = f"{len(named)} engines are called '{name}'", "run them with other --name"
    else:
        near = closest_match(name, [engine.name for engine in found])
        cause = f"there is no engine '{name}'"
        fix = f"did you mean {near}?" if near else f"there is {names}"
    raise UsageError(Problem("E-NO-ENGINE", "--engine", cause, fix))


class ControlClient:
    """One connection, greeted. Raises RunError when nobody answers in time, or refuses."""

    def __init__(self, engine: EngineAddress, name: str) -> None:
        self.engine = engine
        self.lines = LineBuffer()
        self.streamed: list[Fields] = []
        self.number = 0
        self.connection = _connected(engine.socket)
        self._send({"hello": PROTOCOL, "name": name})
        self.about = self._answer(time.monotonic() + PATIENCE)
        if not self.about.get("hello"):
            raise _refused(engine.name, self.about)

    def ask(self, verb: str, **fields: Any) -> Fields:
        """Ask, and wait for the answer. Raises RunError when it is a refusal."""
        self.number += 1
        self._send({"id": self.number, "do": verb, **fields})
        deadline = time.monotonic() + PATIENCE
        while True:
            said = self._answer(deadline)
            if said.get("id") == self.number:
                break
            if said.get("ok") is False or said.get("ended"):
                raise _refused(self.engine.name, said)  # of the connection as a whole
            self.streamed.append(said)
        if not said.get("ok"):
            raise _refused(self.engine.name, said)
        return said

    def tell(self, verb: str, **fields: Any) -> None:
        """Ask without waiting; the answer comes with the stream."""
        self._send({"do": verb, **fields})

    def stream(self, until: float | None = None) -> Iterator[Fields]:
        """What comes by itself, up to the end of the run or the monotonic time `until`."""
        while True:
            while self.streamed:
                yield self.streamed.pop(0)
            try:
                said = self._next(until)
            except TimeoutError:
                return
            yield said
            if said.get("ended"):
                return

    def close(self) -> None:
        """Leave."""
        self.connection.close()

    def _send(self, fields: Fields) -> None:
        try:
            self.connection.sendall(encode_line(fields))
        except OSError as error:
            raise _unanswered(self.engine.name, f"{error.strerror}") from error

    def _answer(self, deadline: float) -> Fields:
        try:
            return self._next(deadline)
        except TimeoutError:
            raise _unanswered(self.engine.name, f"nothing came for {PATIENCE:g} s") from None

    def _next(self, deadline: float | None) -> Fields:
        """The next line. Raises TimeoutError at the monotonic time `deadline`."""
        while (data := self.lines.next()) is None:
            left = None if deadline is None else max(deadline - time.monotonic(), 0.001)
            self.connection.settimeout(left)
            try:
                got = self.connection.recv(READ)
            except TimeoutError:
                raise
            except OSError as error:
                raise _unanswered(self.engine.name, f"{error.strerror}") from error
            if not got:
                return {"ended": True}
            self.lines.add(got)
        found: Fields = json.loads(data)
        return found


def _connected(path: Path) -> socket.socket:
    made = socket.socket(socket.AF_UNIX)
    # A full queue makes a blocking connect wait, for so long, and one with a time-out fail at once.
    made.setsockopt(socket.SOL_SOCKET, socket.SO_SNDTIMEO, struct.pack("ll", int(PATIENCE), 0))
    try:
        made.connect(str(path))
    except OSError as error:
        raise _unanswered(path.stem, f"{error.strerror or error}") from error
    return made


def _unanswered(name: str, cause: str) -> RunError:
    fix = "`diffbotctl stop` ends the engine itself, by a signal"
    return RunError(Problem("E-NO-ANSWER", name, f"the engine does not answer: {cause}", fix))


def _refused(name: str, said: Fields) -> RunError:
    if said.get("ended"):
        return _unanswered(name, "the run has ended")
    code, cause = said.get("error", "E-PROTOCOL"), said.get("cause", "it speaks otherwise")
    return RunError(Problem(code, name, cause, said.get("fix", "")))


LONGEST = 1 << 20  # bytes of an answer; that with all parameters has some ten thousand


class AsyncControlClient:
    """One connection. Answers come as futures, streamed lines go to `heard`.

    `ended` is called once, when the run is over or the engine is gone, unless we left before.
    """

    def __init__(self, heard: Callable[[Fields], None], ended: Callable[[], None]) -> None:
        self.heard, self.ended = heard, ended
        self.number = 0
        self.waiting: dict[int, asyncio.Future[Fields]] = {}
        self.writer: asyncio.StreamWriter | None = None
        self.about: Fields = {}
        self.left = False

    async def connect(self, engine: EngineAddress, name: str) -> None:
        """Greet the engine. Raises RunError when it does not answer."""
        try:
            async with asyncio.timeout(PATIENCE):
                reader, self.writer = await asyncio.open_unix_connection(
                    engine.socket, limit=LONGEST
                )
                self.writer.write(encode_line({"hello": PROTOCOL, "name": name}))
                self.about = json.loads(await reader.readline())
        except (OSError, ValueError, TimeoutError) as error:
            cause = f"the engine does not answer: {error or 'nothing came'}"
            fix = "`diffbotctl stop` ends the engine itself, by a signal"
            raise RunError(Problem("E-NO-ANSWER", engine.name, cause, fix)) from error
        self.reading = asyncio.create_task(self._read(reader))

    async def ask(self, verb: str, **fields: Any) -> Fields:
        """The answer. Raises RefusalError when the engine refuses, or says nothing in time."""
        self.number += 1
        number = self.number
        answer: asyncio.Future[Fields] = asyncio.get_running_loop().create_future()
        self.waiting[number] = answer
        self.send(id=number, do=verb, **fields)
        try:
            async with asyncio.timeout(PATIENCE):
                said = await answer
        except TimeoutError:
            raise RefusalError("E-NO-ANSWER", f"nothing came for {PATIENCE:g} s") from None
        finally:
            self.waiting.pop(number, None)
        if not said.get("ok"):
            raise RefusalError(said.get("error", ""), said.get("cause", ""), said.get("fix", ""))
        return said

    def send(self, **fields: Any) -> None:
        """Say something; nobody waits for the answer."""
        if self.writer is not None and not self.writer.is_closing():
            self.writer.write(encode_line(fields))

    def close(self) -> None:
        """Leave; what was said is still sent."""
        self.left = True
        if self.writer is not None:
            self.writer.close()

    async def _read(self, reader: asyncio.StreamReader) -> None:
        try:
            while data := await reader.readline():
                said = json.loads(data)
                if said.get("ended"):
                    break
                answer = self.waiting.get(said.get("id"))
                if answer is None:
                    self.heard(said)
                elif not answer.done():
                    answer.set_result(said)
        except (OSError, ValueError):
            pass
        if self.left:
            return
        self.close()
        for answer in self.waiting.values():
            if not answer.done():
                gone = {"ok": False, "error": "E-NO-ANSWER", "cause": "the run has ended"}
                answer.set_result(gone)
        self.ended()
