"""The real robot behind a serial port, with a guardian where its board cannot stop by itself."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from math import pi

from diffbotctl.config.configuration import Configuration
from diffbotctl.config.robot import Robot
from diffbotctl.drivers.guardian import Guardian
from diffbotctl.drivers.port import Port
from diffbotctl.drivers.serial_robot import SerialRobot
from diffbotctl.errors import Problem, RunError
from diffbotctl.links.rosserial import RosserialHost

SECOND = 1_000_000_000
TICK_BYTES, BITS = 16, 10  # of the pair of ticks, what is sent after the counts were taken
NO_DEADMAN = """\
Note: this board cannot stop by itself when the host falls silent. A guardian process
does it if diffbotctl dies; nothing can if the cable or the radio fails."""


def serial_robot(
    configuration: Configuration, device: str, tell: Callable[[str], None]
) -> SerialRobot:
    """Open `device` and drive the configuration's robot through it. Raises RunError."""
    robot = configuration.robot
    assert robot is not None
    if robot.link.protocol != "rosserial":
        cause = f"this version cannot speak the protocol {robot.link.protocol} to a real board"
        fix = "use a robot file with link: {protocol: rosserial}, such as book_2wd_stock"
        raise RunError(Problem("E-PORT-PROTOCOL", device, cause, fix))
    guardian = Guardian()
    try:
        port = Port(device, robot.link.baud)
    except OSError as error:
        guardian.dismiss()
        cause = error.strerror or str(error)
        fix = "is the board plugged in, or the Bluetooth module paired and bound?"
        raise RunError(Problem("E-PORT-OPEN", f"port {device}", cause, fix)) from error
    except RunError:
        guardian.dismiss()
        raise
    tell(NO_DEADMAN)
    driver = SerialRobot(host(robot), partial(Port, device, robot.link.baud), guardian)
    driver.adopt(0, port)
    return driver


def host(robot: Robot) -> RosserialHost:
    """The protocol that this robot's board speaks."""
    drive, link = robot.drive, robot.link
    return RosserialHost(
        drive.left.motor.rated * drive.left.encoder.slots / (2 * pi),
        baud=link.baud,
        sensor=next(iter(robot.sensors), "front"),
        command_delay=round(link.command_delay * SECOND),
        wire_time=TICK_BYTES * BITS * SECOND // link.baud,
    )
