"""The drive that a virtual Pico shows in BOOTSEL: a folder."""

from __future__ import annotations

import shutil
from pathlib import Path

from diffbotctl.links.uf2_format import BLOCK, HEAD, INFO_FILE, RP2040_DRIVE

INFO = f"UF2 Bootloader v3.0\nModel: Raspberry Pi RP2\nBoard-ID: {RP2040_DRIVE}\n"
_BLOCKS = 6  # place of the number of blocks in the head of each


class VirtualBootDrive:
    """A folder inside of `parent`, from which the board takes a program."""

    def __init__(self, parent: Path) -> None:
        self.folder = parent / RP2040_DRIVE
        self.folder.mkdir()
        (self.folder / INFO_FILE).write_text(INFO, "ascii")

    def program(self) -> bytes | None:
        """A UF2 file that was copied here, as soon as all of its blocks are there."""
        for file in self.folder.glob("*.uf2"):
            data = file.read_bytes()
            if len(data) >= BLOCK and len(data) == BLOCK * HEAD.unpack_from(data)[_BLOCKS]:
                return data
        return None

    def close(self) -> None:
        """The drive vanishes."""
        shutil.rmtree(self.folder)
