"""The protocol of the Mega's stock bootloader, STK500 version 2, sans-IO.

After Atmel's application note AVR068. A conversation is a generator: it yields what to ask and is
sent the answer, so that whoever owns the port decides how to wait.
"""

from __future__ import annotations

from collections.abc import Generator
from typing import NamedTuple

from diffbotctl.board.progress import FlashProgress
from diffbotctl.drivers.board_errors import RefusedError, VerifyMismatchError, WrongSignatureError
from diffbotctl.flash.intel_hex import ERASED, PAGE, ROOM
from diffbotctl.links.stk500_frames import LEAVE, SIGN_ON, message

LOAD_ADDRESS = 0x06
PROGRAM, READ, SPI_MULTI = 0x13, 0x14, 0x1D
READ_SIGNATURE = 0x30  # the chip's own serial command
OK = 0
MEGA_2560 = "1e9801"


class BootloaderRequest(NamedTuple):
    """Send this command and wait for its answer."""

    body: bytes

    def wire(self, sequence: int) -> bytes:
        """Its bytes."""
        return message(sequence, self.body)


HELLO = BootloaderRequest(bytes([SIGN_ON]))
"""is a bootloader there?"""


BootloaderSession = Generator[BootloaderRequest | FlashProgress, bytes, None]


def identify(device: str) -> BootloaderSession:
    """Make sure that the chip is an ATmega2560. Raises WrongSignatureError, RefusedError."""
    signature = b""
    for index in range(3):
        answer = yield BootloaderRequest(bytes([SPI_MULTI, 4, 4, 0, READ_SIGNATURE, 0, index, 0]))
        _check(device, answer, SPI_MULTI, "read its signature", 7)
        signature += answer[5:6]
    if signature.hex() != MEGA_2560:
        raise WrongSignatureError(device, signature.hex())


def write(device: str, image: bytes) -> BootloaderSession:
    """Write whole pages, every one and in order from address 0, then read them back.

    The stock bootloader erases the next page at each write, whatever the address: so no page is
    left out and none is written twice. Raises RefusedError, VerifyMismatchError.
    """
    yield from _load(device, 0)
    for at in range(0, len(image), PAGE):
        page = image[at : at + PAGE]
        head = bytes([PROGRAM, *len(page).to_bytes(2, "big"), 0xC1, 10, 0x40, 0x4C, 0x20, 0, 0])
        answer = yield BootloaderRequest(head + page)
        _check(device, answer, PROGRAM, f"write the page at 0x{at:05X}")
        yield FlashProgress("writing", at + len(page), len(image))
    yield from _load(device, 0)
    for at in range(0, len(image), PAGE):
        got = yield from _page(device, at)
        _compare(device, at, image[at : at + PAGE], got)
        yield FlashProgress("verifying", at + PAGE, len(image))


def read(device: str, into: bytearray) -> BootloaderSession:
    """Read the program on the board into `into`, without the erased rest. Raises RefusedError."""
    yield from _load(device, 0)
    for at in range(0, ROOM, PAGE):
        into += yield from _page(device, at)
        yield FlashProgress("reading", at + PAGE, ROOM)
    while into and into[-1] == ERASED:
        into.pop()


def leave(device: str) -> BootloaderSession:
    """Let the program run. Raises RefusedError."""
    answer = yield BootloaderRequest(bytes([LEAVE, 1, 1]))
    _check(device, answer, LEAVE, "start the program")


def _load(device: str, address: int) -> BootloaderSession:
    # The bootloader doubles the word address and finds the upper half of the flash by its top bits.
    answer = yield BootloaderRequest(
        bytes([LOAD_ADDRESS, *(address // 2 | 1 << 31).to_bytes(4, "big")])
    )
    _check(device, answer, LOAD_ADDRESS, "take an address")


def _page(device: str, at: int) -> Generator[BootloaderRequest | FlashProgress, bytes, bytes]:
    answer = yield BootloaderRequest(bytes([READ, *PAGE.to_bytes(2, "big"), 0x20]))
    _check(device, answer, READ, f"read the page at 0x{at:05X}", PAGE + 3)
    return answer[2 : 2 + PAGE]


def _check(device: str, answer: bytes, command: int, what: str, least: int = 2) -> None:
    if len(answer) < least or answer[0] != command or answer[1] != OK:
        raise RefusedError(device, what)


def _compare(device: str, at: int, wanted: bytes, got: bytes) -> None:
    for offset, (want, have) in enumerate(zip(wanted, got, strict=True)):
        if want != have:
            raise VerifyMismatchError(device, at + offset, want, have)
