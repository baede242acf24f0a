"""Flashing through the real stock bootloader, on the emulated board at real pace."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from math import inf
from pathlib import Path
from random import Random
from tempfile import TemporaryDirectory
from typing import NamedTuple

from diffbotctl.emulator.process import Emulator
from diffbotctl.emulator.program import bootloader, image_of
from diffbotctl.flash import stk500v1
from diffbotctl.flash.board_session import JobMessage
from diffbotctl.flash.flasher import flash, load
from diffbotctl.flash.intel_hex import PAGE_BYTES, write_hex
from diffbotctl.links import stk500_frames
from diffbotctl.links.diffbot_frames import BoardCode
from diffbotctl.links.diffbot_settings import BoardSettings
from diffbotctl.links.link_protocol import BITS_PER_BYTE
from tests.support.board_bench import BOOK, UNO
from tests.support.optiboot import optiboot
from tests.support.trials.row import Row
from tests.support.trials.section import drawn

OLDER_SIZE = 40_000  # bytes of a program that was there before: the book's is 13,500


OLDER_UNO_SIZE = 24_000
# Bytes of one request and its reply: an address; a page to write, a page to read, without the page.
ADDRESS_BYTES, PROGRAM_BYTES, READ_BYTES = 4 + 2, 5 + 2, 5 + 2
# The same of a Mega, whose bootloader keeps the address by itself, with the six bytes around each.
MEGA_PROGRAM_BYTES, MEGA_READ_BYTES = 6 + 10 + 6 + 2, 6 + 4 + 6 + 3
# What avrdude 7.1 adds, as its system calls show: it waits 50 ms before and after the reset, 250 ms
# for what the program may still send, and 10 ms; it sends an address before each page.
AVRDUDE_WAITS_S = 0.050 + 0.050 + 0.250 + 0.010
AVRDUDE_ADDRESS_BYTES = 6 + 5 + 6 + 2
MEGA_TARGET_S = 4.0
PAGE_WRITE_S = 2 * 0.0037  # erasing and writing (data sheet, table 28-11: 3.7 to 4.5 ms each)
# Image, baud rate and most seconds of each bootloader of an Uno or Nano.
UNO_BOOTLOADERS: dict[str, tuple[Callable[[], Path], int, float]] = {
    "optiboot": (optiboot, 115200, 6.0),
    "ATmegaBOOT": (lambda: bootloader(BoardCode.ATMEGA328P), 57600, 10.0),
}
PROGRAMMERS = ("built-in", "avrdude")
CASES = ("blank", "older, larger", "running")


def rows(seed: int, cases: int = len(CASES)) -> Iterator[Row]:
    """Each programmer, on a blank board, over an older larger image, and over a running one."""
    for case in drawn(CASES, cases, seed):
        for programmer in PROGRAMMERS:
            yield row(programmer, case)
        for kind in UNO_BOOTLOADERS:
            yield uno_row("built-in", kind, case)
    yield uno_row("avrdude", "optiboot", "blank")


def row(programmer: str, case: str) -> Row:
    """One programmer in one case, on a Mega; beside the figure as of `uno_row`."""
    with TemporaryDirectory(prefix="diffbot-flash-") as folder:
        before = _program_before(case, BoardCode.MEGA2560, OLDER_SIZE, Path(folder))
        figures = _flashed(programmer, case, before, bootloader(), BOOK)
    size = len(load(image_of(BoardCode.MEGA2560)))
    what = _floor(*mega_wire_floor(size))
    if programmer == "avrdude":
        addresses = avrdude_addresses(size)
        what += f"; its own waits {AVRDUDE_WAITS_S:.2f} s, addresses {addresses:.2f} s"
    return _row(f"flash with {programmer}, {case} ({what})", figures, MEGA_TARGET_S)


def uno_row(programmer: str, kind: str, case: str) -> Row:
    """One programmer in one case, on an Uno or Nano with this bootloader, which it finds by itself.

    Beside the figure: the time that the bytes of both directions are on the wire, one after the
    other, and the time of the chip's page writes, which take none in the emulator.
    """
    boot, baud, target = UNO_BOOTLOADERS[kind]
    board = BoardCode.ATMEGA328P
    with TemporaryDirectory(prefix="diffbot-flash-") as folder:
        before = _program_before(case, board, OLDER_UNO_SIZE, Path(folder))
        figures = _flashed(programmer, case, before, boot(), UNO)
    wire, pages = wire_floor(len(load(image_of(board))), baud)
    what = f"flash a 328P with {programmer}, {kind} at {baud}, {case} ({_floor(wire, pages)})"
    return _row(what, figures, target)


def _floor(wire: float, pages: float) -> str:
    return f"wire {wire:.1f} s, pages {pages:.1f} s on a chip"


def mega_wire_floor(size: int) -> tuple[float, float]:
    """As `wire_floor`, over STK500v2: whole pages, written and read back."""
    pages = -(-size // PAGE_BYTES)
    sent = MEGA_PROGRAM_BYTES + MEGA_READ_BYTES + 2 * PAGE_BYTES
    return pages * sent * BITS_PER_BYTE / stk500_frames.BAUD, pages * PAGE_WRITE_S


def avrdude_addresses(size: int) -> float:
    """Time (s) on the wire of the addresses that avrdude sends before each page, in both passes."""
    pages = -(-size // PAGE_BYTES)
    return 2 * pages * AVRDUDE_ADDRESS_BYTES * BITS_PER_BYTE / stk500_frames.BAUD


def wire_floor(size: int, baud: int) -> tuple[float, float]:
    """Least times (s) of the bytes on the wire and of the page writes, over STK500v1."""
    pages = -(-size // stk500v1.PAGE_BYTES)
    requests = 2 * ADDRESS_BYTES + PROGRAM_BYTES + READ_BYTES
    on_wire = pages * (requests + 2 * stk500v1.PAGE_BYTES) * BITS_PER_BYTE / baud
    return on_wire, pages * PAGE_WRITE_S


def _program_before(case: str, board: BoardCode, size: int, folder: Path) -> Path | None:
    if case == "blank":
        return None
    if case == "running":
        return image_of(board)
    older = folder / "older.hex"
    # It only loops (a jump to itself), with random words behind that.
    older.write_text(write_hex(bytes.fromhex("ffcf") + Random(1).randbytes(size)))
    return older


class FlashFigures(NamedTuple):
    """What one flash did."""

    seconds: float  # until it was verified
    bootloader: str
    same: bool
    dirty: int
    answers: bool


def _flashed(
    programmer: str, case: str, before: Path | None, boot: Path, settings: BoardSettings
) -> FlashFigures:
    image = image_of(settings.board)
    required = load(image)
    with Emulator(
        [], board=settings.board, image=before, boot=boot, pty=True, paced=True
    ) as emulator:
        assert emulator.ports is not None
        if case == "running":
            time.sleep(1.5)  # past the bootloader, into the program
        start = time.monotonic()
        seconds, texts = inf, []
        for event in flash(
            emulator.ports[0],
            image,
            programmer=programmer,
            board=settings.board,
            settings=settings,
        ):
            if isinstance(event, JobMessage):
                texts.append(event.text)
                if "verified" in event.text:
                    seconds = time.monotonic() - start
        same = emulator.flash(0, len(required)) == required
        dirty = emulator.dirty_writes()
    return FlashFigures(seconds, texts[0].rsplit(" ", 1)[-1], same, dirty, "ready" in texts[-1])


def _row(what: str, figures: FlashFigures, target: float) -> Row:
    is_right = figures.same and figures.answers and figures.dirty == 0
    same = "equal" if figures.same else "DIFFERS"
    answers = "answers" if figures.answers else "SILENT"
    result = f"{same}, dirty {figures.dirty}, {answers}"
    shown = f"{figures.seconds:.2f} s, {figures.bootloader}, {result}"
    expected = f"<= {target:g} s, equal, dirty 0, answers"
    return Row(what, shown, expected, is_right and figures.seconds <= target)
