"""The real robot behind a serial port, with a guardian where its board cannot stop by itself."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import partial
from math import pi

from diffbotctl.config.robot import Robot
from diffbotctl.drivers.board_candidates import is_usb
from diffbotctl.drivers.serial_port import open_port, reopen_port
from diffbotctl.drivers.serial_robot import SerialRobot
from diffbotctl.drivers.watchdog_process import WatchdogProcess
from diffbotctl.emulator.robot import board_settings
from diffbotctl.errors import RunError
from diffbotctl.links.diffbot_host import DiffbotHost
from diffbotctl.links.rosserial_host import RosserialHost
from diffbotctl.time import SECOND

TICK_BYTES, BITS = 16, 10  # of the pair of ticks, what is sent after the counts were taken
NO_DEADMAN = """\
Note: this board cannot stop by itself when the host falls silent. A guardian process
does it if diffbotctl dies; nothing can if the cable or the radio fails."""


def serial_robot(
    robot: Robot, device: str, tell: Callable[[str], None], now: int = 0
) -> SerialRobot:
    """Open `device` at `now` (ns) and drive `robot` through it. Raises RunError."""
    if robot.link.protocol == "rosserial":
        return _stock(robot, device, tell, now)
    host = diffbot_host(robot, device)
    driver = SerialRobot(host, lambda: reopen_port(device, host.baud))
    driver.adopt(now, open_port(device, host.baud))
    return driver


def _stock(robot: Robot, device: str, tell: Callable[[str], None], now: int) -> SerialRobot:
    """A board with the book's firmware: a guardian stands in for the dead-man's stop it lacks."""
    guardian = WatchdogProcess()
    try:
        port = open_port(device, robot.link.baud)
    except RunError:
        guardian.dismiss()
        raise
    tell(NO_DEADMAN)
    driver = SerialRobot(
        rosserial_host(robot), partial(reopen_port, device, robot.link.baud), guardian
    )
    driver.adopt(now, port)
    return driver


def diffbot_host(robot: Robot, device: str) -> DiffbotHost:
    """The host's half for a board with our firmware; a USB port always means UART0 at 115200."""
    settings = board_settings(robot)
    if is_usb(device):
        settings = replace(settings, uart=0)
    return DiffbotHost(settings)


def rosserial_host(robot: Robot) -> RosserialHost:
    """The host's half for a board with the book's firmware."""
    drive, link = robot.drive, robot.link
    return RosserialHost(
        drive.left.motor.rated * drive.left.encoder.slots / (2 * pi),
        baud=link.baud,
        sensor=next(iter(robot.sensors), "front"),
        command_delay=round(link.command_delay * SECOND),
        wire_time=TICK_BYTES * BITS * SECOND // link.baud,
    )
