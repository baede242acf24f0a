"""Who answers on a port, found by the real program on real pseudo-terminals; and the way out.

Each stranger is the real thing: a silent port, the book's board, the stock bootloader,
our firmware of another version, a wire at another rate, a board with other settings.
"""

import re
import shutil
import subprocess
from dataclasses import replace
from pathlib import Path

import pytest

from diffbotctl.emulator.program import IMAGE
from diffbotctl.errors import RunError
from diffbotctl.flash.board_jobs import blink
from diffbotctl.flash.intel_hex import write_hex
from diffbotctl.links import diffbot_frames as frames
from diffbotctl.links.diffbot_codec import pack
from diffbotctl.links.diffbot_host import DiffbotHost
from tests.sampling import by_day
from tests.support.board_bench import BOOK
from tests.support.book_board import BookBoardPort
from tests.support.serial_wire import SerialWire
from tests.support.trials.port_answers import named_port, talking
from tests.support.virtual_board import board, diffbotctl, flash, flat, run

FIRMWARE = Path(__file__).parents[2] / "firmware"
# A board keeps the baud rate of the settings that it was given last, so a radio is tried at all.
RADIO_RATES = "9600, 115200, 19200, 38400 or 57600"


def meet(port, *words):
    """Try to blink a light behind a port; (exit code, output)."""
    code, output = diffbotctl("blink", "--robot", "book_2wd", "--times", 1, "--port", port, *words)
    assert "Traceback" not in output
    return code, flat(output)


@pytest.mark.parametrize(
    ("name", "tried"), [("rfcomm0", RADIO_RATES), ("ttyUSB0", "115200 or 9600")]
)
def test_a_silent_port(tmp_path, name, tried):
    with named_port(tmp_path, name) as (port, _):
        code, output = diffbotctl(*run(port))
    assert code == 1
    output = flat(output)
    assert "E-PORT-SILENT" in output
    assert f"nothing answers at {tried} baud" in output
    assert "switched on" in output


def test_the_book_s_firmware(tmp_path):
    stock = BookBoardPort()
    try:
        port = tmp_path / "rfcomm0"
        port.symlink_to(stock.name)
        code, output = meet(port)
    finally:
        stock.close()
    assert code == 1
    assert "E-BOARD-ROSSERIAL" in output
    assert "flash firmware" in output and "protocol: rosserial" in output


def test_the_bootloader_alone():
    with board(image=None) as virtual:
        code, output = meet(virtual.usb)
    assert code == 1
    assert "E-BOARD-BLANK" in output
    assert "flash firmware" in output


def test_a_firmware_that_prints_lines(tmp_path):
    with (
        named_port(tmp_path, "rfcomm0") as (port, end),
        talking(end, lambda _: b"distance 12 cm\r\n", 0.05),
    ):
        code, output = meet(port)
    assert code == 1
    assert "E-BOARD-UNKNOWN" in output
    assert f"unknown bytes arrive at {RADIO_RATES} baud" in output
    assert "flash firmware" in output


@pytest.mark.parametrize("name", ["rfcomm0", "ttyUSB0"])
def test_an_echoing_line_is_no_board(tmp_path, name):
    # TX and RX touch: each byte comes back.
    with named_port(tmp_path, name) as (port, end), talking(end, lambda received: received):
        code, output = meet(port)
    assert code == 1
    assert "E-PORT-ECHO" in output and "returns what is sent" in output


def test_a_sketch_that_sends_nothing(tmp_path):
    """The bootloader answers, starts the program, and that is silent: no noise."""
    silent = tmp_path / "silent.hex"
    silent.write_text(write_hex(bytes.fromhex("ffcf")))  # rjmp to itself
    with board(image=silent) as virtual:
        code, output = meet(virtual.usb)
    assert code == 1
    assert "E-BOARD-UNKNOWN" in output or "E-PORT-SILENT" in output
    assert "unknown bytes" not in output


@pytest.mark.parametrize("rate", by_day(1, [4800, 230400]))
def test_a_radio_at_another_rate(tmp_path, rate):
    """Behind a radio module at a rate that the board's port cannot have, no rate can be read."""
    with board() as virtual, SerialWire(virtual.radio, tmp_path / "rfcomm0", rate=rate) as wire:
        virtual.board.emulator.reset()  # it speaks at its start
        code, output = meet(wire.name)
    assert code == 1
    assert re.search("E-BOARD-UNKNOWN|E-PORT-SILENT", output)
    assert f"{RADIO_RATES} baud" in output


@pytest.mark.parametrize("rate", by_day(1, [57600, 19200, 38400]))
def test_a_board_at_the_rate_of_earlier_settings(tmp_path, rate):
    """It is found at its rate, takes the robot file's settings, and changes to their rate."""
    with board() as virtual, SerialWire(virtual.radio, tmp_path / "rfcomm0", rate=rate) as wire:
        wire.follow(9600)
        code, output = meet(wire.name)
        assert wire.rate == 9600
    assert code == 0, output


@pytest.fixture(scope="module")
def newer(tmp_path_factory):
    """Our firmware, but of the next version of the protocol."""
    copy = tmp_path_factory.mktemp("newer") / "firmware"
    shutil.copytree(FIRMWARE, copy, ignore=shutil.ignore_patterns("build", "*.hex", "emulator"))
    header = copy / "protocol.h"
    now = f"#define PROTOCOL_VERSION {frames.VERSION}"
    text = header.read_text()
    assert now in text
    header.write_text(text.replace(now, f"#define PROTOCOL_VERSION {frames.VERSION + 1}"))
    make = ["make", "-C", copy, f"ROOT={FIRMWARE.parent}"]
    subprocess.run(make, capture_output=True, check=True)
    return copy / IMAGE.name


@pytest.mark.nightly
def test_another_protocol_version_and_its_fix_by_flashing(newer):
    with board(image=newer) as virtual:
        code, output = meet(virtual.radio)
        assert code == 1
        assert "E-BOARD-VERSION" in output
        ours, theirs = frames.VERSION, frames.VERSION + 1
        assert f"uses version {theirs} of the protocol, this diffbotctl version {ours}" in output
        assert "install the newer diffbotctl" in output
        assert flash(virtual)[0] == 0
        code, output = meet(virtual.radio)
        assert code == 0, output


def test_other_settings_are_sent_and_kept():
    with board() as virtual:
        names = []
        for _ in range(2):
            code, output = meet(virtual.radio)
            assert code == 0, output
            names.append(re.search("settings ([0-9A-F]{4}), ready", output)[1])
        code, output = diffbotctl(
            *run(virtual.radio, "--goal", "0.1 0", "--set", "robot.board.deadman=400ms")
        )
        assert code == 0, output
        stored = virtual.board.emulator.eeprom()
        new = replace(virtual.board.settings, deadman=400_000_000)
    assert names[0] == names[1]
    assert pack(new.frame()) in stored


def test_a_setting_that_the_board_cannot_use_is_named():
    """Pin 22 has no PWM; the host's own checks of the robot file would not let it come so far."""
    settings = replace(BOOK, left=replace(BOOK.left, enable=22))
    with board() as virtual, pytest.raises(RunError) as raised:
        list(blink(str(virtual.radio), DiffbotHost(settings), 1))
    problem = raised.value.problems[0]
    assert problem.code == "E-BOARD-SETTINGS"
    assert problem.cause == "the board refuses the setting `left_enable`: the pin has no PWM"


def test_the_first_contact_is_made_at_9600_and_then_the_file_s_rate_is_used(tmp_path):
    """A new board speaks at 9600; its settings say 19200, and it changes with its answer."""
    with board() as virtual, SerialWire(virtual.radio, tmp_path / "rfcomm0", rate=9600) as wire:
        wire.follow(19200)
        code, output = diffbotctl(
            *run(wire.name, "--goal", "0.1 0", "--set", "robot.link.baud=19200")
        )
        assert wire.rate == 19200
    assert code == 0, output
    assert "goals 1 of 1 reached" in output
