"""A calibration that is ended by a signal, or whose motion is stopped by a key."""

import signal

import pytest

from diffbotctl.cli.main import INTERRUPTED
from tests.support.command_process import command_line
from tests.support.terminal import Terminal


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGQUIT, signal.SIGTERM, signal.SIGHUP])
def test_a_signal_ends_in_a_stop(number, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    line = command_line("calibrate", "motors", "--port", "sim", "--robot", "book_2wd")
    with Terminal(line) as terminal:
        terminal.until(lambda text: "Press Enter to start" in text)
        terminal.process.send_signal(number)
        assert terminal.ended() == INTERRUPTED
        assert "Interrupted: the robot is stopped" in terminal.text


def test_a_key_in_a_drive_costs_that_drive_and_answers_no_question(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    words = ("distance", "--port", "sim", "--robot", "book_2wd", "--metres", 5, "--repeats", 2)
    with Terminal(command_line("calibrate", *words, "--dry-run")) as terminal:
        terminal.until(lambda text: "Press Enter to start" in text)
        terminal.type("\n")
        terminal.until(lambda text: "1 of 2: Put the robot at the start" in text)
        terminal.until(lambda text: "Press Enter when you are ready" in text)
        terminal.type("\n")
        text = terminal.until(lambda text: "The robot moves; any key stops it" in text)
        assert "Press Enter" not in text  # the questions have gone
        terminal.type("\n")
        terminal.until(lambda text: "A key stopped the robot" in text)
        terminal.until(lambda text: "To repeat it type y and Enter" in text)
        terminal.type("\n")  # pressed once more in haste
        terminal.until(lambda text: "Nothing moves: only y or yes" in text)
        terminal.type("y\n")
        terminal.until(lambda text: "Drive 1 of 2: distance from the mark" in text)
        terminal.type("\n")  # what the tape reads
        terminal.until(lambda text: "2 of 2: Put the robot at the start" in text)
        terminal.type("no\n")
        assert terminal.ended() == 1
