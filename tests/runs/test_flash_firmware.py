"""`flash firmware` and `blink` at the prompt, on a board with the stock bootloader."""

import fcntl
import os
import re
import select
import signal
import termios
import time
from contextlib import closing, suppress

import pytest

from diffbotctl.drivers import board_ports
from diffbotctl.drivers.serial_port import SerialPortDevice
from diffbotctl.emulator.pseudo_terminal import PseudoTerminal
from diffbotctl.errors import RunError
from diffbotctl.flash.flasher import flash as job
from diffbotctl.flash.intel_hex import write_hex
from tests.sampling import by_day
from tests.support.board_bench import BOOK
from tests.support.command_process import command_line, start_in_pipe, start_on_terminal
from tests.support.fake_machine import FakeMachine
from tests.support.virtual_board import (
    LONGEST,
    board,
    diffbotctl,
    flash,
    flat,
    wait_until,
)

HANGS = bytes.fromhex("ffcf")  # rjmp to itself
MEGA, CLONE = (0x2341, 0x0042), (0x1A86, 0x7523)


def written(virtual, at):
    """Whether the board's flash has something at this address."""
    return virtual.board.emulator.flash(at, 1) != b"\xff"


@pytest.mark.parametrize("how", by_day(1, [signal.SIGINT, signal.SIGKILL]))
def test_an_interrupted_flash_can_be_done_again_and_then_the_light_blinks(how):
    with board(image=None) as virtual:
        words = ("flash", "firmware", "--port", virtual.usb, "--robot", "book_2wd", "--yes")
        first = start_in_pipe(command_line(*words))
        wait_until(lambda: written(virtual, 1024))
        first.send_signal(how)
        output, _ = first.communicate()
        assert not written(virtual, 7936), "it was not to be whole yet"
        if how == signal.SIGINT:
            assert first.returncode == 130
            assert "run `flash firmware` again" in output
        code, output = flash(virtual)
        assert code == 0, output
        code, output = diffbotctl("blink", "--port", virtual.usb, "--times", 2)
        assert code == 0, output
        assert "now blinks 2 times" in output
        assert "38 frames a second, 0 damaged, 0 lost" in output


def test_a_person_is_asked_and_sees_how_far_it_is():
    """On a terminal, that is; the question is answered with n, and then with y."""
    with board(image=None) as virtual:
        words = ("flash", "firmware", "--port", virtual.usb, "--robot", "book_2wd")
        code, _ = on_a_terminal(words, b"n\n")
        assert code == 130
        assert not written(virtual, 0)
        code, screen = on_a_terminal(words, b"y\n")
    assert code == 0, screen
    assert "wheels off the ground" in screen
    for part in ("writing", "verifying", "100%", "settings", "ready"):
        assert part in screen


def on_a_terminal(words, answer):
    """Run a command on a terminal of its own, answer its question; (exit code, what it showed)."""
    master, slave = os.openpty()
    process = start_on_terminal(command_line(*words), slave, {**os.environ, "TERM": "xterm"})
    os.close(slave)
    shown, until = b"", time.monotonic() + LONGEST
    with suppress(OSError):  # the terminal hangs up when the command has ended
        while time.monotonic() < until:
            if select.select([master], [], [], 0.1)[0]:
                shown += os.read(master, 4096)
            if b"[y/N]" in shown and answer:
                os.write(master, answer)
                answer = b""
    os.close(master)
    return process.wait(LONGEST), shown.decode(errors="replace")


def test_no_terminal_to_ask_on_is_no_consent():
    with closing(PseudoTerminal()) as port:
        code, output = diffbotctl("flash", "firmware", "--port", port.name, "--robot", "book_2wd")
    assert code == 2
    assert "--yes" in output


def test_avrdude_does_it_as_well_and_a_robot_file_of_the_other_protocol_is_named():
    with board(image=None) as virtual:
        words = ("flash", "firmware", "--port", virtual.usb, "--robot", "book_2wd_stock", "--yes")
        code, output = diffbotctl(*words, "--programmer", "avrdude")
    assert code == 0, output
    assert "written and verified by avrdude" in output
    assert "link: {protocol: diffbot}" in flat(output)
    assert "ready" in output


def test_a_port_in_use_names_who_uses_it():
    with closing(PseudoTerminal()) as port, closing(SerialPortDevice(port.name, 115200)):
        for programmer in ("built-in", "avrdude"):
            words = ("flash", "firmware", "--port", port.name, "--robot", "book_2wd", "--yes")
            code, output = diffbotctl(*words, "--programmer", programmer)
            assert code == 1
            assert "E-PORT-BUSY" in output
            assert f"(process {os.getpid()})" in flat(output)


def test_a_port_that_is_not_there():
    for words in (("flash", "firmware", "--yes"), ("blink",)):
        code, output = diffbotctl(*words, "--robot", "book_2wd", "--port", "/dev/ttyACM99")
        assert code == 1
        assert "E-PORT-OPEN" in output and "there is no such port" in output


def refused(forbid):
    """The error of a port that `forbid` has been applied to; root has every right, so it looks as
    the user `nobody`."""
    master, slave = os.openpty()
    forbid(slave)
    us = os.geteuid()
    try:
        if us == 0:
            os.seteuid(65534)
        with pytest.raises(RunError) as raised:
            SerialPortDevice(os.ttyname(slave), 9600)
    finally:
        os.seteuid(us)
        os.close(master)
        os.close(slave)
    return raised.value.problems[0]


def test_a_port_without_the_right_to_it():
    problem = refused(lambda slave: os.fchmod(slave, 0))
    assert problem.code == "E-PORT-RIGHTS"
    assert re.search(r"usermod -aG \w+ \$USER", problem.fix)


def test_a_port_that_another_program_keeps_for_itself():
    """ModemManager and serial monitors do so; the kernel then lets only root open it."""

    def keep(slave):
        os.fchmod(slave, 0o666)
        fcntl.ioctl(slave, termios.TIOCEXCL)

    assert refused(keep).code == "E-PORT-BUSY"


def test_a_program_that_publishes_nothing(tmp_path):
    silent = tmp_path / "silent.hex"
    silent.write_text(write_hex(HANGS))
    with board(image=None) as virtual, pytest.raises(RunError) as raised:
        list(job(str(virtual.usb), silent, settings=BOOK))
    problem = raised.value.problems[0]
    assert problem.code == "E-FLASH-SILENT"
    assert "written and verified" in problem.cause and "nothing answers" in problem.cause


def test_another_program_is_written_and_left_alone(tmp_path):
    other = tmp_path / "other.hex"
    other.write_text(write_hex(HANGS))
    with board() as virtual:
        code, output = flash(virtual, "--hex", other)
        assert code == 0, output
        assert virtual.board.emulator.flash(0, 2) == HANGS
    assert "256 bytes written and verified" in output


def test_a_backup_overwrites_nothing(tmp_path):
    earlier = tmp_path / "earlier.hex"
    earlier.write_text("the only copy")
    for file, cause in ((earlier, "exists"), (tmp_path / "nowhere" / "b.hex", "folder")):
        with closing(PseudoTerminal()) as port:
            words = ("flash", "firmware", "--port", port.name, "--robot", "book_2wd", "--yes")
            code, output = diffbotctl(*words, "--backup", file)
        assert (code, "E-FLASH-BACKUP" in output, cause in output) == (1, True, True), output
    assert earlier.read_text() == "the only copy"


@pytest.mark.nightly
def test_what_was_on_the_board_comes_back(tmp_path):
    """Reading the whole board takes half a minute of its time."""
    endless_loop = b"\xff\xcf"  # rjmp to itself: the chip can run what was on the board
    before = endless_loop + bytes(range(1, 248))
    older, saved = tmp_path / "older.hex", tmp_path / "saved.hex"
    older.write_text(write_hex(before))
    with board(image=older) as virtual:
        code, output = flash(virtual, "--backup", saved)
        assert code == 0, output
        assert virtual.board.emulator.flash(0, len(before)) != before
        assert flash(virtual, "--hex", saved)[0] == 0
        assert virtual.board.emulator.flash(0, len(before)) == before


@pytest.mark.parametrize(
    ("ports", "radio", "found"),
    [
        ({}, False, []),
        ({"ttyS0": None}, True, []),  # a port of the mainboard
        ({"ttyUSB0": (0x067B, 0x2303)}, True, ["ttyUSB0"]),  # a PL2303, which a clone may carry
        ({"ttyUSB0": (0x1234, 0x5678)}, True, []),  # in no list: only named, never chosen
        ({"ttyUSB0": CLONE, "ttyACM0": MEGA}, False, ["ttyACM0", "ttyUSB0"]),
        ({"rfcomm0": None, "ttyACM0": MEGA}, False, ["ttyACM0"]),
        ({"rfcomm0": None, "ttyACM0": MEGA}, True, ["rfcomm0", "ttyACM0"]),
    ],
)
def test_which_ports_may_lead_to_a_board(tmp_path, ports, radio, found):
    machine = FakeMachine(tmp_path / "machine")
    for number, (name, usb) in enumerate(ports.items(), 1):
        machine.port(name, usb, place=f"1-{number}")
    assert [port.device for port in board_ports.candidates(radio, machine.root)] == [
        f"/dev/{name}" for name in found
    ]


def test_a_board_has_a_name_that_stays(tmp_path):
    machine = FakeMachine(tmp_path / "machine")
    machine.port("ttyACM0", MEGA, by_id="usb-Arduino_Mega_1-if00")
    (port,) = board_ports.candidates(root=machine.root)
    assert port.name == "/dev/serial/by-id/usb-Arduino_Mega_1-if00"
