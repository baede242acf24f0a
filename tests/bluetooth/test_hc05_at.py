"""An HC-05's rate, changed through the board: the conversation, and the whole of it as a command.

The board is the real bridge and the real firmware, one after the other, flashed through the real
bootloader; the module is a double on the board's radio port.
"""

import subprocess
from contextlib import closing
from pathlib import Path

import pytest

from diffbotctl.bluetooth.hc05_at import AtModeError, AtReplyReader, BaudChange, set_baud
from diffbotctl.config.lookup import folder
from diffbotctl.emulator.pseudo_terminal import PseudoTerminal
from diffbotctl.flash.intel_hex import read_hex
from tests.support.hc05 import Hc05
from tests.support.virtual_board import board, diffbotctl, flat

FIRMWARE = Path(__file__).parents[2] / "firmware"


def talk(baud, answers):
    """The commands sent, and the result, with these replies in order."""
    sent, conversation = [], set_baud(baud)
    command = next(conversation)
    for answer in answers:
        sent.append(command)
        try:
            command = conversation.send(answer)
        except StopIteration as end:
            return sent, end.value
        except AtModeError as error:
            return sent, str(error)
    return sent, None


OK = ["OK"]
OLD, NEW = ["+UART:9600,0,0", "OK"], ["+UART:115200,0,0", "OK"]


@pytest.mark.parametrize(
    ("answers", "sent", "end"),
    [
        # All well.
        (
            [OK, OLD, OK, NEW, OK],
            ["AT", "AT+UART?", "AT+UART=115200,0,0", "AT+UART?", "AT+RESET"],
            BaudChange(9600, 115200),
        ),
        # The first command after power-on is answered with an error, as many modules do.
        (
            [["ERROR:(0)"], OK, OLD, OK, NEW, OK],
            ["AT", "AT", "AT+UART?", "AT+UART=115200,0,0", "AT+UART?", "AT+RESET"],
            BaudChange(9600, 115200),
        ),
        # It has the rate already: nothing is changed.
        ([OK, NEW, OK], ["AT", "AT+UART?", "AT+RESET"], BaudChange(115200, 115200)),
        # In data mode nothing answers.
        ([[], [], []], ["AT"] * 3, "no answer to AT"),
        # It takes the command and does not do it.
        (
            [OK, OLD, OK, OLD],
            ["AT", "AT+UART?", "AT+UART=115200,0,0", "AT+UART?"],
            "it accepted the command, but its rate is still 9600 baud",
        ),
        # No answer to the last command is fine: it has restarted.
        (
            [OK, OLD, OK, NEW, []],
            ["AT", "AT+UART?", "AT+UART=115200,0,0", "AT+UART?", "AT+RESET"],
            BaudChange(9600, 115200),
        ),
        # An HC-06 does not know the question.
        (
            [OK, *[["ERROR:(0)"]] * 3],
            ["AT", *["AT+UART?"] * 3],
            "AT+UART? fails: unknown command",
        ),
        ([OK, ["OK"]], ["AT", "AT+UART?"], "it does not report its rate"),
    ],
)
def test_conversations(answers, sent, end):
    assert talk(115200, answers) == (sent, end)


@pytest.mark.parametrize(
    ("pieces", "complete", "lines"),
    [
        ([b"OK\r\n"], True, ["OK"]),
        ([b"+UART:96", b"00,0,0\r\nO", b"K\r\n"], True, ["+UART:9600,0,0", "OK"]),
        ([b"\r\n\r\n"], False, []),
        ([b"OK"], False, []),  # its line has not ended
        ([b"ERROR:(1D)\r\n"], True, ["ERROR:(1D)"]),
        ([b"\xff\xfe\r\nOK\r\n"], True, ["\N{REPLACEMENT CHARACTER}" * 2, "OK"]),
    ],
)
def test_lines(pieces, complete, lines):
    reader = AtReplyReader()
    ended = [reader.feed(piece) for piece in pieces]
    assert ended[-1] is complete and not any(ended[:-1])
    assert reader.lines == lines


def test_the_command_changes_module_and_board(tmp_path):
    mine = tmp_path / "mine.yaml"
    before = (folder("robots") / "book_2wd.yaml").read_text()
    mine.write_text(before)
    with board() as virtual, Hc05(virtual.radio, first_errors=1) as module:
        code, output = diffbotctl(
            "bluetooth", "baud", 115200, "--port", virtual.usb, "--robot", mine, "--yes"
        )
        assert code == 0, output
        assert module.rate == 115200 and module.restarted
        assert module.commands[-4:] == ["AT+UART?", "AT+UART=115200,0,0", "AT+UART?", "AT+RESET"]
        output = flat(output)
        assert "went from 9600 to 115200 baud" in output
        assert "+link: {protocol: diffbot, uart: 1, baud: 115200}" in output  # of the difference
        assert "ready" in output  # our firmware is back, with its settings
        assert mine.read_text() == before.replace("baud: 9600}", "baud: 115200}") != before
        code, output = diffbotctl("blink", "--port", virtual.usb, "--robot", mine, "--times", 1)
        assert code == 0, output


def test_a_robot_file_that_cannot_be_written_is_reported_with_the_line(monkeypatch):
    monkeypatch.chdir(folder("robots").parent)  # where ./robots are the files that ship
    with board() as virtual, Hc05(virtual.radio) as module:
        code, output = diffbotctl(
            "bluetooth", "baud", 115200, "--port", virtual.usb, "--robot", "book_2wd", "--yes"
        )
        assert module.rate == 115200
    assert code == 1 and "E-CALIBRATE-WRITE" in output, output
    assert "still states 9600 baud" in flat(output) and "link: {baud: 115200}" in output


def test_a_module_in_data_mode_leaves_the_firmware_on_the_board():
    with board() as virtual, Hc05(virtual.radio, at_mode=False) as module:
        code, output = diffbotctl(
            "bluetooth", "baud", 115200, "--port", virtual.usb, "--robot", "book_2wd", "--yes"
        )
        assert code == 1
        assert "E-BLUETOOTH-AT" in output and "blink slowly" in flat(output)
        assert module.rate == 9600 and module.commands == []
        code, output = diffbotctl(
            "blink", "--port", virtual.usb, "--robot", "book_2wd", "--times", 1
        )
        assert code == 0, output


def test_without_a_terminal_yes_is_required():
    with closing(PseudoTerminal()) as port:
        words = ("bluetooth", "baud", 9600, "--port", port.name, "--robot", "book_2wd")
        code, output = diffbotctl(*words)
    assert code == 2 and "--yes" in output


def test_the_bridge_is_what_its_source_gives(tmp_path):
    fresh = tmp_path / "firmware"
    fresh.mkdir()
    for name in ("Makefile", "bridge.c"):
        (fresh / name).write_bytes((FIRMWARE / name).read_bytes())
    subprocess.run(["make", "-C", fresh, "bridge_mega2560.hex"], check=True, capture_output=True)
    shipped = FIRMWARE / "bridge_mega2560.hex"
    assert (fresh / shipped.name).read_bytes() == shipped.read_bytes()
    assert len(read_hex(shipped.read_text(), shipped.name)) == 768
