"""Flashing an Uno and a Nano through their real bootloaders, and programs for another chip."""

import pytest

from diffbotctl.config.board_pins import BOARDS
from diffbotctl.drivers.board_ports import BadImageError, WrongSignatureError
from diffbotctl.emulator.process import Emulator
from diffbotctl.emulator.program import bootloader, image_of
from diffbotctl.flash.flasher import flash, load
from diffbotctl.flash.intel_hex import chip_of, write_hex
from diffbotctl.links.diffbot_frames import BoardCode
from tests.sampling import each_once
from tests.support.optiboot import optiboot
from tests.support.trials import flash as flash_trials

UNO, MEGA = BoardCode.ATMEGA328P, BoardCode.MEGA2560


@each_once(kind=flash_trials.UNO_BOOTLOADERS, case=flash_trials.CASES)
def test_the_bootloader_is_found_and_the_program_verified(kind, case):
    row = flash_trials.uno_row("built-in", kind, case)
    assert row.figure.endswith("equal, dirty 0, answers"), row
    assert kind in row.figure


def test_avrdude_writes_through_optiboot():
    row = flash_trials.uno_row("avrdude", "optiboot", "blank")
    assert row.figure.endswith("equal, dirty 0, answers"), row


@pytest.mark.parametrize(
    ("board", "boot", "expected", "name"),
    [
        (UNO, optiboot, MEGA, "ATmega328P"),
        (UNO, lambda: bootloader(UNO), MEGA, "ATmega328P"),
        (MEGA, bootloader, UNO, "ATmega2560"),
    ],
)
def test_a_robot_file_with_another_board_writes_nothing(board, boot, expected, name):
    with Emulator([], board=board, image=None, boot=boot(), pty=True, paced=True) as emulator:
        with pytest.raises(WrongSignatureError, match=name):
            list(flash(emulator.ports[0], image_of(expected), board=expected))
        assert emulator.flash(0, 256) == b"\xff" * 256


@pytest.mark.parametrize("board", sorted({BoardCode[pins.chip] for pins in BOARDS.values()}))
def test_an_image_for_another_board_is_refused_before_the_port_is_opened(board):
    assert chip_of(load(image_of(board))) is board
    other = UNO if board is MEGA else MEGA
    with pytest.raises(BadImageError, match=f"built for {board.meaning}"):
        list(flash("/dev/null", image_of(board), board=other))


def test_a_program_too_large_for_the_chip(tmp_path):
    large = tmp_path / "large.hex"
    large.write_text(write_hex(b"\xff\xcf" * 0x4000))
    with (
        Emulator([], board=UNO, image=None, boot=optiboot(), pty=True, paced=True) as emulator,
        pytest.raises(BadImageError, match="do not fit below the bootloader"),
    ):
        list(flash(emulator.ports[0], large, board=UNO))
