"""What the serial links have in common: the interface of a link protocol, and the line's capacity.

A link protocol is sans-IO: it is handed bytes and times, and hands back messages and bytes. Whoever
calls it may feed it byte by byte; the messages that come out are the same.

Each direction of the line has its own wire, and telemetry is always the larger load: a board is
sent at most one command for each frame that it gives, and a command is shorter than any frame.
"""

from __future__ import annotations

from typing import Any, NamedTuple, Protocol

from diffbotctl.messages import Duty, Message, Wheels

LinkOutput = list[tuple[str, Message]]
"""(output port, message) pairs, in order"""

CRYSTAL_HZ = 16_000_000  # of both kinds of board
BITS_PER_BYTE = 10  # on the wire: start, eight, stop
USB_BAUD = 115_200  # of the board's USB port, always
EDGE_FRAME_BYTES = 21  # counts, two edge times, one sensor, command in force, framing, CRC
COUNT_FRAME_BYTES = 17  # the same without edge times
ROSSERIAL_FRAME_BYTES = 36  # three messages of 12: left ticks, right ticks, range
TELEMETRY_LOAD_MAX = 0.9  # of the capacity; time answers, log lines and settings need the rest


def frame_bytes(protocol: str, has_edge_times: bool) -> int:
    """Bytes of one telemetry frame."""
    if protocol == "rosserial":
        return ROSSERIAL_FRAME_BYTES
    return EDGE_FRAME_BYTES if has_edge_times else COUNT_FRAME_BYTES


def capacity(baud: int) -> float:
    """Bytes a second at `baud` as the board really makes it: its divider is a whole number."""
    divider = round(CRYSTAL_HZ / 8 / baud)
    return CRYSTAL_HZ / 8 / divider / BITS_PER_BYTE


def baud_of(link: Any) -> int:
    """The line's baud rate for the `link` section of a robot file."""
    return USB_BAUD if link.uart == 0 else int(link.baud)


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

    def closed(self, now: int, cause: str) -> LinkOutput:
        """The port is gone, for `cause`: what the graph must hear of it."""

    def receive(self, now: int, data: bytes) -> LinkOutput:
        """Take `data` from the port; return (output port, message) pairs, in order.

        Output ports are `encoders`, `link`, `text`, `battery` and the names of the robot's sensors.
        """

    def command(self, now: int, command: Wheels | Duty) -> None:
        """Take a new command. It replaces one that has not gone out yet."""

    def stop(self, now: int) -> None:
        """Discard whatever waits and command a stop, repeated until it shows in the telemetry."""

    def due(self) -> int:
        """When `send` wants to be called next; far in the future when nothing waits."""

    def send(self, now: int) -> bytes:
        """Bytes to write now. At most one frame; pacing by the baud rate is in `due`."""

    def stop_frame(self) -> bytes:
        """The bytes that stop this board, for whoever must send them when the host has died."""

    def on_time(self, now: int) -> LinkOutput:
        """What the passing of time alone has to say, such as a link gone stale."""

    @property
    def stopped(self) -> bool:
        """True when the board's own telemetry shows that the last stop took hold."""
