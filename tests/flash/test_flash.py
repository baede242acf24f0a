"""Flashing through the real stock bootloader on the emulated board, at real pace."""

import os

import pytest

from diffbotctl.drivers import board_ports
from diffbotctl.drivers.board_ports import (
    BadImageError,
    NoBoardError,
    NoSyncError,
    RadioPortError,
    RefusedError,
    SeveralBoardsError,
    VerifyMismatchError,
)
from diffbotctl.emulator.process import Emulator
from diffbotctl.emulator.program import IMAGE, bootloader
from diffbotctl.flash import stk500
from diffbotctl.flash.board_session import BoardSession, JobMessage, JobProgress
from diffbotctl.flash.bootloaders import find_bootloader
from diffbotctl.flash.flasher import flash, load
from diffbotctl.flash.intel_hex import read_hex, write_hex
from diffbotctl.flash.stk500 import BootloaderRequest
from diffbotctl.links.diffbot_frames import BoardCode
from diffbotctl.links.stk500_frames import BAUD, ReplyParser, message
from diffbotctl.ports.sysfs import SerialPort, UsbDevice
from tests.sampling import each_once
from tests.support.board_bench import BOOK
from tests.support.trials import flash as flash_module


@pytest.fixture
def blank():
    """A board with the stock bootloader and no program."""
    with Emulator([], image=None, boot=bootloader(), pty=True, paced=True) as board:
        yield board


@each_once(programmer=flash_module.PROGRAMMERS, case=flash_module.CASES)
def test_it_is_written_verified_and_answers(programmer, case):
    row = flash_module.row(programmer, case)
    assert row.figure.endswith("equal, dirty 0, answers"), row


def test_events_show_the_progress(blank):
    events = list(flash(blank.ports[0], IMAGE, settings=BOOK))
    size = len(load(IMAGE))
    for what in ("writing", "verifying"):
        done = [
            event.done for event in events if isinstance(event, JobProgress) and event.what == what
        ]
        assert done == list(range(256, size + 1, 256))
    texts = [event.text for event in events if isinstance(event, JobMessage)]
    assert texts[0].startswith("Mega 2560 on ")
    assert texts[-1].startswith("diffbot 0.2.0 on Mega 2560, settings ")
    assert texts[-1].endswith(", ready")


def test_the_former_program_can_be_saved(tmp_path):
    before = bytes.fromhex("ffcf") + bytes(range(1, 200))
    older, saved = tmp_path / "older.hex", tmp_path / "saved.hex"
    older.write_text(write_hex(before))
    with Emulator([], image=older, boot=bootloader(), pty=True, paced=True) as board:
        program = bytearray()
        with BoardSession(board.ports[0], BAUD) as session:
            session.reset()
            port = find_bootloader(session, BoardCode.MEGA2560)
            for progress in port.read(program):
                if progress.done > 2048:  # the rest is erased; all of it takes half a minute
                    break
        saved.write_text(write_hex(bytes(program).rstrip(b"\xff")))
    assert read_hex(saved.read_text())[: len(before)] == before


def test_no_bootloader_answers(tmp_path):
    """The firmware runs, but the board has no bootloader."""
    with (
        Emulator([], pty=True, paced=True) as board,
        pytest.raises(NoSyncError, match="no bootloader answers"),
    ):
        list(flash(board.ports[0], IMAGE))


def test_a_radio_port_is_refused(tmp_path):
    port = tmp_path / "rfcomm0"
    port.touch()
    with pytest.raises(RadioPortError, match="USB port only"):
        list(flash(str(port), IMAGE))


def test_no_image(tmp_path):
    with pytest.raises(BadImageError, match="No such file"):
        list(flash("/dev/null", tmp_path / "none.hex"))


@pytest.mark.parametrize("kind", ["pipe", "device"])
def test_an_image_that_is_no_file(kind, tmp_path):
    image = tmp_path / "image.hex"
    os.mkfifo(image) if kind == "pipe" else image.symlink_to("/dev/zero")
    with pytest.raises(BadImageError, match="device or a pipe, not a file"):
        list(flash("/dev/null", image))


def usb_port(device, vendor, product):
    return SerialPort(device, UsbDevice(vendor, product, "", "", "1-1", ()))


MEGA, OTHER_MEGA = (usb_port(f"/dev/ttyACM{n}", 0x2341, 0x0042) for n in (0, 1))
CLONE, OTHER_CLONE = (usb_port(f"/dev/ttyUSB{n}", 0x1A86, 0x7523) for n in (0, 1))


@pytest.mark.parametrize(
    ("found", "chosen"),
    [
        ([], NoBoardError),
        ([CLONE], "/dev/ttyUSB0"),
        ([MEGA, CLONE], "/dev/ttyACM0"),  # a clone's USB chip is used in other devices too
        ([MEGA, OTHER_MEGA], SeveralBoardsError),
        ([CLONE, OTHER_CLONE], SeveralBoardsError),
    ],
)
def test_choosing_a_board(found, chosen):
    if isinstance(chosen, str):
        assert board_ports.choose(found).device == chosen
    else:
        with pytest.raises(chosen):
            board_ports.choose(found)


def carry_out(procedure, reply_to):
    """Carry out a procedure with a board that sends the replies of `reply_to`."""
    reply = None
    while True:
        try:
            step = procedure.send(reply)
        except StopIteration:
            return
        reply = reply_to(step.body) if isinstance(step, BootloaderRequest) else b""


def test_a_page_that_reads_back_wrong():
    image = bytes(512)

    def reply(body):
        if body[0] == stk500.READ:
            return bytes([body[0], 0]) + b"\0" * 5 + b"\x01" + b"\0" * 250 + b"\0"
        return bytes([body[0], 0])

    with pytest.raises(VerifyMismatchError, match="0x00005 the board has 0x01 instead of 0x00"):
        carry_out(stk500.write("port", image), reply)


def test_a_command_that_is_refused():
    with pytest.raises(RefusedError, match="take an address"):
        carry_out(stk500.write("port", bytes(256)), lambda body: bytes([body[0], 0xC0]))


def test_replies_are_found_in_noise():
    """Noise, an old reply, half a reply, then the expected one."""
    parser = ReplyParser()
    stream = b"\x1b\x1b\x00noise" + message(6, b"\x01\x00old") + message(7, b"\x13\x00")
    replies = [parser.feed(bytes([byte]), 7) for byte in stream]
    assert [reply for reply in replies if reply is not None] == [b"\x13\x00"]
