"""A calibration that is ended by a signal: the robot is stopped, and that is reported."""

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
