"""The serial robot's driver with the rosserial host, on a pseudo-terminal at the real baud pace."""

import os
import pty
import select
import time
import tty

import pytest

from diffbotctl.drivers.serial_port import SerialPortDevice
from diffbotctl.drivers.serial_robot import SerialRobot
from diffbotctl.links.rosserial_host import RosserialHost
from diffbotctl.messages import Duty, Encoders
from diffbotctl.testing.rosserial_device import RATED, RosserialDevice, RosserialDevicePort

TIMEOUT_S = 60.0


@pytest.fixture
def terminal():
    """A pseudo-terminal: file of the board's end, name of the host's end."""
    board, host = pty.openpty()
    tty.setraw(host)
    yield board, os.ttyname(host)
    os.close(host)
    os.close(board)


def serve_until(robot, enough, drive=None):
    """Serve the driver until `enough(messages)`; returns the messages."""
    messages, begin = [], time.monotonic_ns()
    while not enough(messages):
        now = time.monotonic_ns()
        assert now - begin < TIMEOUT_S * 1e9, messages[-3:]
        select.select(robot.files(), [], [], min(0.05, max(0, robot.due() - now) / 1e9))
        for delivery in robot.deliver(time.monotonic_ns()):
            messages.append(delivery.message)
            if drive is not None and isinstance(delivery.message, Encoders):
                robot.command(time.monotonic_ns(), drive)
    return messages


def test_negotiates_drives_and_stops(terminal):
    board, name = terminal
    with RosserialDevicePort(RosserialDevice(1), board) as device:
        host = RosserialHost(RATED)
        robot = SerialRobot(host, lambda: SerialPortDevice(name, 9600))
        duty = Duty(0, 0.8, 0.6)
        serve_until(robot, lambda messages: any(getattr(m, "left", 0) > 20 for m in messages), duty)
        assert device.commands["set_left_speed"][-1][1] == 204  # 0.8 of 255
        robot.stop(time.monotonic_ns())
        serve_until(robot, lambda _: robot.stopped)
        assert device.pwm == [0, 0]
        robot.close()
