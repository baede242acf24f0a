"""The engine's end of the channel to the hub: what happened goes up, what people want comes down.

Nothing here formats text or waits: datagrams of pickled records, dropped and counted when the hub
does not keep up, taken in the loop's idle time.
"""

from __future__ import annotations

import pickle
import socket
from collections.abc import Callable
from typing import Any, NamedTuple

from diffbotctl.engine.profiler import BlockLoad

LARGEST = 1 << 16  # bytes of one command
AT_ONCE = 16  # commands taken in one idle time; more wait for the next
MOST_ANSWERS = 256  # that wait for a hub which does not read


class EngineCommand(NamedTuple):
    """What a person wants: `verb` with its `values`, by `client`, whose name is `who`."""

    number: int
    client: int
    who: str
    verb: str
    values: tuple[Any, ...] = ()


class CommandResult(NamedTuple):
    """What the engine says to command `number`: an empty code when it follows it."""

    number: int
    code: str
    values: tuple[Any, ...] = ()


class EngineUpdate(NamedTuple):
    """One datagram to the hub. `lost` counts the instants that were dropped before these.

    `loads` are what the blocks cost, by name, while somebody watches them.
    """

    lost: int
    instants: list[tuple[Any, ...]]
    answers: list[CommandResult]
    loads: dict[str, BlockLoad] | None = None


def receive_all(
    channel: socket.socket, most: int, largest: int
) -> tuple[list[tuple[Any, ...]], bool]:
    """What has come over a channel that never waits, at most so many records of so many bytes.

    Also whether the other end is still there.
    """
    found: list[tuple[Any, ...]] = []
    while len(found) < most:
        try:
            data = channel.recv(largest)
        except BlockingIOError:
            break
        except OSError:
            data = b""
        if not data:
            return found, False
        found.append(pickle.loads(data))
    return found, True


class EngineChannel:
    """Gathers instants with `record`, sends them with `flush`, and hands out commands."""

    def __init__(self, channel: socket.socket) -> None:
        self.channel = channel
        self.pending: list[tuple[Any, ...]] = []
        self.answers: list[CommandResult] = []
        self.loads: dict[str, BlockLoad] | None = None
        self.record: Callable[[tuple[Any, ...]], object] = self.pending.append
        self.lost = 0
        self.is_open = True
        channel.setblocking(False)

    def fileno(self) -> int:
        """The file that becomes readable when a command comes."""
        return self.channel.fileno()

    def answer(self, said: CommandResult) -> None:
        """Answer a command; sent with the next `flush`."""
        if len(self.answers) < MOST_ANSWERS:
            self.answers.append(said)

    def flush(self) -> None:
        """Send what has gathered. A full channel drops the instants and keeps the answers."""
        if not self.is_open:
            self.pending.clear()
            return
        if not self.pending and not self.answers and self.loads is None:
            return
        news = EngineUpdate(self.lost, self.pending, self.answers, self.loads)
        try:
            self.channel.send(pickle.dumps(tuple(news), pickle.HIGHEST_PROTOCOL))
        except BlockingIOError:
            self.lost += len(self.pending)
        except OSError:
            self._close()
        else:
            self.lost = 0
            self.loads = None
            self.answers.clear()
        self.pending.clear()

    def receive(self) -> list[EngineCommand]:
        """What people want, in order; at most AT_ONCE. `is_open` is False once the hub is gone."""
        if not self.is_open:
            return []
        found, lives = receive_all(self.channel, AT_ONCE, LARGEST)
        if not lives:
            self._close()
        return [EngineCommand(*each) for each in found]

    def close(self) -> None:
        """Send the last of it, and let the hub know that this was all."""
        self.flush()
        self._close()

    def _close(self) -> None:
        if self.is_open:
            self.is_open = False
            self.channel.close()
