"""Flashing a Pico: its boot drive is found, checked and written, with images for it alone."""

import os
import threading
from pathlib import Path

import pytest
from click.testing import CliRunner

from diffbotctl.cli.flash import flash as flash_command
from diffbotctl.drivers.board_ports import (
    BadImageError,
    FlashError,
    NoBoardError,
    NoProgrammerError,
    SeveralBoardsError,
)
from diffbotctl.emulator.program import image_of
from diffbotctl.flash import boot_drive, pico
from diffbotctl.flash.boot_drive import DriveFullError, drives, flash_drive
from diffbotctl.flash.flasher import load
from diffbotctl.flash.intel_hex import chip_of
from diffbotctl.flash.pico import find_pico
from diffbotctl.flash.uf2 import is_rp2040, read_uf2
from diffbotctl.links.diffbot_frames import BoardCode
from diffbotctl.links.uf2_format import BLOCK, INFO_FILE, boot_checksum
from tests.support.board_bench import PICO_ROBOT

IMAGE = image_of(BoardCode.RP2040)
TEXT = "UF2 Bootloader v3.0\nModel: Raspberry Pi RP2\nBoard-ID: {}\n"
WAIT_S = 60.0


@pytest.fixture
def drive(tmp_path, monkeypatch):
    """A folder like the drive of a Pico in BOOTSEL."""
    monkeypatch.setattr(boot_drive, "RESTART_S", WAIT_S)
    return made_drive(tmp_path / "RPI-RP2")


def made_drive(folder, board="RPI-RP2"):
    folder.mkdir()
    (folder / INFO_FILE).write_text(TEXT.format(board))
    return folder


def boot_rom(drive, size):
    """Restarts as the chip does when the last block has come: the drive is gone."""
    done = threading.Event()

    def watch():
        copy = drive / boot_drive.COPY
        while not done.wait(0.01):
            if copy.exists() and copy.stat().st_size == size:
                os.remove(drive / INFO_FILE)
                return

    thread = threading.Thread(target=watch)
    thread.start()
    return done, thread


def test_the_program_is_copied_whole(drive):
    done, thread = boot_rom(drive, IMAGE.stat().st_size)
    try:
        printed = [event.text for event in flash_drive(drive, IMAGE)]
    finally:
        done.set()
        thread.join(WAIT_S)
    assert (drive / boot_drive.COPY).read_bytes() == IMAGE.read_bytes()
    assert "has started the program" in printed[1]


def test_the_command_finds_the_drive_and_needs_no_port(drive, monkeypatch):
    mounts = drive.parent / "mounts"
    mounts.write_text(f"/dev/sda1 {drive} vfat rw 0 0\n")
    monkeypatch.setattr(boot_drive, "MOUNTS", mounts)
    monkeypatch.setattr(pico, "PORT_S", 0.0)  # no port comes: it gets its settings later
    done, thread = boot_rom(drive, IMAGE.stat().st_size)
    try:
        words = ["firmware", "--robot", PICO_ROBOT, "--yes"]
        result = CliRunner().invoke(flash_command, words, standalone_mode=False)
    finally:
        done.set()
        thread.join(WAIT_S)
    assert result.exception is None, result.exception
    assert f"Pico on drive {drive}" in result.output
    assert "has started the program" in result.output and pico.LATER in result.output


def test_a_pico_that_does_not_restart_is_reported(drive, monkeypatch):
    monkeypatch.setattr(boot_drive, "RESTART_S", 0.0)
    with pytest.raises(DriveFullError, match="does not start it"):
        list(flash_drive(drive, IMAGE))


def test_drives_are_found_among_the_mounts(tmp_path):
    """Also one with a space in its name, which the kernel writes as an octal number."""
    one, other = made_drive(tmp_path / "RPI-RP2"), made_drive(tmp_path / "a b")
    (tmp_path / "plain").mkdir()
    mounts = tmp_path / "mounts"
    names = [str(one), str(other).replace(" ", r"\040"), str(tmp_path / "plain"), "/"]
    mounts.write_text("".join(f"/dev/sda1 {name} vfat rw 0 0\n" for name in names))
    assert drives(mounts) == [one, other]
    with pytest.raises(SeveralBoardsError):
        find_pico("auto", tmp_path, mounts)
    mounts.write_text(f"/dev/sda1 {one} vfat rw 0 0\n")
    assert find_pico("auto", tmp_path, mounts).drive == one


@pytest.mark.parametrize("port", ["auto", "/"])
def test_without_a_drive_nothing_is_written(tmp_path, port):
    mounts = tmp_path / "mounts"
    mounts.write_text("/dev/sda1 / ext4 rw 0 0\n")
    with pytest.raises(NoBoardError) as raised:
        find_pico(port, tmp_path, mounts)
    assert "BOOTSEL" in raised.value.problems[0].fix


def test_the_drive_of_another_chip_is_refused(tmp_path):
    drive = made_drive(tmp_path / "RP2350", "RP2350")
    with pytest.raises(FlashError, match="RP2350"):
        list(flash_drive(drive, IMAGE))
    assert not (drive / boot_drive.COPY).exists()


@pytest.mark.parametrize("board", [BoardCode.MEGA2560, BoardCode.ATMEGA328P])
def test_an_image_for_another_board_is_refused(drive, board):
    with pytest.raises(BadImageError, match=f"built for {board.meaning}"):
        list(flash_drive(drive, image_of(board)))
    assert not (drive / boot_drive.COPY).exists()


@pytest.mark.parametrize(
    ("words", "error"),
    [
        (["--backup", "old.hex"], FlashError),
        (["--programmer", "avrdude"], NoProgrammerError),
    ],
)
def test_what_a_pico_cannot_do_is_refused(words, error):
    words = ["firmware", "--robot", PICO_ROBOT, "--yes", *words]
    result = CliRunner().invoke(flash_command, words, standalone_mode=False)
    assert isinstance(result.exception, error)


def test_our_image_is_one_that_the_boot_rom_starts():
    program = load(IMAGE)
    assert is_rp2040(program) and chip_of(program) is BoardCode.RP2040
    # The CRC-32/MPEG-2 of "123456789".
    assert boot_checksum(b"123456789") == 0x0376E6E7


@pytest.mark.parametrize(
    ("change", "cause"),
    [
        (lambda data: data[:-1], "cut short"),
        (lambda data: data[:-BLOCK], "is missing"),
        (lambda data: data[BLOCK:], "is missing"),
        (lambda data: data[:BLOCK] + b"\0" * BLOCK + data[2 * BLOCK :], "damaged"),
        (lambda data: data[:28] + b"\0\0\0\0" + data[32:], "another chip"),
        (lambda data: data[:12] + b"\0\1\0\x10" + data[16:], "a gap or an overlap"),
        (lambda _: b"", "cut short"),
    ],
)
def test_damaged_files_are_refused(change, cause):
    with pytest.raises(BadImageError, match=cause):
        read_uf2(change(IMAGE.read_bytes()))


def test_a_file_that_is_not_there(drive):
    with pytest.raises(BadImageError):
        list(flash_drive(drive, Path("nowhere.uf2")))
