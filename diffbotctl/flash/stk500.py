"""Procedures of the Mega's stock bootloader, STK500 version 2, sans-IO.

After Atmel's application note AVR068. A procedure is a generator: it yields requests and is sent
the replies, None for one that did not come, so that the owner of the port decides how to wait; and
it yields how far it is.
"""

from __future__ import annotations

from collections.abc import Generator
from typing import NamedTuple, TypeVar

from diffbotctl.drivers.board_ports import RefusedError, VerifyMismatchError
from diffbotctl.flash.board_session import JobProgress
from diffbotctl.flash.intel_hex import ERASED, FLASH_BYTES_MAX, PAGE_BYTES
from diffbotctl.links.stk500_frames import LEAVE, SIGN_ON, message

LOAD_ADDRESS = 0x06
PROGRAM, READ, SPI_MULTI = 0x13, 0x14, 0x1D
READ_SIGNATURE = 0x30  # the chip's own serial command
OK = 0
TRIES = 4  # of one request: a damaged one or its reply is lost, and is not answered again

Result = TypeVar("Result")


class BootloaderRequest(NamedTuple):
    """Send this command and wait for its reply."""

    body: bytes

    def wire(self, sequence: int) -> bytes:
        return message(sequence, self.body)


HELLO = BootloaderRequest(bytes([SIGN_ON]))  # finds out whether a bootloader is there

Steps = Generator[BootloaderRequest | JobProgress, bytes | None, Result]
Procedure = Steps[None]


def identify(device: str, into: bytearray) -> Procedure:
    """Read the chip's signature into `into`. Raises RefusedError."""
    for index in range(3):
        request = bytes([SPI_MULTI, 4, 4, 0, READ_SIGNATURE, 0, index, 0])
        reply = yield from _request(device, request, "read its signature", 7)
        into += reply[5:6]


def write(device: str, image: bytes) -> Procedure:
    """Write whole pages, every one and in order from address 0, then read them back.

    The stock bootloader erases the next page at each write, whatever the address: so no page is
    left out. A page whose reply was lost is written again with the same bytes: that changes nothing
    in it, and erases a page that is written later, or lies behind the image. Raises RefusedError,
    VerifyMismatchError.
    """
    size = len(image)
    yield from _load_address(device, 0)
    for address in range(0, size, PAGE_BYTES):
        page = image[address : address + PAGE_BYTES]
        header = bytes([PROGRAM, *len(page).to_bytes(2, "big"), 0xC1, 10, 0x40, 0x4C, 0x20, 0, 0])
        action = f"write the page at 0x{address:05X}"
        yield from _request_at(device, address, header + page, action)
        yield JobProgress("writing", address + len(page), size)
    yield from _load_address(device, 0)
    for address in range(0, size, PAGE_BYTES):
        page = yield from _read_page(device, address)
        _compare(device, address, image[address : address + PAGE_BYTES], page)
        yield JobProgress("verifying", address + PAGE_BYTES, size)


def read(device: str, into: bytearray) -> Procedure:
    """Read the program on the board into `into`, without the erased rest. Raises RefusedError."""
    yield from _load_address(device, 0)
    for address in range(0, FLASH_BYTES_MAX, PAGE_BYTES):
        into += yield from _read_page(device, address)
        yield JobProgress("reading", address + PAGE_BYTES, FLASH_BYTES_MAX)
    while into and into[-1] == ERASED:
        into.pop()


def leave() -> Procedure:
    """Let the program run. Its first sign of life is the proof: the reply may get lost."""
    yield BootloaderRequest(bytes([LEAVE, 1, 1]))


def _load_address(device: str, address: int) -> Procedure:
    # The bootloader doubles the word address and finds the upper half of the flash by its top bits.
    word_address = (address // 2 | 1 << 31).to_bytes(4, "big")
    yield from _request(device, bytes([LOAD_ADDRESS, *word_address]), "take an address")


def _read_page(device: str, address: int) -> Steps[bytes]:
    request = bytes([READ, *PAGE_BYTES.to_bytes(2, "big"), 0x20])
    size = PAGE_BYTES + 3
    action = f"read the page at 0x{address:05X}"
    reply = yield from _request_at(device, address, request, action, size)
    return reply[2 : 2 + PAGE_BYTES]


def _request_at(device: str, address: int, body: bytes, action: str, size: int = 2) -> Steps[bytes]:
    """As `_request`, for a command at the loaded address, which the command then advances.

    When a reply is lost, it is not known whether the address has advanced: it is loaded again.
    """
    for _ in range(TRIES):
        reply = yield BootloaderRequest(body)
        if reply:
            return _checked(device, reply, body, action, size)
        yield from _load_address(device, address)
    raise RefusedError(device, f"answer when asked to {action}")


def _request(device: str, body: bytes, action: str, size: int = 2) -> Steps[bytes]:
    """The reply to a command that may be repeated, at least `size` bytes. Raises RefusedError."""
    for _ in range(TRIES):
        reply = yield BootloaderRequest(body)
        if reply:
            return _checked(device, reply, body, action, size)
    raise RefusedError(device, f"answer when asked to {action}")


def _checked(device: str, reply: bytes, body: bytes, action: str, size: int) -> bytes:
    if len(reply) < size or reply[0] != body[0] or reply[1] != OK:
        raise RefusedError(device, action)
    return reply


def _compare(device: str, address: int, written: bytes, read_back: bytes) -> None:
    for offset, (expected, actual) in enumerate(zip(written, read_back, strict=True)):
        if expected != actual:
            raise VerifyMismatchError(device, address + offset, expected, actual)
