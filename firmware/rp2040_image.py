"""Makes the image of the RP2040 from the program: the checksum of its boot code, and the UF2 file.

python firmware/rp2040_image.py PROGRAM.bin IMAGE.uf2
"""

import struct
import sys
from pathlib import Path

BOOT_SIZE = 252  # bytes of boot code before its checksum (RP2040 data sheet, section 2.8.1.3)
POLYNOMIAL = 0x04C11DB7
FLASH = 0x10000000
# UF2 file format: blocks of 512 bytes, each with 256 of the program.
PAYLOAD, BLOCK = 256, 512
MAGIC = (0x0A324655, 0x9E5D5157, 0x0AB16F30)
HAS_FAMILY, RP2040_FAMILY = 0x2000, 0xE48BFF56


def checksum(boot: bytes) -> int:
    """The boot ROM's CRC-32: the highest bit first, from all ones, not inverted."""
    value = 0xFFFFFFFF
    for byte in boot:
        value ^= byte << 24
        for _ in range(8):
            value = (value << 1 ^ (POLYNOMIAL if value >> 31 else 0)) & 0xFFFFFFFF
    return value


def with_checksum(program: bytes) -> bytes:
    """The program with the checksum of its boot code in place."""
    boot = program[:BOOT_SIZE]
    return boot + struct.pack("<I", checksum(boot)) + program[BOOT_SIZE + 4 :]


def uf2(program: bytes) -> bytes:
    """The UF2 file of a program at the start of the flash."""
    pages = [program[at : at + PAYLOAD] for at in range(0, len(program), PAYLOAD)]
    blocks = []
    for number, page in enumerate(pages):
        at = FLASH + number * PAYLOAD
        head = struct.pack(
            "<8I", *MAGIC[:2], HAS_FAMILY, at, PAYLOAD, number, len(pages), RP2040_FAMILY
        )
        block = head + page.ljust(PAYLOAD, b"\xff")
        blocks.append(block.ljust(BLOCK - 4, b"\0") + struct.pack("<I", MAGIC[2]))
    return b"".join(blocks)


if __name__ == "__main__":
    source, image = map(Path, sys.argv[1:])
    image.write_bytes(uf2(with_checksum(source.read_bytes())))
