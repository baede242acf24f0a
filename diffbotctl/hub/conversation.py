"""What is said with one client: its hello, then requests, each with its answer or a command."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from diffbotctl.hub.client import Client
from diffbotctl.hub.desk import Desk, Wanted
from diffbotctl.hub.engine_side import EngineSide
from diffbotctl.hub.verbs import follow
from diffbotctl.links.control import RefusalError, check_hello, request

Log = Callable[[dict[str, Any]], None]


class Conversation:
    """Answers from the desk, or sends what is wanted to the engine; who asked is logged."""

    def __init__(self, desk: Desk, engine: EngineSide, log: Log) -> None:
        self.desk = desk
        self.engine = engine
        self.log = log

    def line(self, client: Client, data: bytes) -> None:
        """Take one line of `client`. Raises RefusalError for a hello that ends it all."""
        if not client.name:
            client.name = check_hello(request(data)) or "client"
            self.log({"event": "connected", "name": client.name, **client.peer._asdict()})
            return
        number: int | str | None = None
        try:
            asked = request(data)
            number = asked.number
            said = follow(self.desk, client, asked)
        except RefusalError as refusal:
            client.answer({"id": number, **refusal.fields()})
            return
        if isinstance(said, Wanted):
            if said.verb != "drive":
                self.log({"event": said.verb, "values": list(said.values), "by": client.who})
            self.engine.command(client, number, said)
        else:
            client.answer({"id": number, "ok": True, **said})
