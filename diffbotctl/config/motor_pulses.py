"""Where a robot's motor drivers get their pulses: on the enable input, or on both other inputs.

With the pulses on in1 and in2, and enable high, a driver shorts the motor between them: the speed
is linear in the duty, and a motor that turns faster is braked. With the pulses on enable many leave
it open, and nothing brakes it but friction.
"""

from __future__ import annotations

import re
from typing import NamedTuple

from diffbotctl.config.board_pins import BOARDS, BoardPins
from diffbotctl.config.motor_drivers import MOTOR_DRIVERS, MotorDriverFacts, driver_facts
from diffbotctl.config.robot import SIDES, PulsedPins, Robot
from diffbotctl.errors import join_words
from diffbotctl.links.diffbot_frames import DriverCode

# What a calibration finds that another kind of pulses changes.
DEPENDS_ON_PULSES = re.compile(r"drive\.(left|right)\.motor\.(lag|decay|friction|loop\.\w+)")


class MotorPulses(NamedTuple):
    """Where the pulses are, and why."""

    on: PulsedPins
    why: str
    is_possible: bool = True  # false where the robot file states other ones


def motor_pulses(robot: Robot) -> MotorPulses:
    """Where a checked robot's drivers get their pulses."""
    motor = robot.drive.left.motor
    facts = driver_facts(motor.driver)
    if facts.mode == "two_pwm":
        why = f"{facts.with_article} has no enable"
        return MotorPulses("inputs", why, motor.pulses != "enable")
    obstacle = _obstacle(robot, facts)
    if obstacle:
        return MotorPulses("enable", obstacle, motor.pulses != "inputs")
    if _is_calibrated_for_enable(robot):
        why = (
            "the motors were calibrated so; set pulses: inputs and run `diffbotctl calibrate "
            "motors` for better ones"
        )
        return MotorPulses("enable", why)
    if motor.pulses == "enable":
        return MotorPulses("enable", "the robot file states it")
    return MotorPulses("inputs", "between them the driver brakes, which holds slow speeds")


def pulses_text(robot: Robot) -> str:
    """Where a checked robot's pulses are, and why, in one line."""
    pulses = motor_pulses(robot)
    where = "in1 and in2" if pulses.on == "inputs" else "enable"
    return f"the pulses for the motors are on {where}: {pulses.why}"


def driver_code(robot: Robot) -> DriverCode:
    """How our firmware drives the inputs of a checked robot's drivers."""
    facts = driver_facts(robot.drive.left.motor.driver)
    match facts.mode:
        case "enable_direction":
            return DriverCode.ENABLE_DIRECTION
        case "two_pwm":
            is_other = facts.states["both_low"] == "shorted" or _is_calibrated_for_enable(robot)
            return DriverCode.TWO_PWM if is_other else DriverCode.PULSED_INPUTS
        case "enable_in1_in2":
            on_inputs = motor_pulses(robot).on == "inputs"
            return DriverCode.PULSED_INPUTS if on_inputs else DriverCode.ENABLE_IN1_IN2


def calibrated_pulses(robot: Robot) -> PulsedPins:
    """What a calibration of the motors stores: whether it holds for pulses that our firmware puts
    on the inputs to short the motors between them."""
    return "inputs" if driver_code(robot) is DriverCode.PULSED_INPUTS else "enable"


def pulse_fields(robot: Robot) -> dict[str, PulsedPins]:
    """The calibrated fields that hold for one kind of pulses, and which.

    Before they were stored there was only one kind.
    """
    entries = (robot.calibration or {}).items()
    return {
        field: entry.pulses or "enable"
        for field, entry in entries
        if entry is not None and DEPENDS_ON_PULSES.fullmatch(field)
    }


def fields_of_other_pulses(robot: Robot) -> list[str]:
    """The calibrated fields that do not hold for the pulses of this robot."""
    try:
        pulses = calibrated_pulses(robot)
    except AttributeError:
        return []  # what decides could not be read
    return [field for field, found in pulse_fields(robot).items() if found != pulses]


def _is_calibrated_for_enable(robot: Robot) -> bool:
    """True when the file does not state the pulses, and the motors were calibrated with others."""
    return robot.drive.left.motor.pulses is None and "enable" in pulse_fields(robot).values()


def _obstacle(robot: Robot, facts: MotorDriverFacts) -> str:
    """Why the pulses are on enable; empty when they can be on the inputs."""
    board = BOARDS.get(robot.board.type)
    if board is None or robot.drive.left.motor.driver not in MOTOR_DRIVERS:
        return "the robot exists only in the simulator"
    if robot.link.protocol != "diffbot":
        return "the book's firmware has them there"
    return pulses_obstacle(facts) or _missing_pwm(robot, board)


def pulses_obstacle(facts: MotorDriverFacts) -> str:
    """Why a driver has its pulses on enable on any board; empty when they can be on the inputs."""
    if facts.mode == "two_pwm":
        return ""
    if facts.states["enable_low"] == "shorted":
        return f"{facts.with_article} brakes the motors between pulses on enable"
    if facts.mode == "enable_direction":
        return f"in1 of {facts.with_article} is a direction"
    if not facts.follows_input_pulses:
        return f"the inputs of {facts.with_article} are too slow for them"
    return ""


def _missing_pwm(robot: Robot, board: BoardPins) -> str:
    """Which pins of in1 and in2 have no PWM of their own; empty when all have it."""
    motors = [getattr(robot.drive, side).motor for side in SIDES]
    inputs = [pin for motor in motors for pin in (motor.in1, motor.in2) if pin is not None]
    pins = [board.named(str(pin)) for pin in inputs]
    clock = board.clock_timer[robot.link.protocol]
    missing = [pin for pin in pins if board.pwm.get(pin, clock) == clock]
    if missing:
        words, verb = ("pins", "have") if len(missing) > 1 else ("pin", "has")
        named = join_words(missing, "and")
        return f"{words} {named} of {board.with_article} {verb} no PWM"
    if board.shares_pwm and len({board.pwm[pin] for pin in pins}) < len(pins):
        named = join_words(pins, "and")
        return f"two of the pins {named} of {board.with_article} have one PWM output"
    return ""


def fill_shorted(robot: Robot) -> None:
    """Set whether the pulses of our firmware short each motor between them, where the robot file
    can be read so far."""
    try:
        is_shorted = driver_code(robot) is DriverCode.PULSED_INPUTS
    except (AttributeError, KeyError, TypeError):
        return
    for side in SIDES if is_shorted else ():
        getattr(robot.drive, side).motor.is_shorted = True
