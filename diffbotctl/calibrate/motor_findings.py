"""From what was measured of two motors to the fields of the robot file, and to words."""

from __future__ import annotations

from math import floor, hypot
from typing import NamedTuple

from diffbotctl.calibrate.motor_experiments import RESOLUTION
from diffbotctl.calibrate.motor_fit import DEAD_STEP, LagFit, SpeedDutyLine
from diffbotctl.calibrate.result import Finding
from diffbotctl.config.drive_sides import SIDES
from diffbotctl.config.robot import Robot
from diffbotctl.drivers.robot_link import is_duty_board

INTEGRAL = 0.25  # 1/s; integral gain over kV: what is missing is made good within some seconds
PROPORTIONAL = 0.0  # of kV: the speed of one slot alone is 4 % wrong, and would be passed on
MARGIN = 0.95  # of full power's speed: the loops need the rest, and so does a weaker battery
CENTIMETRES = 100  # in a metre; limits are rounded down to whole ones
DIFFERENT = 0.15  # between the directions of one motor: more is a fault of its gear or driver


class MotorFit(NamedTuple):
    """What was measured of one motor."""

    start: dict[str, float]
    """duty that breaks it loose, by direction"""
    lines: dict[str, SpeedDutyLine]
    """by direction"""
    line: SpeedDutyLine
    """of both directions together"""
    lag: LagFit


def motor_findings(robot: Robot, motors: dict[str, MotorFit]) -> list[Finding]:
    """Motors and loops of both sides, and a speed limit that both can keep."""
    slope = sum(motor.line.slope for motor in motors.values()) / len(motors)
    made = []
    for side, motor in motors.items():
        line, path = motor.line, f"drive.{side}.motor"
        static = min(max(line.static, 0.0), 0.75)
        start = max(sum(motor.start.values()) / len(motor.start), static)
        made += [
            Finding(f"{path}.rated", line.rated, line.rated * line.slope_sd / line.slope),
            Finding(f"{path}.start_duty", start, RESOLUTION),
            Finding(f"{path}.keep_duty", static, line.static_sd),
            Finding(f"{path}.lag", motor.lag.lag, hypot(motor.lag.sd, motor.lag.parted)),
            Finding(f"{path}.loop.static", static, line.static_sd),
            Finding(f"{path}.loop.speed", line.slope, line.slope_sd),
            Finding(f"{path}.loop.proportional", PROPORTIONAL * slope),
            Finding(f"{path}.loop.integral", INTEGRAL * slope),
        ]
    return [*made, *_limit(robot, motors)]


def _limit(robot: Robot, motors: dict[str, MotorFit]) -> list[Finding]:
    """A speed limit that both motors can keep, where the stated one is too much for them."""
    drive = {"left": robot.drive.left, "right": robot.drive.right}
    reach = min(motors[side].line.rated * drive[side].wheel.diameter / 2 for side in SIDES)
    kept = floor(MARGIN * reach * CENTIMETRES) / CENTIMETRES
    return [Finding("limits.speed", kept)] if kept < robot.limits.speed else []


def delay(nominal: Robot, motors: dict[str, MotorFit]) -> list[Finding]:
    """The time from a command to the motors, where it is another than the file states.

    A board that tells when a command took hold leaves only the motors' own dead time to be added
    to what is stated of the link.
    """
    lags = [motor.lag for motor in motors.values()]
    dead = sum(lag.dead for lag in lags) / len(lags)
    parted = max(lag.parted for lag in lags)
    if is_duty_board(nominal):
        return [Finding("link.command_delay", dead, hypot(lags[0].sd, parted))]
    if not dead:
        return []
    return [Finding("link.command_delay", nominal.link.command_delay + dead, DEAD_STEP)]


def unlike(motors: dict[str, MotorFit]) -> list[str]:
    """Motors that run one way much better than the other."""
    faults = []
    for side, motor in motors.items():
        forward, backward = motor.lines["forward"].rated, motor.lines["backward"].rated
        if abs(forward - backward) > DIFFERENT * (forward + backward) / 2:
            faults.append(
                f"the {side} motor turns at {forward:.1f} rad/s forward and {backward:.1f} rad/s "
                "backward with full power: a gear that rubs, or a driver output that is failing"
            )
    return faults


def report(robot: Robot, motors: dict[str, MotorFit]) -> list[str]:
    """The table of both motors, and the slowest speed that can be had of them."""
    lines = [f"{'':<15} {'starts':>7} {'keeps':>7} {'full power':>12} {'lag':>8} {'dead time':>10}"]
    for side, motor in motors.items():
        for way, line in motor.lines.items():
            lines.append(
                f"{side + ' ' + way:<15} {motor.start[way]:>7.3f} {line.static:>7.3f} "
                f"{line.rated:>6.2f} rad/s {motor.lag.lag * 1000:>5.0f} ms "
                f"{motor.lag.dead * 1000:>7.0f} ms"
            )
    slowest = max(
        max(max(motor.start.values()) - motor.line.static, 0.0) / motor.line.slope
        for motor in motors.values()
    )
    radius = max(robot.drive.left.wheel.diameter, robot.drive.right.wheel.diameter) / 2
    slowest *= radius * CENTIMETRES
    lines.append(f"slowest speed at which both wheels start by themselves: {slowest:.1f} cm/s")
    return lines
