"""Makes the image of the RP2040 from the program: the checksum of its boot code, and the UF2 file.

PYTHONPATH=.. python3 rp2040_image.py PROGRAM.bin IMAGE.uf2
"""

import struct
import sys
from pathlib import Path

from diffbotctl.links import uf2_format as uf2


def with_checksum(program: bytes) -> bytes:
    """The program with the checksum of its boot code in place."""
    boot = program[: uf2.BOOT_SIZE]
    return boot + struct.pack("<I", uf2.boot_checksum(boot)) + program[uf2.BOOT_SIZE + 4 :]


def uf2_file(program: bytes) -> bytes:
    """The UF2 file of a program at the start of the flash."""
    pages = [program[at : at + uf2.PAYLOAD] for at in range(0, len(program), uf2.PAYLOAD)]
    blocks = []
    for number, page in enumerate(pages):
        at = uf2.FLASH_START + number * uf2.PAYLOAD
        magic = uf2.FIRST_MAGIC, uf2.SECOND_MAGIC
        place = at, uf2.PAYLOAD, number, len(pages)
        head = uf2.HEAD.pack(*magic, uf2.HAS_FAMILY, *place, uf2.RP2040_FAMILY)
        block = head + page.ljust(uf2.PAYLOAD, b"\xff")
        blocks.append(block.ljust(uf2.BLOCK - 4, b"\0") + struct.pack("<I", uf2.LAST_MAGIC))
    return b"".join(blocks)


if __name__ == "__main__":
    source, image = map(Path, sys.argv[1:])
    image.write_bytes(uf2_file(with_checksum(source.read_bytes())))
