"""The hub's end of the channel to the engine: commands down, their answers and the news up."""

from __future__ import annotations

import pickle
import socket
import time

from diffbotctl.control_socket.connection import Client, TokenBucket
from diffbotctl.control_socket.dispatch import error_reply
from diffbotctl.control_socket.engine_channel import (
    CommandResult,
    EngineCommand,
    EngineUpdate,
    receive_all,
)
from diffbotctl.control_socket.request_context import CommandDraft

LARGEST = 1 << 20  # bytes of one piece of news
AT_ONCE = 32  # pieces of news taken between two looks at the clients
COMMANDS_PER_SECOND = 500.0  # of all clients together; the engine takes more without strain
MOST_AT_ONCE = 100.0  # commands in one burst
URGENT = ("stop", "leave")  # never refused for want of room, and never given up


class EngineLink:
    """Numbers commands, sends them, and knows whose they were."""

    def __init__(self, channel: socket.socket) -> None:
        channel.setblocking(False)
        self.channel = channel
        self.asked: dict[int, tuple[Client, int | str | None]] = {}
        self.unsent: list[EngineCommand] = []
        self.number = 0
        self.lives = True
        self.pace = TokenBucket(COMMANDS_PER_SECOND, MOST_AT_ONCE, time.monotonic())

    def command(self, client: Client, number: int | str | None, wanted: CommandDraft) -> None:
        """Send what `client` wants; it gets the engine's answer, or a refusal at once."""
        self.number += 1
        made = EngineCommand(self.number, client.number, client.who, *wanted)
        is_urgent = wanted.verb in URGENT
        if not is_urgent and not self.pace.allows(time.monotonic()):
            client.answer({"id": number, **error_reply("engine_busy")})
            return
        self.pace.spend()
        if self.unsent or not self._send(made):
            if not is_urgent:
                client.answer({"id": number, **error_reply("engine_busy")})
                return
            self.unsent.append(made)
        if wanted.verb != "leave":
            self.asked[made.number] = (client, number)
            client.expected += 1
        client.drives = client.drives or wanted.verb == "drive"

    def whisper(self, verb: str) -> None:
        """Send what no client waits for; it may be lost."""
        self.number += 1
        if not self.unsent and self.pace.allows(time.monotonic()):
            self.pace.spend()
            self._send(EngineCommand(self.number, 0, "the hub", verb))

    def retry(self) -> None:
        """Send what did not fit before."""
        while self.unsent and self._send(self.unsent[0]):
            self.unsent.pop(0)

    def news(self) -> list[EngineUpdate]:
        """What the engine has sent. `lives` is False once it has ended or died."""
        if not self.lives:
            return []
        found, self.lives = receive_all(self.channel, AT_ONCE, LARGEST)
        return [EngineUpdate(*each) for each in found]

    def whose(self, said: CommandResult) -> Client | None:
        """Hand an answer to the client that asked, and return it."""
        client, number = self.asked.pop(said.number, (None, None))
        if client is not None:
            client.expected -= 1
            client.answer({"id": number, **error_reply(said.code, said.values)})
        return client

    def _send(self, command: EngineCommand) -> bool:
        try:
            self.channel.send(pickle.dumps(tuple(command), pickle.HIGHEST_PROTOCOL))
        except BlockingIOError:
            return False
        except OSError:
            self.lives = False
        return True
