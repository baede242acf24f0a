"""Flashing over a line that loses messages, and boards that start late or store a wrong byte."""

import os
import time
import tty

import pytest

from diffbotctl.drivers.board_ports import RefusedError, VerifyMismatchError
from diffbotctl.emulator.process import Emulator
from diffbotctl.emulator.program import IMAGE, bootloader
from diffbotctl.flash.flasher import flash, load
from diffbotctl.flash.intel_hex import PAGE_BYTES, write_hex
from diffbotctl.links.stk500_frames import message, parity
from tests.sampling import by_day
from tests.support.background import BackgroundDevice
from tests.support.lossy_line import LossyLine


@pytest.mark.parametrize(
    ("to_board", "to_host"),
    by_day(1, [(3001, 3499), (1999, 0), (0, 2503)]),
    ids=["both", "requests damaged", "replies damaged"],
)
def test_lost_messages_are_repeated_and_the_flash_is_right(to_board, to_host):
    with (
        Emulator([], image=None, boot=bootloader(), pty=True, paced=True) as board,
        LossyLine(board.ports[0], to_board, to_host) as line,
    ):
        list(flash(line.name, IMAGE))
        image = load(IMAGE)
        assert board.flash(0, len(image)) == image
        assert board.dirty_writes() == 0


def test_a_dead_line_is_an_error():
    with (
        Emulator([], image=None, boot=bootloader(), pty=True, paced=True) as board,
        LossyLine(board.ports[0], cut_after=4000) as line,
        pytest.raises(RefusedError, match="refused to answer when asked"),
    ):
        list(flash(line.name, IMAGE))


class LateBootloader(BackgroundDevice):
    """A bootloader that answers after `delay` s, and stores a wrong byte `spoilt` times."""

    def __init__(self, delay=0.0, spoilt=0):
        self.delay, self.spoilt = delay, spoilt
        self.master, self.slave = os.openpty()
        tty.setraw(self.slave)
        self.name = os.ttyname(self.slave)
        os.set_blocking(self.master, False)
        self.memory, self.address, self.begun = bytearray(b"\xff" * 65536), 0, time.monotonic()
        self.begin()

    def let_go(self):
        os.close(self.master)
        os.close(self.slave)

    def live(self):
        data = b""
        while not self.over.wait(0.001):
            try:
                data += os.read(self.master, 4096)
            except BlockingIOError:
                continue
            if time.monotonic() < self.begun + self.delay:
                data = b""
            while len(data) > 6 and len(data) >= 6 + int.from_bytes(data[2:4], "big"):
                size = int.from_bytes(data[2:4], "big")
                whole, data = data[: size + 6], data[size + 6 :]
                assert parity(whole) == 0
                os.write(self.master, message(whole[1], self.reply(whole[5:-1])))

    def reply(self, body):
        if body[0] == 0x01:
            return b"\x01\x00\x08AVRISP_2"
        if body[0] == 0x1D:
            return bytes([0x1D, 0, 0, 0x30, 0, b"\x1e\x98\x01"[body[6]], 0])
        if body[0] == 0x06:
            self.address = 2 * int.from_bytes(body[2:5], "big")
        if body[0] == 0x13:
            page = bytearray(body[10:])
            if self.spoilt and self.address == PAGE_BYTES:
                self.spoilt -= 1
                page[7] ^= 4
            self.memory[self.address : self.address + len(page)] = page
            self.address += PAGE_BYTES
        if body[0] == 0x14:
            page = bytes(self.memory[self.address : self.address + PAGE_BYTES])
            self.address += PAGE_BYTES
            return bytes([0x14, 0]) + page + b"\0"
        return bytes([body[0], 0])


@pytest.fixture
def image(tmp_path):
    file = tmp_path / "image.hex"
    file.write_text(write_hex(bytes(range(256)) * 3))
    return file


@pytest.mark.parametrize("delay", [1.8, 3.2])
def test_a_bootloader_that_starts_late_is_waited_for(image, delay):
    with LateBootloader(delay=delay) as board:
        list(flash(board.name, image))
        assert board.memory[:768] == bytes(range(256)) * 3


def test_a_damaged_page_is_written_again(image):
    with LateBootloader(spoilt=1) as board:
        texts = [event.text for event in flash(board.name, image) if hasattr(event, "text")]
        assert "writing everything once more" in texts[1]
        assert board.memory[:768] == bytes(range(256)) * 3


def test_a_page_that_stays_damaged_is_an_error(image):
    with (
        LateBootloader(spoilt=9) as board,
        pytest.raises(VerifyMismatchError, match="0x00107 the board has 0x03 instead of 0x07"),
    ):
        list(flash(board.name, image))
