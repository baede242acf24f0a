"""UF2 files: reader of a program for the RP2040."""

from __future__ import annotations

from diffbotctl.drivers.board_ports import BadImageError
from diffbotctl.links.uf2_format import (
    BLOCK,
    BOOT_SIZE,
    FIRST_MAGIC,
    FLASH_START,
    HAS_FAMILY,
    HEAD,
    LAST_MAGIC,
    PAYLOAD_MAX,
    RP2040_FAMILY,
    SECOND_MAGIC,
    boot_checksum,
)

FLASH_BYTES_MAX = 0x1FD000  # up to where the settings are


def is_uf2(data: bytes) -> bool:
    """True for the content of a UF2 file."""
    return data[:4] == FIRST_MAGIC.to_bytes(4, "little")


def read_uf2(data: bytes, name: str = "image") -> bytes:
    """The program in a UF2 file for the RP2040, from the start of the flash.

    Raises BadImageError for another chip's, and for a damaged file.
    """
    program = bytearray()
    if not data or len(data) % BLOCK:
        raise BadImageError(name, f"the file is cut short: its length is no multiple of {BLOCK}")
    for number, at in enumerate(range(0, len(data), BLOCK)):
        block = data[at : at + BLOCK]
        first, second, flags, address, size, own, count, family = HEAD.unpack_from(block)
        last = int.from_bytes(block[-4:], "little")
        if (first, second, last) != (FIRST_MAGIC, SECOND_MAGIC, LAST_MAGIC) or size > PAYLOAD_MAX:
            raise BadImageError(name, f"block {number} is not one of a UF2 file: it is damaged")
        if not flags & HAS_FAMILY or family != RP2040_FAMILY:
            raise BadImageError(name, "it was built for another chip than the RP2040 of a Pico")
        if (own, count) != (number, len(data) // BLOCK):
            raise BadImageError(
                name, f"block {number} is missing: the file is cut short or damaged"
            )
        if address != FLASH_START + len(program):
            raise BadImageError(
                name, f"it is not one program: a gap or an overlap at block {number}"
            )
        program += block[HEAD.size : HEAD.size + size]
    if len(program) > FLASH_BYTES_MAX:
        raise BadImageError(name, f"{len(program)} bytes do not fit ({FLASH_BYTES_MAX})")
    return bytes(program)


def is_rp2040(program: bytes) -> bool:
    """True for a program that the RP2040's boot ROM starts: its boot code has its checksum."""
    expected = program[BOOT_SIZE : BOOT_SIZE + 4]
    return len(expected) == 4 and boot_checksum(program[:BOOT_SIZE]) == int.from_bytes(
        expected, "little"
    )
