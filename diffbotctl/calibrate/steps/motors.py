"""From what was measured of two motors to the fields of the robot file, and to words.

`calibrate motors`: dead band, speed against duty, lag; from these the wheels' speed loops.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import floor, hypot, pi
from typing import NamedTuple

from diffbotctl.calibrate import motor_experiments, motor_fit
from diffbotctl.calibrate.motor_experiments import (
    DUTY_LEVELS,
    MEASURING_TIME_S,
    SETTLING_TIME_S,
    SpeedsByDuty,
)
from diffbotctl.calibrate.motor_fit import DEAD_TIME_STEP_S, LagFit, SpeedDutyLine
from diffbotctl.calibrate.motor_lag_fit import fit_common_lag
from diffbotctl.calibrate.result import Finding
from diffbotctl.calibrate.session import RobotSession
from diffbotctl.calibrate.step import MotionNotice, Outcome, Running
from diffbotctl.config.robot import SIDES, Robot
from diffbotctl.drivers.robot_link import is_duty_board
from diffbotctl.errors import Problem, RunError
from diffbotctl.messages import Battery

INTEGRAL_GAIN_PER_S = (
    0.25  # 1/s; integral gain over kV: what is missing is made good within some seconds
)
PROPORTIONAL_GAIN_RATIO = (
    0.0  # of kV: the speed of one slot alone is 4 % wrong, and would be passed on
)
SPEED_LIMIT_RATIO = (
    0.95  # of full power's speed: the loops need the rest, and so does a weaker battery
)
CM = 100  # in a metre; limits are rounded down to whole ones
DIRECTION_DIFFERENCE_MAX = (
    0.15  # between the directions of one motor: more is a fault of its gear or driver
)


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
        made += [
            Finding(f"{path}.rated", line.rated, line.rated * line.slope_sd / line.slope),
            Finding(f"{path}.lag", motor.lag.lag, hypot(motor.lag.sd, motor.lag.parted)),
            Finding(f"{path}.loop.static", static, line.static_sd),
            Finding(f"{path}.loop.speed", line.slope, line.slope_sd),
            Finding(f"{path}.loop.proportional", PROPORTIONAL_GAIN_RATIO * slope),
            Finding(f"{path}.loop.integral", INTEGRAL_GAIN_PER_S * slope),
        ]
    return [*made, *_speed_limit(robot, motors)]


def _speed_limit(robot: Robot, motors: dict[str, MotorFit]) -> list[Finding]:
    """A speed limit that both motors can keep, where the stated one is too much for them."""
    drive = {"left": robot.drive.left, "right": robot.drive.right}
    reach = min(motors[side].line.rated * drive[side].wheel.diameter / 2 for side in SIDES)
    kept = floor(SPEED_LIMIT_RATIO * reach * CM) / CM
    return [Finding("limits.speed", kept)] if kept < robot.limits.speed else []


def delay_findings(nominal: Robot, motors: dict[str, MotorFit]) -> list[Finding]:
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
    return [Finding("link.command_delay", nominal.link.command_delay + dead, DEAD_TIME_STEP_S)]


def direction_faults(motors: dict[str, MotorFit]) -> list[str]:
    """Motors that run one way much better than the other."""
    faults = []
    for side, motor in motors.items():
        forward, backward = motor.lines["forward"].rated, motor.lines["backward"].rated
        if abs(forward - backward) > DIRECTION_DIFFERENCE_MAX * (forward + backward) / 2:
            faults.append(
                f"the {side} motor turns at {forward:.1f} rad/s forward and {backward:.1f} rad/s "
                "backward with full power: a gear that rubs, or a driver output that is failing"
            )
    return faults


def motor_report(robot: Robot, motors: dict[str, MotorFit]) -> list[str]:
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
    slowest *= radius * CM
    lines.append(f"slowest speed at which both wheels start by themselves: {slowest:.1f} cm/s")
    return lines


COMMAND_JITTER_MIN_S = 0.005  # s, sd of when a board that does not tell takes a command
RATED_SPEED_RATIO_MAX = 1.6  # times the rated speed: what the robot file may understate it by


@dataclass(frozen=True, slots=True)
class MotorStep:
    """The step."""

    name: str = "motors"
    title: str = "dead band, speed, lag; sets the speed loops"
    lifted: bool = True

    def run(self, rig: RobotSession) -> Running:
        """Dead bands, then speeds, then steps, then the loops are tried."""
        rig.meet()
        yield _motion_notice(rig)
        starts = yield from motor_experiments.measure_breakaway(rig)
        levels = yield from motor_experiments.measure_speeds(rig)
        steps = yield from motor_experiments.record_steps(rig)
        robot = rig.file.robot
        lags = _fit_lags(robot, steps)
        motors = {side: _fit_motor(side, starts, levels, lags[side]) for side in SIDES}
        findings = motor_findings(robot, motors)
        findings += delay_findings(rig.file.nominal, motors)
        rig.attempt(findings)
        faults = [*direction_faults(motors), *(yield from motor_experiments.check_creep(rig))]
        report = motor_report(robot, motors)
        return Outcome("motors", findings, report, faults, volts=_battery_volts(rig))


def _motion_notice(rig: RobotSession) -> MotionNotice:
    drive = rig.file.robot.drive
    rated = max(drive.left.motor.rated, drive.right.motor.rated)
    # The longest way in one direction: all levels, or all steps.
    levels = sum(DUTY_LEVELS) * (SETTLING_TIME_S + MEASURING_TIME_S)
    way = max(levels, motor_experiments.duty_staircase(rig.file.robot).way)
    most = RATED_SPEED_RATIO_MAX * rated * way / (2 * pi)
    return MotionNotice(
        "The wheels must be off the ground. Both motors are driven together, forward and backward, "
        f"slowly at first, then up to 0.9 of full power: about {_duration_text(rig.file.robot)}, "
        f"at most {most:.0f} turns one way.",
        most,
    )


def _duration_text(robot: Robot) -> str:
    return "two and a half minutes" if is_duty_board(robot) else "a minute and a half"


def _fit_lags(robot: Robot, steps: list[motor_fit.StepResponse]) -> dict[str, LagFit]:
    """Raises RunError when the wheels do not do what is to be measured."""
    slots = motor_experiments.slots_by_side(robot)
    side = "left or the right"
    try:
        if is_duty_board(robot):
            jitter = max(robot.link.command_jitter, COMMAND_JITTER_MIN_S)
            return dict.fromkeys(SIDES, fit_common_lag(steps, slots["left"], jitter))
        found = {}
        for side in SIDES:
            found[side] = motor_fit.fit_lag(steps, side == "left", slots[side])
        return found
    except ValueError as error:
        raise _unusable_wheel(side, error) from error


def _unusable_wheel(side: str, error: ValueError) -> RunError:
    fix = "run `diffbotctl calibrate encoders`, which finds dead motors and encoders"
    return RunError(Problem("E-CALIBRATE-ROBOT", "motors", f"the {side} wheel: {error}", fix))


def _fit_motor(side: str, starts: dict[str, float], levels: SpeedsByDuty, lag: LagFit) -> MotorFit:
    """Raises RunError when the wheel does not do what is to be measured."""
    ways = {way: levels[f"{side} {way}"] for way in ("forward", "backward")}
    try:
        lines = {
            way: motor_fit.fit_line(*zip(*points, strict=True)) for way, points in ways.items()
        }
        both = motor_fit.fit_line(*zip(*ways["forward"], *ways["backward"], strict=True))
    except ValueError as error:
        raise _unusable_wheel(side, error) from error
    return MotorFit({way: starts[f"{side} {way}"] for way in ways}, lines, both, lag)


def _battery_volts(rig: RobotSession) -> float | None:
    """The battery's voltage, where the robot measures it."""
    heard = rig.listen(1.0).of(Battery)
    return heard[-1].volts if heard else None
