"""Where the pulses for the motors are: by driver, pins, firmware and calibration."""

import pytest

from diffbotctl.config.load import check, load_robot
from diffbotctl.config.motor_pulses import driver_code, pulses_text
from diffbotctl.links.diffbot_frames import DriverCode

LAG = "{value: 0.12 s, sd: 0.01 s%s}"
INPUTS, ENABLE = DriverCode.PULSED_INPUTS, DriverCode.ENABLE_IN1_IN2


def file(folder, *lines):
    path = folder / "mine.yaml"
    path.write_text("\n".join(("format: 1\nkind: robot\ninclude: book_2wd", *lines)) + "\n")
    return str(path)


UNO = ("board: {type: uno}", "link: {uart: 0}")
ENABLE_PINS = "{left: {motor: {enable: 5, in1: 7, in2: 8}}, right: {motor: {enable: 6}}}"
INPUT_PINS = "{left: {motor: {enable: 7, in1: 5, in2: 6}}, right: {motor: {enable: 8}}}"
JUMPERS = "{motor: {idle: brake}, left: {motor: {enable: none}}, right: {motor: {enable: none}}}"
TB6612 = "{motor: {driver: tb6612}}"
VNH = "{motor: {driver: vnh2sp30}}"


@pytest.mark.parametrize(
    ("lines", "code", "why"),
    [
        ((), INPUTS, "on in1 and in2"),
        (("drive: {motor: {pulses: enable}}",), ENABLE, "the robot file states it"),
        (("board: {telemetry: 16 Hz}", "link: {protocol: rosserial}"), ENABLE, "book's firmware"),
        ((*UNO, f"drive: {ENABLE_PINS}"), ENABLE, "pins 7 and 8 of an Uno have no PWM"),
        ((*UNO, f"drive: {INPUT_PINS}"), INPUTS, "on in1 and in2"),
        ((f"drive: {JUMPERS}",), INPUTS, "on in1 and in2"),
        ((f"drive: {TB6612}",), ENABLE, "a TB6612 brakes the motors"),
        ((f"drive: {VNH}",), ENABLE, "too slow"),
        ((f"calibration: {{drive.left.motor.lag: {LAG % ''}}}",), ENABLE, "calibrated so"),
        (
            (f"calibration: {{drive.left.motor.lag: {LAG % ', pulses: inputs'}}}",),
            INPUTS,
            "on in1 and in2",
        ),
    ],
)
def test_where_the_pulses_are(tmp_path, lines, code, why):
    robot = load_robot(file(tmp_path, *lines)).robot
    assert driver_code(robot) is code
    assert why in pulses_text(robot)


@pytest.mark.parametrize(
    ("stored", "stated", "is_used"),
    [
        ("inputs", "inputs", True),
        ("inputs", "enable", False),
        ("enable", "enable", True),
        ("enable", "inputs", False),
        (None, "inputs", False),  # from before there was a choice
        (None, "none", True),
    ],
)
def test_a_calibration_is_used_with_its_own_pulses_alone(tmp_path, stored, stated, is_used):
    entry = LAG % (f", pulses: {stored}" if stored else "")
    name = file(
        tmp_path,
        f"drive: {{motor: {{pulses: {stated}}}}}",
        f"calibration: {{drive.left.motor.lag: {entry}, drive.track: {{value: 0.13 m}}}}",
    )
    codes = [problem.code for problem in check(name, None, (), real=False)]
    assert ("W-CALIBRATION-PULSES" in codes) is not is_used
    robot = load_robot(name).robot
    assert (robot.drive.left.motor.lag == 0.12) is is_used
    assert ("drive.left.motor.lag" in robot.calibration) is is_used
    assert robot.drive.track == 0.13
