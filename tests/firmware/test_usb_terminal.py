"""The pseudo-terminal that stands for the USB port of a virtual board."""

import os
import termios

from diffbotctl.emulator.pseudo_terminal import OUTPUT_SPEED, UsbTerminal


def open_at(name, rate):
    """Open the port as a client does, at a rate of termios."""
    port = os.open(name, os.O_RDWR | os.O_NOCTTY)
    attributes = termios.tcgetattr(port)
    attributes[OUTPUT_SPEED - 1] = attributes[OUTPUT_SPEED] = rate
    termios.tcsetattr(port, termios.TCSANOW, attributes)
    return port


def test_a_client_that_opens_sets_its_rate_and_closes():
    terminal = UsbTerminal()
    terminal.changed()
    assert not terminal.is_open
    port = open_at(terminal.name, termios.B115200)
    assert terminal.changed() and terminal.is_open and terminal.baud == 115200
    assert not terminal.changed()
    os.close(port)
    assert terminal.changed() and not terminal.is_open
    terminal.close()


def test_a_client_that_has_come_and_gone_between_two_calls_is_reported_as_open_and_then_as_closed():
    terminal = UsbTerminal()
    terminal.changed()
    os.close(open_at(terminal.name, termios.B1200))
    assert terminal.changed() and terminal.is_open and terminal.baud == 1200
    assert terminal.changed() and not terminal.is_open and terminal.baud == 1200
    assert not terminal.changed()
    terminal.close()
