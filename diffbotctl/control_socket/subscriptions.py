"""From the engine's news to lines for those who watch: each message is encoded once."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from typing import Any

from diffbotctl.control_socket.connection import Client
from diffbotctl.control_socket.engine_channel import EngineUpdate
from diffbotctl.recording.json_codec import message_encoder


class Subscriptions:
    """Knows the wires and how their messages are written. `wires` maps them to message classes."""

    def __init__(self, wires: dict[str, type]) -> None:
        self.wires = wires
        self.encoders = {wire: message_encoder(kind) for wire, kind in wires.items()}

    def distribute(self, news: EngineUpdate, watchers: Iterable[Client]) -> None:
        """Queue for each of `watchers` what it watches, and tell it what was lost on the way."""
        watched = {client: client.watched for client in watchers}
        wanted: set[str] = set().union(*watched.values())
        for instant in news.instants:
            for wire, data in self._lines(instant, wanted):
                for client, wires in watched.items():
                    if wire in wires:
                        client.push(data)
        for client in watched:
            client.lost += news.lost

    def line(self, wire: str, message: Any) -> bytes:
        """One message as a line of a stream."""
        return b'{"topic": "%s", "message": %s}\n' % (wire.encode(), self.encoders[wire](message))

    def _lines(self, instant: tuple[Any, ...], wanted: set[str]) -> Iterator[tuple[str, bytes]]:
        for wire, message in zip(self.wires, instant[1:], strict=True):
            if message is not None and wire in wanted:
                yield wire, self.line(wire, message)
