"""Which Pico is flashed: found by its USB identity or its drive, among other boards."""

import os
import threading

import pytest
from click.testing import CliRunner

from diffbotctl.cli.emulate import emulate as emulate_command
from diffbotctl.cli.flash import flash as flash_command
from diffbotctl.config.load import load_robot
from diffbotctl.drivers import board_ports
from diffbotctl.drivers.board_ports import (
    BadImageError,
    OtherBoardError,
    SeveralBoardsError,
    refuse_other_board,
)
from diffbotctl.emulator.program import image_of
from diffbotctl.emulator.virtual_board import virtual_board
from diffbotctl.flash.boot_drive import NoDriveError
from diffbotctl.flash.pico import NotMountedError, PicoTarget, find_pico
from diffbotctl.links.diffbot_frames import BoardCode
from diffbotctl.ports.sysfs import serial_ports
from tests.sampling import by_day
from tests.support.board_bench import PICO_ROBOT, UNO_ROBOT
from tests.support.fake_machine import FakeMachine

PICO, PYTHON, MEGA, CLONE = (0x2E8A, 0x000A), (0x2E8A, 0x0005), (0x2341, 0x0042), (0x1A86, 0x7523)
BOOTSEL = (0x2E8A, 0x0003)


@pytest.fixture
def machine(tmp_path):
    (tmp_path / "mounts").write_text("/dev/sda1 / ext4 rw 0 0\n")
    return FakeMachine(tmp_path / "machine")


def found(machine, port="auto"):
    return find_pico(port, machine.root, machine.root.parent / "mounts")


@pytest.mark.parametrize("identity", [PICO, PYTHON])
def test_a_running_pico_is_found_by_its_identity(machine, identity):
    machine.port("ttyACM0", CLONE, place="1-1")
    machine.port("ttyACM1", identity, place="1-2")
    assert found(machine) == PicoTarget(None, "/dev/ttyACM1")


def test_two_picos_are_not_guessed(machine):
    machine.port("ttyACM0", PICO, place="1-1")
    machine.port("ttyACM1", PICO, place="1-2")
    with pytest.raises(SeveralBoardsError, match="ttyACM0, /dev/ttyACM1"):
        found(machine)


def test_another_board_is_named(machine):
    machine.port("ttyACM0", MEGA, place="1-1")
    with pytest.raises(OtherBoardError, match="an Arduino Mega 2560, and the robot file is for a"):
        found(machine)


def test_a_drive_that_is_not_mounted(machine):
    machine.usb("1-1", BOOTSEL)
    with pytest.raises(NotMountedError, match="not mounted"):
        found(machine)


def test_a_folder_that_is_no_drive(machine):
    with pytest.raises(NoDriveError):
        found(machine, str(machine.root))


@pytest.mark.parametrize("robot", [UNO_ROBOT, "book_2wd"])
def test_a_pico_is_not_flashed_as_another_board(machine, monkeypatch, robot):
    machine.port("ttyACM0", PICO, place="1-1")
    monkeypatch.setattr(board_ports, "serial_ports", lambda _: serial_ports(machine.root))
    words = ["firmware", "--robot", robot, "--yes"]
    result = CliRunner().invoke(flash_command, words, standalone_mode=False)
    assert isinstance(result.exception, OtherBoardError), result.exception
    (machine.root / "INFO_UF2.TXT").touch()
    for port in ("/dev/ttyACM0", str(machine.root)):
        with pytest.raises(OtherBoardError, match="a Raspberry Pi Pico"):
            refuse_other_board(port, BoardCode.MEGA2560)


@pytest.mark.parametrize(
    ("robot", "board"), [(PICO_ROBOT, BoardCode.MEGA2560), ("book_2wd", BoardCode.RP2040)]
)
def test_a_program_for_another_chip_is_not_emulated(robot, board):
    words = [robot, "--hex", str(image_of(board))]
    result = CliRunner().invoke(emulate_command, words, standalone_mode=False)
    assert isinstance(result.exception, BadImageError), result.exception


@pytest.mark.parametrize("image", by_day(1, ["ours", None]), ids=["running", "blank"])
def test_a_virtual_pico_is_flashed_over_its_usb_port(image):
    """A running one is brought to BOOTSEL; afterwards it answers and has its settings."""
    stop_read, stop_write = os.pipe()
    with virtual_board(load_robot(PICO_ROBOT).nominal, 3, image=image) as board:
        serving = threading.Thread(target=board.serve, args=(stop_read, lambda _: None))
        serving.start()
        try:
            drive = board.folder / "RPI-RP2"
            while image is None and not drive.is_dir():
                assert serving.is_alive()
            port = str(board.usb if image else drive)
            words = ["firmware", "--robot", PICO_ROBOT, "--yes", "--port", port]
            result = CliRunner().invoke(flash_command, words, standalone_mode=False)
        finally:
            os.write(stop_write, b"\0")
            serving.join()
            os.close(stop_read)
            os.close(stop_write)
    assert result.exception is None, result.exception
    assert ("brought to BOOTSEL" in result.output) == (image is not None)
    assert "has started the program" in result.output
    if image is not None:
        assert "on Raspberry Pi Pico" in result.output and "ready" in result.output
