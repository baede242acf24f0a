"""Common to all serial links: the interface of a link protocol, and the capacity of the line.

A link protocol is sans-IO: it takes bytes and times, and returns messages and bytes. How the bytes
are split between calls makes no difference to the messages.

Each direction of the line has its own wire. Telemetry is the larger load: the host sends at most
one command for each frame of the board, and a command is shorter than any frame.
"""

from __future__ import annotations

from typing import NamedTuple, Protocol

from diffbotctl.messages import Duty, Message, Wheels

LinkOutput = list[tuple[str, Message]]  # (output port, message) pairs, in order

CRYSTAL_HZ = 16_000_000  # of both kinds of board
BITS_PER_BYTE = 10  # on the wire: start bit, eight data bits, stop bit
USB_BAUD = 115_200  # of the board's USB port, always
EDGE_FRAME_BYTES = 22  # counts, edge times, duty, one sensor, command in force, framing, CRC
INERTIAL_FRAME_BYTES = 24  # with the turn of a gyro, and always with edge times
COUNT_FRAME_BYTES = 18  # the same without edge times
RANGE_FRAME_BYTES = 8  # one measurement of a distance sensor that is measured in turn
ROSSERIAL_FRAME_BYTES = 36  # three messages of 12: left ticks, right ticks, range
TELEMETRY_LOAD_MAX = 0.9  # of the capacity; replies, log lines and settings need the rest


def frame_bytes(protocol: str, has_edge_times: bool, has_gyro: bool = False) -> int:
    """Length of one telemetry frame on the wire."""
    if protocol == "rosserial":
        return ROSSERIAL_FRAME_BYTES
    if has_gyro:
        return INERTIAL_FRAME_BYTES
    return EDGE_FRAME_BYTES if has_edge_times else COUNT_FRAME_BYTES


def capacity(baud: int) -> float:
    """Bytes per second at the board's actual rate for `baud`: its clock divider is an integer."""
    divider = round(CRYSTAL_HZ / 8 / baud)
    return CRYSTAL_HZ / 8 / divider / BITS_PER_BYTE


class Refusal(NamedTuple):
    """Why the board behind a port cannot be driven: code, cause and fix of an error."""

    code: str
    cause: str
    fix: str


class LinkProtocol(Protocol):
    """Host side of one link to one board. All times are logical nanoseconds."""

    baud: int  # baud rate that the port must have now
    refusal: Refusal | None  # set when the board cannot be driven; never set after the link was up

    def opened(self, now: int) -> None:
        """The port has been opened, or reopened: forget the board and start the handshake."""

    def closed(self, now: int, cause: str) -> LinkOutput:
        """The port is gone, for `cause`; the messages that report it."""

    def receive(self, now: int, data: bytes) -> LinkOutput:
        """Take `data` from the port; return (output port, message) pairs, in order.

        Output ports are `encoders`, `link`, `text`, `battery` and the names of the robot's sensors.
        """

    def command(self, now: int, command: Wheels | Duty) -> None:
        """Take a new command. It replaces one that has not been sent."""

    def stop(self, now: int) -> None:
        """Discard what waits to be sent; send stops until telemetry shows one."""

    def due(self) -> int:
        """Time of the next call of `send` or `on_time`; NEVER when nothing waits."""

    def send(self, now: int) -> bytes:
        """Bytes to write now, at most one frame; `due` paces the frames by the baud rate."""

    def stop_frame(self) -> bytes:
        """Bytes that stop this board, for the process that sends them when the host has died."""

    def on_time(self, now: int) -> LinkOutput:
        """Messages that are due at `now` without received bytes, such as a link gone stale."""

    @property
    def stopped(self) -> bool:
        """True when the board's telemetry shows that the last stop is in force."""
