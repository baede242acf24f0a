"""Flashing a board, as a stream of events: backup, write, verify, send the settings."""

from __future__ import annotations

import os
import shutil
import subprocess
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

from diffbotctl.config.yaml_reader import open_regular
from diffbotctl.drivers.board_ports import (
    BadImageError,
    NoBackupError,
    NoProgrammerError,
    SilentError,
    VerifyMismatchError,
    refuse_radio,
)
from diffbotctl.drivers.serial_port import open_port
from diffbotctl.errors import RunError
from diffbotctl.flash.board_session import BoardSession, JobEvent, JobMessage
from diffbotctl.flash.bootloaders import SYNC_TIME_S, Bootloader, find_bootloader
from diffbotctl.flash.intel_hex import chip_of, read_hex, write_hex
from diffbotctl.flash.uf2 import is_uf2, read_uf2
from diffbotctl.links.diffbot_frames import BoardCode
from diffbotctl.links.diffbot_host import DiffbotHost
from diffbotctl.links.diffbot_settings import BoardSettings
from diffbotctl.links.link_protocol import USB_BAUD

IMAGE_FILE_MAX_BYTES = 16 << 20  # far more than the flash of any board, as text
WRITES = 2  # of the whole image, when a page that is read back differs


def load(file: Path) -> bytes:
    """The program in a hex file, or in a UF2 file. Raises BadImageError."""
    try:
        with open_regular(file) as opened:
            data = opened.read(IMAGE_FILE_MAX_BYTES)
        if is_uf2(data):
            return read_uf2(data, str(file))
        return read_hex(data.decode("ascii"), str(file))
    except OSError as error:
        raise BadImageError(str(file), error.strerror or str(error)) from error
    except UnicodeDecodeError as error:
        raise BadImageError(str(file), "it is not a text file") from error


def flash(
    device: str,
    file: Path,
    *,
    programmer: str = "built-in",
    backup: Path | None = None,
    board: BoardCode = BoardCode.MEGA2560,
    settings: BoardSettings | None = None,
) -> Iterator[JobEvent]:
    """Write and verify `file`, then connect to the firmware and send it `settings`.

    `board`: the one that the program is for. `backup`: file for the present program of the board,
    saved first. With `settings` of None the job ends when the new program starts. Raises RunError:
    a FlashError, or of opening the port.
    """
    refuse_radio(device)
    image = load(file)
    check_chip(file, image, board)
    if backup is not None:
        _check_backup_file(backup)
    if backup is not None or programmer == "built-in":
        with BoardSession(device, USB_BAUD) as session:
            yield from _write(session, image, board, backup, programmer == "built-in")
            if settings is not None and programmer == "built-in":
                yield from send_settings(session, settings)
    if programmer == "avrdude":
        yield from _avrdude(device, file, board)
        if settings is not None:
            with BoardSession(device, USB_BAUD) as session:
                session.reset()
                yield from send_settings(session, settings)


def check_chip(file: Path, image: bytes, board: BoardCode) -> None:
    """Raises BadImageError for a program that was built for another chip, or is too large."""
    chip = chip_of(image)
    if chip is not None and chip is not board:
        cause = f"it was built for {chip.meaning}, and the board is {board.meaning}"
        raise BadImageError(str(file), cause)


def _write(
    session: BoardSession, image: bytes, board: BoardCode, backup: Path | None, writes: bool
) -> Iterator[JobEvent]:
    bootloader = find_bootloader(session, board)
    name = board.meaning.removeprefix("Arduino ")
    yield JobMessage(f"{name} on {session.device}, bootloader {bootloader.title}")
    if len(image) > bootloader.flash_max:
        cause = f"{len(image)} bytes do not fit below the bootloader ({bootloader.flash_max})"
        raise BadImageError("image", cause)
    if backup is not None:
        saved = bytearray()
        yield from bootloader.read(saved)
        _save(backup, write_hex(bytes(saved)))
        yield JobMessage(f"the former program of the board is in {backup}")
    if writes:
        yield from _write_verified(session, bootloader, image)
        yield JobMessage(f"{len(image)} bytes written and verified")
    yield from bootloader.leave()


def _write_verified(
    session: BoardSession, bootloader: Bootloader, image: bytes
) -> Iterator[JobEvent]:
    """Write and verify; a page that differs is written again, with all others.

    The Mega's bootloader erases pages in order from its start, so a single one cannot be. Raises
    FlashError.
    """
    for remaining in reversed(range(WRITES)):
        try:
            yield from bootloader.write(image)
        except VerifyMismatchError as error:
            if not remaining:
                raise
            yield JobMessage(f"{error.problems[0].cause}; writing everything once more")
            session.reset()
            bootloader.answers(SYNC_TIME_S)
        else:
            return


def _check_backup_file(backup: Path) -> None:
    """Check before half a minute of reading; an earlier backup is never overwritten."""
    if backup.exists():
        raise NoBackupError(str(backup), "the file exists, and may hold an earlier backup")
    if not os.access(backup.parent, os.W_OK):
        raise NoBackupError(str(backup), "its folder does not exist or cannot be written to")


def _save(backup: Path, text: str) -> None:
    try:
        backup.write_text(text)
    except OSError as error:
        raise NoBackupError(str(backup), error.strerror or str(error)) from error


def send_settings(session: BoardSession, settings: BoardSettings) -> Iterator[JobEvent]:
    """Connect to the firmware over USB, which sends it its settings; yields its name.

    Raises SilentError, or RunError when it takes no settings.
    """
    host = DiffbotHost(replace(settings, uart=0))
    try:
        yield from session.connect(host)
    except RunError as error:
        if host.hello is None:
            raise SilentError(session.device, host.cause) from error
        raise


AVRDUDE_TARGETS = {
    BoardCode.MEGA2560: ("-c wiring -p m2560 -D -b 115200",),
    BoardCode.ATMEGA328P: (
        "-c arduino -p m328p -D -b 115200",  # optiboot
        "-c arduino -p m328p -D -b 57600",  # ATmegaBOOT
    ),
}


def _avrdude(device: str, file: Path, board: BoardCode) -> Iterator[JobEvent]:
    program = shutil.which("avrdude")
    if program is None:
        raise NoProgrammerError(
            "avrdude is not installed",
            "sudo apt-get install avrdude, or leave --programmer out: diffbotctl flashes by itself",
        )
    # The errors of opening it (port in use, missing rights) are clearer than avrdude's.
    open_port(device, USB_BAUD).close()
    results = []
    for target in AVRDUDE_TARGETS[board]:
        command = [program, *target.split(), "-P", device]
        command += ["-U", f"flash:w:{os.path.abspath(file)}:i"]
        results.append(subprocess.run(command, capture_output=True, text=True, check=False))
        if results[-1].returncode == 0:
            yield JobMessage("written and verified by avrdude")
            return
    errors = [line for line in results[-1].stderr.splitlines() if "error" in line.lower()]
    raise NoProgrammerError(
        "; ".join(errors) or f"it ended with code {results[-1].returncode}",
        "leave --programmer out to flash without it",
    )
