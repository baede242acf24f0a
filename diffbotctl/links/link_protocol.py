"""What a link protocol offers to the driver that owns the port.

The protocol is sans-IO: it is handed bytes and times, and hands back messages and bytes. Whoever
calls it may feed it byte by byte; the messages that come out are the same.
"""

from __future__ import annotations

from typing import NamedTuple, Protocol

from diffbotctl.messages import Duty, Message, Wheels


class Refusal(NamedTuple):
    """Why the board behind a port cannot be driven, for a person."""

    code: str
    cause: str
    fix: str


class LinkProtocol(Protocol):
    """The host's half of one link to one board. All times are logical nanoseconds."""

    baud: int
    """the rate that the port must have now"""
    refusal: Refusal | None
    """set when a board that was never met turns out not to be one that can be driven"""

    def opened(self, now: int) -> None:
        """The port has just been opened, or opened again: forget the peer, start negotiating."""

    def closed(self, now: int, cause: str) -> list[tuple[str, Message]]:
        """The port is gone, for `cause`: what the graph must hear of it."""

    def receive(self, now: int, data: bytes) -> list[tuple[str, Message]]:
        """Take `data` from the port; return (output port, message) pairs, in order.

        Output ports are `encoders`, `link`, `text`, `battery` and the names of the robot's sensors.
        """

    def command(self, now: int, wanted: Wheels | Duty) -> None:
        """Take a new command. It replaces one that has not gone out yet."""

    def stop(self, now: int) -> None:
        """Discard whatever waits and command a stop, repeated until it shows in the telemetry."""

    def due(self) -> int:
        """When `send` wants to be called next; far in the future when nothing waits."""

    def send(self, now: int) -> bytes:
        """Bytes to write now. At most one frame; pacing by the baud rate is in `due`."""

    def stop_frame(self) -> bytes:
        """The bytes that stop this board, for whoever must send them when the host has died."""

    def on_time(self, now: int) -> list[tuple[str, Message]]:
        """What the passing of time alone has to say, such as a link gone stale."""

    @property
    def stopped(self) -> bool:
        """True when the board's own telemetry shows that the last stop took hold."""
