"""The format of UF2 files, and what the RP2040's boot ROM expects of a program.

github.com/microsoft/uf2 describes the format, section 2.8 of the RP2040 data sheet the boot ROM.
"""

from __future__ import annotations

import struct

BLOCK, PAYLOAD_MAX = 512, 476  # bytes of a block, and at most of the program in it
PAYLOAD = 256  # of it in each block for an RP2040
HEAD = struct.Struct("<8I")
FIRST_MAGIC, SECOND_MAGIC, LAST_MAGIC = 0x0A324655, 0x9E5D5157, 0x0AB16F30
HAS_FAMILY, RP2040_FAMILY = 0x2000, 0xE48BFF56
FLASH_START = 0x10000000
BOOT_SIZE = 252  # bytes of the boot code, which its checksum follows
INFO_FILE = "INFO_UF2.TXT"  # on the drive of a board that waits for a program
RP2040_DRIVE = "RPI-RP2"  # its name, and the Board-ID in that file
_POLYNOMIAL = 0x04C11DB7


def boot_checksum(boot: bytes) -> int:
    """The boot ROM's CRC-32: the highest bit first, from all ones, not inverted."""
    value = 0xFFFFFFFF
    for byte in boot:
        value ^= byte << 24
        for _ in range(8):
            value = (value << 1 ^ (_POLYNOMIAL if value >> 31 else 0)) & 0xFFFFFFFF
    return value
