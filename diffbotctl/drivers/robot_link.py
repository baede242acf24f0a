"""The host side of the serial link that a robot file describes: its protocol and its settings."""

from __future__ import annotations

from dataclasses import replace
from math import pi

from diffbotctl.config.board_pins import BOARDS, BoardPins
from diffbotctl.config.imu_chips import IMU_CHIPS
from diffbotctl.config.motor_pulses import driver_code
from diffbotctl.config.robot import (
    ImuSection,
    Robot,
    SensorSection,
    SideSection,
    board_sensors,
    line_baud,
    measured_lag,
)
from diffbotctl.control.speed_loop import speed_gains
from diffbotctl.drivers.board_ports import is_usb
from diffbotctl.errors import ConfigurationError, Problem, join_words
from diffbotctl.geometry.distance_sensors import ECHOES, further_sensors, is_analog
from diffbotctl.links import diffbot_frames as frames
from diffbotctl.links.diffbot_host import DiffbotHost
from diffbotctl.links.diffbot_settings import BoardSettings, GyroInput, RangeInput, WheelSettings
from diffbotctl.links.rosserial_host import RosserialHost
from diffbotctl.time import SECOND

TICK_BYTES, BITS_PER_BYTE = 16, 10  # what is sent of a pair of ticks after the counts were taken


def diffbot_host(robot: Robot, device: str, is_upward_checked: bool = True) -> DiffbotHost:
    """The protocol for a board with our firmware; a USB port always means UART0 at 115200 baud."""
    settings = board_settings(robot, is_upward_checked)
    return DiffbotHost(replace(settings, uart=0) if is_usb(device) else settings)


def rosserial_host(robot: Robot) -> RosserialHost:
    """The protocol for a board with the book's firmware."""
    left, link = robot.drive.left, robot.link
    return RosserialHost(
        left.motor.rated * left.encoder.slots / (2 * pi),
        baud=link.baud,
        sensor=next(
            (name for name, sensor in board_sensors(robot).items() if is_analog(sensor.type)),
            "front",
        ),
        command_delay=round(link.command_delay * SECOND),
        wire_time=TICK_BYTES * BITS_PER_BYTE * SECOND // link.baud,
    )


def board_settings(robot: Robot, is_upward_checked: bool = True) -> BoardSettings:
    """The settings that our firmware needs of this robot.

    `is_upward_checked`: the board compares the stated axis of the IMU with gravity. Calibration
    reads axes across, too.
    Raises ConfigurationError for a board that it does not run on.
    """
    pins = BOARDS.get(robot.board.type)
    if pins is None:
        cause = "this robot exists only in the simulator: it has no board"
        fix = f"set board: {{type: {join_words(BOARDS)}}}, or simulate: --port sim"
        raise ConfigurationError(Problem("E-BOARD-KIND", "board.type", cause, fix))
    left, right, board, battery = robot.drive.left, robot.drive.right, robot.board, robot.battery
    sensors = board_sensors(robot)
    kinds = {name: sensor.type for name, sensor in sensors.items()}
    further = further_sensors(kinds)
    name = next((name for name in kinds if is_analog(kinds[name]) and name not in further), "range")
    sensor = sensors.get(name)
    return BoardSettings(
        _wheel_settings(pins, left),
        _wheel_settings(pins, right),
        board=frames.BoardCode[pins.chip],
        edge=left.encoder.edge,
        every_edge=left.encoder.counts > left.encoder.slots,
        glitch=round(left.encoder.glitch * SECOND),
        deadman=round(board.deadman * SECOND),
        telemetry=round(board.telemetry),
        lag=measured_lag(robot),
        edge_times=board.edge_times,
        driver=driver_code(robot),
        standby=_number(pins, left.motor.standby),
        brake=left.motor.idle == "brake",
        range_channel=None if sensor is None else _analog_channel(pins, sensor.pin),
        range_name=name,
        further_ranges=tuple(_range_input(pins, name, sensors[name]) for name in further),
        gyro=_gyro_input(robot.imu, is_upward_checked),
        battery_channel=None if battery.pin is None else _analog_channel(pins, battery.pin),
        battery_divider=battery.divider or 1.0,
        battery_low=battery.low,
        button=_number(pins, board.stop_button),
        uart=robot.link.uart,
        baud=line_baud(robot) if pins.shares_usb else robot.link.baud,
        shares_usb=pins.shares_usb,
    )


def _wheel_settings(pins: BoardPins, side: SideSection) -> WheelSettings:
    motor, gains = side.motor, speed_gains(side.motor)
    return WheelSettings(
        enable=_number(pins, motor.enable),
        in1=pins.number(motor.in1),
        in2=_number(pins, motor.in2),
        encoder=_number(pins, side.encoder.pin) if side.encoder.channels else None,
        encoder_b=_number(pins, side.encoder.pin_b),
        encoder_reversed=side.encoder.reversed,
        reversed=motor.reversed,
        start=gains.static,
        gain=gains.slope,
        proportional=gains.proportional,
        integral=gains.integral,
        slots=side.encoder.counts,
    )


def _range_input(pins: BoardPins, name: str, sensor: SensorSection) -> RangeInput:
    if sensor.type in ECHOES:
        return RangeInput(name, pins.number(sensor.echo), pins.number(sensor.trigger))
    return RangeInput(name, _analog_channel(pins, sensor.pin))


def _gyro_input(imu: ImuSection, is_upward_checked: bool) -> GyroInput | None:
    if imu.type is None:
        return None
    chip = IMU_CHIPS[imu.type]
    return GyroInput(
        chip.address(imu.address),
        "xyz".index(imu.axes[-1]),
        is_reversed=imu.axes.startswith("-"),
        is_lsm6=chip.is_lsm6,
        is_upward_checked=is_upward_checked,
    )


def _number(pins: BoardPins, pin: object) -> int | None:
    return None if pin is None else pins.number(pin)


def _analog_channel(pins: BoardPins, pin: object) -> int:
    return pins.number(pin) - pins.first_analog
