"""The USB port of a Pico, as a host sees it: its link, who reads it, and the way to BOOTSEL."""

import subprocess

import pytest

from diffbotctl.emulator.emulated_robot import board_emulator
from diffbotctl.emulator.program import SOURCES, image_of
from diffbotctl.links import diffbot_frames as frames
from diffbotctl.links.diffbot_codec import FrameDecoder, encode
from diffbotctl.time import MILLISECOND as MS
from tests.support.board_bench import PICO, speed

UART, USB = 0, 1
FOUND = 40 * MS  # by then the host has found the port and opened it


class Port:
    """One side of the emulated board."""

    def __init__(self, emulator, uart=USB):
        self.emulator, self.uart = emulator, uart
        self.decoder = FrameDecoder()
        self.result = None

    def wait(self, ms, *messages):
        data = b"".join(encode(each) for each in messages)
        data = b"\0" + data if data else b""
        received = (data, b"") if self.uart == UART else (b"", data)
        self.result = self.emulator.step(self.emulator.now + ms * MS, None, None, received)
        return list(self.decoder.feed(self.result.bytes_of(self.uart)))

    def ready(self):
        self.wait(20, frames.AskFrame(frames.VERSION))
        self.wait(60, PICO.frame())
        self.wait(10, frames.StopFrame(15))


@pytest.fixture
def emulator():
    with board_emulator(PICO) as emulator:
        emulator.step(FOUND)
        yield emulator


def of(kind, arrived):
    return [frame for frame in arrived if isinstance(frame, kind)]


def test_it_answers_with_its_link_and_takes_settings(emulator):
    port = Port(emulator)
    arrived = port.wait(20, frames.AskFrame(frames.VERSION))
    assert of(frames.HelloFrame, arrived)[0].uart == USB
    (answer,) = of(frames.AnswerFrame, port.wait(60, PICO.frame()))
    assert answer.settings == PICO.mark()
    assert len(of(frames.StateFrame, port.wait(1000))) in (37, 38, 39)
    port.wait(20, frames.StopFrame(15))
    port.wait(20, speed(1, 5.0, 5.0))
    assert any(change.duty for change in port.result.changes)


def test_what_no_program_reads_does_not_count_as_lost(emulator):
    """The port is closed, and a host on the other link gets no report of a loss."""
    Port(emulator).ready()
    emulator.set_usb_port(115200, False)
    radio = Port(emulator, UART)
    radio.wait(60, frames.AskFrame(frames.VERSION))
    arrived = radio.wait(2000)
    assert len(of(frames.StateFrame, arrived)) > 70
    assert not any(frame.dropped for frame in of(frames.StateFrame, arrived))
    emulator.set_usb_port(115200, True)
    assert of(frames.StateFrame, Port(emulator).wait(200))


def test_a_touch_stops_the_motors_and_shows_the_drive(emulator):
    port = Port(emulator)
    port.ready()
    port.wait(20, speed(1, 5.0, 5.0))
    duties = {change.motor: change.duty for change in port.result.changes}
    assert all(duties.values())
    emulator.set_usb_port(1200, True)
    port.wait(5)
    assert not port.result.in_bootsel
    emulator.set_usb_port(1200, False)
    port.wait(10)
    duties |= {change.motor: change.duty for change in port.result.changes}
    assert port.result.in_bootsel and not any(duties.values())
    port.wait(50, frames.AskFrame(frames.VERSION))
    assert not port.result.sent
    emulator.program(image_of(frames.BoardCode.RP2040).read_bytes())
    port.wait(FOUND // MS)
    emulator.set_usb_port(115200, True)
    port.wait(10)
    assert of(frames.HelloFrame, port.wait(20, frames.AskFrame(frames.VERSION)))


def test_closing_at_another_rate_is_no_touch(emulator):
    port = Port(emulator)
    port.ready()
    emulator.set_usb_port(9600, True)
    emulator.set_usb_port(9600, False)
    port.wait(20)
    assert not port.result.in_bootsel and not port.result.was_reset


def test_a_restart_is_found_again(emulator):
    port = Port(emulator)
    port.ready()
    emulator.reset()
    port.wait(FOUND // MS)
    assert port.result.was_reset
    assert of(frames.HelloFrame, port.wait(20, frames.AskFrame(frames.VERSION)))


DESCRIPTORS = """
const { readFileSync } = await import("node:fs");
const { Board } = await import(process.argv[1]);
const board = new Board({ image: readFileSync(process.argv[2]), motors: [], sonars: [] });
board.run(Number(process.argv[3]));
for (const each of board.usb.descriptors) console.log(Buffer.from(each).toString("hex"));
"""


def test_its_serial_number_is_that_of_its_flash_memory():
    """So that two Picos have different names below /dev/serial/by-id."""
    board = SOURCES / "rp2040" / "board.mjs"
    words = ["node", "--input-type=module", "-e", DESCRIPTORS, board, image_of(PICO.board), FOUND]
    done = subprocess.run(map(str, words), capture_output=True, text=True, check=True)
    device, *_, serial = [bytes.fromhex(line) for line in done.stdout.split()]
    assert device[16] == 3  # number of the string
    assert serial[2:].decode("utf-16-le") == "E66058388332172C"  # of flash.mjs
