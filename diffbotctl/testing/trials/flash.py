"""Flashing through the real stock bootloader, on the emulated board at real pace."""

from __future__ import annotations

import time
from collections.abc import Iterator
from pathlib import Path
from random import Random
from tempfile import TemporaryDirectory

from diffbotctl.emulator.process import IMAGE, Emulator, bootloader
from diffbotctl.flash.flasher import flash, load
from diffbotctl.flash.intel_hex import write_hex
from diffbotctl.testing.board_bench import BOOK
from diffbotctl.testing.trials.row import Row

OLDER_SIZE = 40_000  # bytes of a program that was there before: the book's is 13,500


PROGRAMMERS = ("built-in", "avrdude")
CASES = ("blank", "older, larger", "running")


def rows() -> Iterator[Row]:
    """Each programmer, on a blank board, over an older larger image, and over a running one."""
    for programmer in PROGRAMMERS:
        for case in CASES:
            yield row(programmer, case)


def row(programmer: str, case: str) -> Row:
    """One programmer in one case."""
    with TemporaryDirectory(prefix="diffbot-flash-") as folder:
        before = None if case == "blank" else IMAGE
        if case == "older, larger":
            before = Path(folder) / "older.hex"
            # It only loops (a jump to itself), with random words behind that.
            program = bytes.fromhex("ffcf") + Random(1).randbytes(OLDER_SIZE)
            before.write_text(write_hex(program))
        return _flashed(programmer, case, before)


def _flashed(programmer: str, case: str, before: Path | None) -> Row:
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
    found = f"{'equal' if same else 'DIFFERS'}, dirty {dirty}, {'answers' if ready else 'SILENT'}"
    target = "<= 2.5 s, equal, dirty 0, answers"
    return Row(f"flash with {programmer}, {case}", f"{greeted:.2f} s, {found}", target, good)
