"""A client of the control socket for programs that also draw: it waits for nothing."""

from __future__ import annotations

import asyncio
import json
from collections.abc import Callable
from typing import Any

from diffbotctl.errors import Problem, RunError
from diffbotctl.hub.place import Engine
from diffbotctl.links.control import PROTOCOL, RefusalError, line

LONGEST = 1 << 20  # bytes of an answer; that with all parameters has some ten thousand
PATIENCE = 2.0  # s for an answer

Fields = dict[str, Any]


class AsyncCaller:
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

    async def connect(self, engine: Engine, name: str) -> None:
        """Greet the engine. Raises RunError when it does not answer."""
        try:
            async with asyncio.timeout(PATIENCE):
                reader, self.writer = await asyncio.open_unix_connection(
                    engine.socket, limit=LONGEST
                )
                self.writer.write(line({"hello": PROTOCOL, "name": name}))
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
            self.writer.write(line(fields))

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
