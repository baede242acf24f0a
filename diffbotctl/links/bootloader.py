"""Messages of the Mega's stock bootloader: STK500 version 2, after Atmel's note AVR068."""

from __future__ import annotations

BAUD = 115200
START, TOKEN = 0x1B, 0x0E
SIGN_ON, LEAVE = 0x01, 0x11
NAME = b"AVRISP_2"
"""how it answers a sign-on"""


def message(sequence: int, body: bytes) -> bytes:
    """A command or an answer on the wire."""
    head = bytes([START, sequence & 0xFF, *len(body).to_bytes(2, "big"), TOKEN])
    return head + body + bytes([parity(head + body)])


def parity(data: bytes) -> int:
    """All bytes, exclusive-or; 0 over a whole message."""
    value = 0
    for byte in data:
        value ^= byte
    return value
