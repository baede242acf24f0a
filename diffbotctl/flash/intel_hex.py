"""Intel hex files: reader of one block without gaps, and writer."""

from __future__ import annotations

import re

from diffbotctl.drivers.board_ports import BadImageError
from diffbotctl.flash.uf2 import is_rp2040
from diffbotctl.links.diffbot_frames import BoardCode

PAGE_BYTES = 256  # bytes; the chip erases and writes whole pages
FLASH_BYTES_MAX = 0x3E000  # bytes below the bootloader of a Mega 2560
ERASED = 0xFF
DATA, END, SEGMENT, LINEAR = 0, 1, 2, 4
RECORD_BYTES = 16  # data bytes a line
# Number of interrupt vectors of each chip (data sheets). A program begins with them: jumps of four
# bytes, `jmp`, or `rjmp` and an unused word.
VECTORS = {57: BoardCode.MEGA2560, 26: BoardCode.ATMEGA328P}
VECTOR = re.compile(rb"[\x0c\x0d]\x94..|.[\xc0-\xcf]\0\0", re.DOTALL)
# Old factory bootloaders start their monitor at this sequence, and hang.
MONITOR_CALL = b"!!!"


def read_hex(text: str, name: str = "image") -> bytes:
    """The program in an Intel hex file, from address 0, padded to whole pages.

    Raises BadImageError, naming the line, for anything that is no such program: gaps too, since the
    stock bootloader erases page after page from the first, whatever address is written.
    """
    chunks: list[tuple[int, bytes]] = []
    base, ended = 0, False
    for number, line in enumerate(text.split(), 1):
        if ended:
            raise BadImageError(name, f"line {number} is after the end record")
        kind, address, data = _record(line, f"{name}, line {number}")
        if kind == DATA:
            chunks.append((base + address, data))
        elif kind == END:
            ended = True
        elif kind in (SEGMENT, LINEAR):
            base = int.from_bytes(data, "big") << (4 if kind == SEGMENT else 16)
    if not ended:
        raise BadImageError(name, "the file is cut short: its end record is missing")
    return _joined(sorted(chunks), name)


def _record(line: str, place: str) -> tuple[int, int, bytes]:
    try:
        raw = bytes.fromhex(line[1:]) if line.startswith(":") else b""
    except ValueError:
        raw = b""
    if len(raw) < 5 or len(raw) != raw[0] + 5:
        raise BadImageError(place, "this is not a line of an Intel hex file")
    if sum(raw) & 0xFF:
        raise BadImageError(place, "its checksum is wrong: the file is damaged")
    return raw[3], int.from_bytes(raw[1:3], "big"), raw[4:-1]


def _joined(chunks: list[tuple[int, bytes]], name: str) -> bytes:
    image = bytearray()
    for address, data in chunks:
        if address != len(image):
            raise BadImageError(
                name,
                f"it is not one block from address 0: a gap or an overlap at 0x{len(image):05X}",
            )
        image += data
    if not image:
        raise BadImageError(name, "it contains no program")
    if len(image) > FLASH_BYTES_MAX:
        raise BadImageError(
            name, f"{len(image)} bytes do not fit below the bootloader ({FLASH_BYTES_MAX})"
        )
    if MONITOR_CALL in image:
        raise BadImageError(name, "it contains '!!!', which makes old bootloaders hang")
    image += bytes([ERASED]) * (-len(image) % PAGE_BYTES)
    return bytes(image)


def chip_of(image: bytes) -> BoardCode | None:
    """The board that a program was built for, by its interrupt vectors; None if unknown.

    A program for the RP2040 is known by the checksum of its boot code.
    """
    if is_rp2040(image):
        return BoardCode.RP2040
    count = 0
    while VECTOR.match(image, 4 * count):
        count += 1
    return VECTORS.get(count)


def write_hex(data: bytes) -> str:
    """Text of an Intel hex file with `data` from address 0."""
    lines = []
    for address in range(0, len(data), RECORD_BYTES):
        if address % 0x10000 == 0:
            lines.append(_line(LINEAR, 0, (address >> 16).to_bytes(2, "big")))
        lines.append(_line(DATA, address & 0xFFFF, data[address : address + RECORD_BYTES]))
    return "\n".join([*lines, _line(END, 0, b""), ""])


def _line(kind: int, address: int, data: bytes) -> str:
    raw = bytes([len(data), *address.to_bytes(2, "big"), kind, *data])
    return f":{(raw + bytes([-sum(raw) & 0xFF])).hex().upper()}"
