"""Flashing through the real stock bootloader, on the emulated board at real pace."""

from __future__ import annotations

import time
from collections.abc import Iterator
from pathlib import Path
from random import Random
from tempfile import TemporaryDirectory

from diffbotctl.drivers.emulator_process import IMAGE, Emulator, bootloader
from diffbotctl.flash.image import write_hex
from diffbotctl.flash.job import flash, load
from prove.board_bench import BOOK
from prove.row import Row

OLDER_SIZE = 40_000  # bytes of a program that was there before: the book's is 13,500


def rows() -> Iterator[Row]:
    """Each programmer, on a blank board, over an older larger image, and over a running one."""
    with TemporaryDirectory(prefix="diffbot-flash-") as folder:
        older = Path(folder) / "older.hex"
        # Random words would run as a program; a larger one that only loops is what is wanted.
        older.write_text(write_hex(bytes.fromhex("ffcf") + Random(1).randbytes(OLDER_SIZE)))
        for programmer in ("built-in", "avrdude"):
            for case, before in (("blank", None), ("older, larger", older), ("running", IMAGE)):
                yield _row(programmer, case, before)


def _row(programmer: str, case: str, before: Path | None) -> Row:
    wanted = load(IMAGE)
    with Emulator([], image=before, boot=bootloader(), pty=True, paced=True) as board:
        assert board.ports is not None
        if case == "running":
            time.sleep(1.5)  # past the bootloader, into the program
        start = time.monotonic()
        greeted = 0.0
        for event in flash(board.ports[0], IMAGE, programmer=programmer, settings=BOOK):
            text = getattr(event, "text", "")
            if "verified" in text:
                greeted = time.monotonic() - start
        ready = "ready" in text
        same = board.flash(0, len(wanted)) == wanted
        dirty = board.dirty_writes()
    good = same and ready and dirty == 0 and greeted <= 2.5
    figure = f"{greeted:.2f} s, dirty {dirty}, {'answers' if ready else 'SILENT'}"
    return Row(f"flash with {programmer}, {case}", figure, "<= 2.5 s, 0, answers", good)
