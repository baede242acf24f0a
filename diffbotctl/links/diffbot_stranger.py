"""What answers on a port where our firmware does not: told from the bytes that came."""

from __future__ import annotations

ROSSERIAL = b"\xff\xfe"  # sync byte and protocol version 2
BOOTLOADER = b"AVRISP_2"  # how the stock bootloader names itself
# STK500v2 sign-on: start, sequence 1, length 1, token, command, checksum. A bootloader that waits
# for a program answers it; our firmware and rosserial take it for noise.
SIGN_ON = bytes((0x1B, 1, 0, 1, 0x0E, 1, 0x1B ^ 1 ^ 0 ^ 1 ^ 0x0E ^ 1))


def describe(heard: bytes, baud: int) -> str:
    """Why there is no handshake, and what to do, in words for a person."""
    if not heard:
        return (f"nothing answers at {baud} baud: is the robot switched on, the right port chosen, "
                "RX and TX crossed?")  # fmt: skip
    if BOOTLOADER in heard:
        return "only the bootloader answers: run `diffbotctl flash firmware`"
    if heard.count(ROSSERIAL) >= 2:
        return ("the book's rosserial firmware answers: run `diffbotctl flash firmware`, or set "
                "link: {protocol: rosserial}")  # fmt: skip
    return (f"bytes come that mean nothing at {baud} baud: another baud rate or another firmware; "
            "run `diffbotctl flash firmware` over USB")  # fmt: skip
