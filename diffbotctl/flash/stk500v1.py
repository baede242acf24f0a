"""Procedures of the stock bootloaders of Uno and Nano, STK500 version 1, sans-IO.

After Atmel's application note AVR061, with the commands that optiboot and ATmegaBOOT know. Each
command is at an address of its own, so a page can be written at any time and in any order. A
command with a lost byte leaves the bootloader waiting for the rest until it starts the program, so
nothing is repeated here: the owner of the port resets the board and begins again.
"""

from __future__ import annotations

from collections.abc import Generator
from typing import NamedTuple

from diffbotctl.drivers.board_ports import LostError, VerifyMismatchError
from diffbotctl.flash.board_session import JobProgress
from diffbotctl.flash.intel_hex import ERASED
from diffbotctl.links import stk500v1_frames as frames

PAGE_BYTES = 128  # of an ATmega328P
FLASH_BYTES_MAX = 0x7800  # bytes below the larger of the two bootloaders


class SyncedRequest(NamedTuple):
    """Send this command and wait for its reply with `size` bytes of data."""

    body: bytes
    size: int = 0

    def wire(self) -> bytes:
        return frames.message(self.body)


SYNC = SyncedRequest(bytes([frames.SYNC]))  # finds out whether a bootloader is there

Procedure = Generator[SyncedRequest | JobProgress, bytes | None, None]


def identify(device: str, into: bytearray) -> Procedure:
    """Read the chip's signature into `into`. Raises LostError."""
    into += yield from _request(device, SyncedRequest(bytes([frames.SIGNATURE]), 3), "identify")


def write(device: str, image: bytes) -> Procedure:
    """Write whole pages, then read them back. Raises LostError, VerifyMismatchError."""
    size = len(image)
    for address in range(0, size, PAGE_BYTES):
        page = image[address : address + PAGE_BYTES]
        action = f"write the page at 0x{address:05X}"
        yield from _load_address(device, address)
        header = bytes([frames.PROGRAM, *len(page).to_bytes(2, "big"), frames.FLASH])
        yield from _request(device, SyncedRequest(header + page), action)
        yield JobProgress("writing", address + len(page), size)
    for address in range(0, size, PAGE_BYTES):
        page = image[address : address + PAGE_BYTES]
        read_back = yield from _read_page(device, address, len(page))
        for offset, (expected, actual) in enumerate(zip(page, read_back, strict=True)):
            if expected != actual:
                raise VerifyMismatchError(device, address + offset, expected, actual)
        yield JobProgress("verifying", address + len(page), size)


def read(device: str, into: bytearray) -> Procedure:
    """Read the program on the board into `into`, without the erased rest. Raises LostError."""
    for address in range(0, FLASH_BYTES_MAX, PAGE_BYTES):
        into += yield from _read_page(device, address, PAGE_BYTES)
        yield JobProgress("reading", address + PAGE_BYTES, FLASH_BYTES_MAX)
    while into and into[-1] == ERASED:
        into.pop()


def leave() -> Procedure:
    """Let the program run. Its first sign of life is the proof: the reply may get lost."""
    yield SyncedRequest(bytes([frames.LEAVE]))


Reply = Generator[SyncedRequest | JobProgress, bytes | None, bytes]


def _load_address(device: str, address: int) -> Reply:
    word_address = (address // 2).to_bytes(2, "little")
    request = SyncedRequest(bytes([frames.LOAD_ADDRESS, *word_address]))
    return (yield from _request(device, request, "take an address"))


def _read_page(device: str, address: int, size: int) -> Reply:
    yield from _load_address(device, address)
    request = bytes([frames.READ, *size.to_bytes(2, "big"), frames.FLASH])
    action = f"read the page at 0x{address:05X}"
    return (yield from _request(device, SyncedRequest(request, size), action))


def _request(device: str, request: SyncedRequest, action: str) -> Reply:
    reply = yield request
    if reply is None:
        raise LostError(device, action)
    return reply
