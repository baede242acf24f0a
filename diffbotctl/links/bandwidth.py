"""How many bytes the boards put on the serial line, and how many the line carries.

Each direction has its own wire, and telemetry is always the larger load: a board is sent at most
one command for each frame that it gives, and a command is shorter than any frame.
"""

from __future__ import annotations

from typing import Any

CRYSTAL = 16_000_000  # Hz; both kinds of board
BITS = 10  # on the wire for each byte: start, eight, stop
USB_BAUD = 115_200
EDGE_FRAME = 21  # bytes: counts, two edge times, one sensor, command in force, framing, CRC
COUNT_FRAME = 17  # bytes: the same without edge times
ROSSERIAL_FRAME = 36  # bytes: three messages of 12, left ticks, right ticks, range
# Time answers, log lines and settings need the rest.
COMFORTABLE = 0.9


def frame_bytes(protocol: str, has_edge_times: bool) -> int:
    """Bytes of one telemetry frame."""
    if protocol == "rosserial":
        return ROSSERIAL_FRAME
    return EDGE_FRAME if has_edge_times else COUNT_FRAME


def capacity(baud: int) -> float:
    """Bytes a second at `baud` as the board really makes it: its divider is a whole number."""
    divider = round(CRYSTAL / 8 / baud)
    return CRYSTAL / 8 / divider / BITS


def baud_of(link: Any) -> int:
    """The line's baud rate; the port that is the USB always runs at 115200."""
    return USB_BAUD if link.uart == 0 else int(link.baud)
