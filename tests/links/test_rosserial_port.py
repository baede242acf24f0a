"""The serial robot's driver with the rosserial host, on a pseudo-terminal at the real baud pace."""

import os
import pty
import select
import time
import tty

import pytest

from diffbotctl.drivers.serial_port import SerialPortDevice
from diffbotctl.drivers.serial_robot import BoardWatchdog, SerialRobot
from diffbotctl.drivers.watchdog_process import WatchdogProcess
from diffbotctl.links.rosserial_host import RosserialHost
from diffbotctl.messages import Duty, Encoders, Stop
from tests.support.rosserial_device import RATED, RosserialDevice, RosserialDevicePort

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


class SuspendedHost(RosserialHost):
    """While `suspended_in` is set, `send` returns only after that process has intervened, as for
    an engine that is suspended with a computed frame."""

    suspended_in = None
    written_before = None

    def send(self, now):
        data = super().send(now)
        if self.suspended_in is not None and data:
            watchdog, self.suspended_in = self.suspended_in, None
            while not watchdog.process.intervened:
                assert select.select(watchdog.files(), [], [], TIMEOUT_S)[0]
                watchdog.process.poll()
            self.written_before = watchdog.written
        return data


def test_a_frame_computed_before_the_watchdog_intervened_is_never_written(terminal):
    board, name = terminal
    with RosserialDevicePort(RosserialDevice(1), board):
        host = SuspendedHost(RATED)
        watchdog = BoardWatchdog(WatchdogProcess(), host)
        robot = SerialRobot(host, lambda: SerialPortDevice(name, 9600), watchdog)
        duty = Duty(0, 0.8, 0.6)
        serve_until(robot, lambda messages: any(getattr(m, "left", 0) > 20 for m in messages), duty)
        host.suspended_in = watchdog
        while host.written_before is None:  # another duty: a frame like none before it
            robot.command(time.monotonic_ns(), Duty(0, 0.3, 0.2))
        assert robot.unsent == b"" and watchdog.written == host.written_before
        messages = serve_until(robot, lambda messages: any(isinstance(m, Stop) for m in messages))
        assert [m.code for m in messages if isinstance(m, Stop)] == ["host_frozen"]
        robot.stop(time.monotonic_ns())
        serve_until(robot, lambda _: robot.stopped)
        robot.close()
