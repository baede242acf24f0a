"""Flashing a Pico: in BOOTSEL it is a USB drive, onto which the program is copied."""

from __future__ import annotations

import os
import re
import time
from collections.abc import Iterator
from pathlib import Path

from diffbotctl.drivers.board_ports import BadImageError, FlashError, NoBoardError
from diffbotctl.flash.board_session import JobEvent, JobMessage
from diffbotctl.flash.flasher import load
from diffbotctl.flash.intel_hex import chip_of
from diffbotctl.links.diffbot_frames import BoardCode
from diffbotctl.links.uf2_format import INFO_FILE, RP2040_DRIVE

COPY = "diffbot.uf2"
RESTART_S = 10.0  # longest time from the last byte until the drive is gone
POLL_PERIOD_S = 0.05
MOUNTS = Path("/proc/self/mounts")


class NoDriveError(NoBoardError):
    """No Pico in BOOTSEL is mounted."""

    def __init__(self, place: str = "drives") -> None:
        FlashError.__init__(
            self,
            place,
            "no drive of a Pico in BOOTSEL is mounted",
            f"hold BOOTSEL while you plug in the USB cable, open the drive {RP2040_DRIVE} in the "
            "file manager, or name its folder with --port",
        )


class WrongDriveError(FlashError):
    """The drive is that of another chip."""

    code = "E-FLASH-SIGNATURE"

    def __init__(self, drive: Path, board: str) -> None:
        super().__init__(
            str(drive),
            f"this is the boot drive of {board or 'an unknown board'}; this program is for a Pico "
            "with an RP2040",
            "choose the drive of that board, or correct board.type in the robot file",
        )


class DriveFullError(FlashError):
    """The program could not be copied."""

    code = "E-FLASH-REFUSED"

    def __init__(self, drive: Path, cause: str) -> None:
        super().__init__(
            str(drive), cause, "plug the Pico in again with BOOTSEL held, and flash again"
        )


def drives(mounts: Path | None = None) -> list[Path]:
    """The mounted drives of boards in their boot ROM, by the list of mounts of Linux."""
    found = []
    for line in (mounts or MOUNTS).read_text().splitlines():
        name = re.sub(r"\\([0-7]{3})", lambda code: chr(int(code[1], 8)), line.split(" ")[1])
        if (Path(name) / INFO_FILE).is_file():
            found.append(Path(name))
    return found


def check_drive(drive: Path) -> None:
    """Raises WrongDriveError unless the drive is that of an RP2040."""
    text = (drive / INFO_FILE).read_text("ascii", "replace")
    board = re.search(r"^Board-ID:\s*(\S+)", text, re.MULTILINE)
    if board is None or board[1] != RP2040_DRIVE:
        raise WrongDriveError(drive, board[1] if board else "")


def check_image(file: Path) -> None:
    """Raises BadImageError unless it is a program for an RP2040."""
    chip = chip_of(load(file))
    if chip is not BoardCode.RP2040:
        built_for = chip.meaning if chip else "another chip"
        cause = f"it was built for {built_for}, and the board is {BoardCode.RP2040.meaning}"
        raise BadImageError(str(file), cause)


def flash_drive(drive: Path, file: Path) -> Iterator[JobEvent]:
    """Copy `file` onto the drive; the boot ROM writes it and starts it. Raises FlashError."""
    check_drive(drive)
    check_image(file)
    yield JobMessage(f"Pico in BOOTSEL at {drive}")
    data = file.read_bytes()
    _copy(drive, data)
    deadline = time.monotonic() + RESTART_S
    while (drive / INFO_FILE).exists():
        if time.monotonic() > deadline:
            cause = "the program was copied, but the Pico does not start it"
            raise DriveFullError(drive, cause)
        time.sleep(POLL_PERIOD_S)
    yield JobMessage(f"{len(data)} bytes copied; the Pico has started the program")


def _copy(drive: Path, data: bytes) -> None:
    """Write through to the drive.

    It vanishes with the last block: an error after it is none.
    """
    try:
        with (drive / COPY).open("wb", buffering=0) as copy:
            written = copy.write(data)
            if written != len(data):
                raise DriveFullError(drive, f"only {written} of {len(data)} bytes fit")
            os.fsync(copy.fileno())
    except OSError as error:
        if (drive / INFO_FILE).exists():
            raise DriveFullError(drive, error.strerror or str(error)) from error
