"""Robot files composed of parts, on pins that the boards have for them."""

from itertools import product
from random import Random
from string import Template

import pytest

from diffbotctl.config.composed_robot import PART_KINDS, RobotParts, compose_robot
from diffbotctl.config.load import load_robot
from diffbotctl.config.lookup import folder
from diffbotctl.config.motor_drivers import MOTOR_DRIVERS
from diffbotctl.config.motor_pulses import motor_pulses
from diffbotctl.errors import UsageError
from tests.sampling import by_day

# What such parts are warned of in any file: an HC-05 on the USB port's pins; no encoders.
WARNINGS = {"W-WIRING-SHARED", "W-ENCODER-NONE"}
SENSORS = [(), ("hc_sr04",), ("sharp_gp2y0a41sk0f",), ("sharp_gp2y0a02yk0f", "hc_sr04")]


def combinations():
    """All combinations of the parts, with up to two distance sensors."""
    names = {kind: PART_KINDS[kind].names for kind in ("board", "driver", "encoders")}
    rest = (SENSORS, PART_KINDS["imu"].names, PART_KINDS["radio"].names)
    for board, driver, encoders, sensors, imu, radio in product(*names.values(), *rest):
        yield RobotParts(board, driver, encoders, None, sensors, imu, radio)


def sample(seed, number):
    """Some of them, each driver with each board among them."""
    every = list(combinations())
    Random(seed).shuffle(every)
    first = {(parts.board, parts.driver): parts for parts in every}
    return [*first.values(), *every[:number]]


def written(parts, path):
    """The file of these parts."""
    source = folder("templates") / "composed_robot.yaml.tmpl"
    fields = compose_robot(parts) | {"name": "mine", "file": str(path)}
    path.write_text(Template(source.read_text()).substitute(fields))
    return path


@pytest.mark.parametrize("seed", by_day(1, range(20)))
def test_check_accepts_the_file_of_any_combination(seed, tmp_path):
    for parts in sample(seed, 5):
        loaded = load_robot(str(written(parts, tmp_path / "mine.yaml")))
        assert {problem.code for problem in loaded.warnings} <= WARNINGS, parts
        robot = loaded.robot
        names = (robot.board.type, robot.drive.left.motor.driver, robot.imu.type or "none")
        assert names == (parts.board, parts.driver, parts.imu)
        assert tuple(sensor.type for sensor in robot.sensors.values()) == parts.sensors
        assert robot.link.has_radio == (parts.radio == "hc05")
        assert robot.drive.polarity == "unproven"  # 0.1 m/s until `calibrate encoders`
        facts = MOTOR_DRIVERS[parts.driver]
        can = facts.mode == "two_pwm" or facts.follows_input_pulses
        assert motor_pulses(robot).on == ("inputs" if can else "enable"), parts


def test_every_combination_with_two_distance_sensors_fits():
    """At most 14 wires on the 16 pins that an Uno has beside its port and the IMU's bus."""
    kinds = {
        (facts.mode, facts.standby, facts.follows_input_pulses): name
        for name, facts in MOTOR_DRIVERS.items()
    }
    for parts in combinations():
        if parts.driver in kinds.values() and parts.imu in ("none", "mpu6050"):
            compose_robot(parts)


@pytest.mark.parametrize(
    ("parts", "pins"),
    [
        # 5, 6, 9 and 10 have PWM; 11 and 3 are on the clock's timer, 2 and 3 have the interrupts.
        (
            RobotParts("uno", "l298n"),
            {"left": ("4", "5", "6", "2"), "right": ("7", "9", "10", "3")},
        ),
        (
            RobotParts("uno", "tb6612"),
            {"left": ("5", "4", "7", "2"), "right": ("6", "8", "12", "3")},
        ),
        # 11 and 12 are on the clock's timer; 22 and up have no other function.
        (
            RobotParts("mega2560", "tb6612", "two-channel"),
            {"left": ("4", "24", "25", "2"), "right": ("5", "26", "27", "3")},
        ),
        # GP16 and up have the PWM outputs of GP0 and up.
        (
            RobotParts("pico", "tc1508s", imu="mpu6050"),
            {"left": (None, "6", "7", "2"), "right": (None, "8", "9", "3")},
        ),
    ],
)
def test_pins_worked_out_by_hand(parts, pins, tmp_path):
    drive = load_robot(str(written(parts, tmp_path / "mine.yaml"))).robot.drive
    for side, expected in pins.items():
        motor, encoder = getattr(drive, side).motor, getattr(drive, side).encoder
        found = (motor.enable, motor.in1, motor.in2, encoder.pin)
        assert tuple(None if pin is None else str(pin) for pin in found) == expected


@pytest.mark.parametrize(
    ("parts", "cause", "fix"),
    [
        # 7 wires of the driver, 4 of the encoders, 6 of the sensors: one more than 16 pins.
        (
            RobotParts("uno", "tb6612", "two-channel", None, ("hc_sr04",) * 3, "mpu6050"),
            "an Uno has no pin left for the driver's STBY",
            "use a board with more pins: mega2560",
        ),
        # GP26 to GP28 measure.
        (
            RobotParts("pico", "tb6612", sensors=("sharp_gp2y0a41sk0f",) * 4),
            "a Pico has no pin left for the sensor at the rear",
            "mega2560",
        ),
        (
            RobotParts("uno", "tb6612", sensors=("hc_sr04",) * 5),
            "4 distance sensors",
            "leave out 1",
        ),
        (RobotParts("esp32", "tb6612"), "our firmware does not run on an ESP32", "Mega 2560"),
        (RobotParts("Arduino Uno", "tb6612"), "'Arduino Uno' is not known", "did you mean uno?"),
        (RobotParts("uno", "a4988"), "it drives stepper motors", "use a driver for DC motors"),
        (RobotParts("uno", "hg7881"), "cannot be 'hg7881'", "did you mean l9110?"),
        (RobotParts("uno", "tb6612", imu="gy521"), "that of an MPU6050", "write mpu6050"),
        (RobotParts("uno", "tb6612", sensors=("vl53l0x",)), "read over I2C", "HC-SR04"),
        (RobotParts("uno", "tb6612", "two-chanel"), "'two-chanel' is not", "mean two-channel?"),
    ],
)
def test_parts_that_do_not_fit_are_refused_with_the_reason(parts, cause, fix):
    with pytest.raises(UsageError) as raised:
        compose_robot(parts)
    (problem,) = raised.value.problems
    assert problem.code == "E-PARTS"
    assert cause in problem.cause and fix in problem.fix, problem
