"""The host side of the serial link that a robot file describes: its protocol and its settings."""

from __future__ import annotations

from dataclasses import replace
from math import pi

from diffbotctl.config.robot import Robot, SideSection
from diffbotctl.control.speed_loop import speed_gains
from diffbotctl.drivers.board_ports import is_usb
from diffbotctl.errors import ConfigurationError, Problem
from diffbotctl.links.diffbot_host import DiffbotHost
from diffbotctl.links.diffbot_settings import BoardSettings, WheelSettings
from diffbotctl.links.rosserial_host import RosserialHost
from diffbotctl.time import SECOND

FIRMWARE_BOARD = "mega2560"
FIRST_ANALOG = 54  # number of pin A0 on a Mega 2560
TICK_BYTES, BITS_PER_BYTE = 16, 10  # what is sent of a pair of ticks after the counts were taken


def diffbot_host(robot: Robot, device: str) -> DiffbotHost:
    """The protocol for a board with our firmware; a USB port always means UART0 at 115200 baud."""
    settings = board_settings(robot)
    return DiffbotHost(replace(settings, uart=0) if is_usb(device) else settings)


def rosserial_host(robot: Robot) -> RosserialHost:
    """The protocol for a board with the book's firmware."""
    left, link = robot.drive.left, robot.link
    return RosserialHost(
        left.motor.rated * left.encoder.slots / (2 * pi),
        baud=link.baud,
        sensor=next(iter(robot.sensors), "front"),
        command_delay=round(link.command_delay * SECOND),
        wire_time=TICK_BYTES * BITS_PER_BYTE * SECOND // link.baud,
    )


def board_settings(robot: Robot) -> BoardSettings:
    """The settings that our firmware needs of this robot.

    Raises ConfigurationError for a board that it does not run on.
    """
    if robot.board.type != FIRMWARE_BOARD:
        cause = f"there is no diffbotctl firmware for the board {robot.board.type}"
        fix = f"use a Mega 2560 (board: {{type: {FIRMWARE_BOARD}}}), or simulate: --port sim"
        raise ConfigurationError(Problem("E-BOARD-KIND", "board.type", cause, fix))
    left, right, board, battery = robot.drive.left, robot.drive.right, robot.board, robot.battery
    name, sensor = next(iter(robot.sensors.items()), ("range", None))
    return BoardSettings(
        _wheel_settings(left),
        _wheel_settings(right),
        slots=left.encoder.slots,
        edge=left.encoder.edge,
        glitch=round(left.encoder.glitch * SECOND),
        deadman=round(board.deadman * SECOND),
        telemetry=round(board.telemetry),
        edge_times=board.edge_times,
        proportional=left.motor.loop.proportional,
        integral=left.motor.loop.integral,
        brake=left.motor.idle == "brake",
        range_channel=None if sensor is None else _analog_channel(sensor.pin),
        range_name=name,
        battery_channel=None if battery.pin is None else _analog_channel(battery.pin),
        battery_divider=battery.divider or 1.0,
        battery_low=battery.low,
        button=None if board.stop_button is None else _pin_number(board.stop_button),
        uart=robot.link.uart,
        baud=robot.link.baud,
    )


def _wheel_settings(side: SideSection) -> WheelSettings:
    motor, gains = side.motor, speed_gains(side.motor)
    return WheelSettings(
        enable=_pin_number(motor.enable),
        in1=_pin_number(motor.in1),
        in2=_pin_number(motor.in2),
        encoder=_pin_number(side.encoder.pin),
        reversed=motor.reversed,
        start=gains.static,
        gain=gains.slope,
    )


def _pin_number(pin: object) -> int:
    """The board's number of a pin that is written `5` or `A0`."""
    text = str(pin)
    return FIRST_ANALOG + int(text[1:]) if text.startswith("A") else int(text)


def _analog_channel(pin: object) -> int:
    return _pin_number(pin) - FIRST_ANALOG
