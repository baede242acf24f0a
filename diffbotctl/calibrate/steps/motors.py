"""`calibrate motors`: dead band, speed against duty and lag of both motors, for the speed loops."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from math import floor, hypot, pi
from typing import NamedTuple

from diffbotctl.calibrate.motor_curve import FittedMotor, fit_curves
from diffbotctl.calibrate.motor_experiments import (
    CM,
    DIRECTIONS,
    DUTY_LEVELS,
    DUTY_SD,
    MEASURING_TIME_S,
    SETTLING_TIME_S,
    Motion,
    SpeedsByMotion,
    check_creep,
    duty_staircase,
    measure_breakaway,
    measure_speeds,
    record_steps,
)
from diffbotctl.calibrate.motor_fit import Points, StepResponse, fit_line, slope_above
from diffbotctl.calibrate.motor_lag import SAME_LAG, LagFit, fit_lags
from diffbotctl.calibrate.result import Finding
from diffbotctl.calibrate.session import RATED_SPEED_RATIO_MAX, RobotSession, drive_sides
from diffbotctl.calibrate.step import Outcome, StepRun
from diffbotctl.config.robot import SIDES, Robot
from diffbotctl.control.speed_loop import default_gains
from diffbotctl.drivers.robot_ports import is_duty_board
from diffbotctl.errors import Problem, RunError
from diffbotctl.prompts.question import ExpectedQuestion, MotionNotice, motion_consent

SPEED_LIMIT_RATIO = 0.95  # of the rated speed; the rest is for the loops and a weaker battery
STATIC_DUTY_MAX = 0.75
DIRECTION_DIFFERENCE_MAX = 0.15  # of the rated speed; more is a fault of gear or driver
COMMAND_JITTER_MIN_S = 0.005  # standard deviation, for a board that does not report the time
BATTERY_LISTEN_TIME_S = 1.0
DEAD_TIME_SD_MIN_S = 0.002


class MotorFit(NamedTuple):
    """The parameters of one motor."""

    breakaway: dict[str, float]  # duty at which it starts, by direction
    points: Points
    lines: dict[str, FittedMotor]  # by direction, under the load of both motors
    lag: LagFit
    curve: FittedMotor  # for both directions, at the battery's voltage at rest

    @property
    def full_speed(self) -> float:
        """Speed at full duty under the load of both motors, rad/s."""
        return self.curve.loaded or fit_line(self.points).rated


@dataclass(frozen=True, slots=True)
class MotorStep:
    """The step."""

    name: str = "motors"
    title: str = "dead band, speed and lag of the motors; sets the speed loops"
    lifted: bool = True

    def questions(self, robot: Robot) -> Sequence[ExpectedQuestion]:
        """Consent alone."""
        return [ExpectedQuestion(motion_consent(self.name))]

    def run(self, session: RobotSession) -> StepRun:
        """Measure breakaway duties, speeds and step responses, then try the fitted loops."""
        session.connect()
        robot = session.file.robot
        yield _motion_notice(robot)
        breakaway = yield from measure_breakaway(session)
        speeds = yield from measure_speeds(session)
        steps = yield from record_steps(session)
        points = {side: [*speeds[side, "forward"], *speeds[side, "backward"]] for side in SIDES}
        curves = {
            side: curve.with_duty_sd(DUTY_SD)
            for side, curve in fit_curves(points, robot.drive.left.motor.is_shorted).items()
        }
        lags = _fit_lags(robot, steps, curves)
        motors = {
            side: _fit_motor(side, breakaway, speeds, lags[side], curves.get(side))
            for side in SIDES
        }
        findings = [*motor_findings(robot, motors), *_delay_findings(session.file.nominal, motors)]
        session.try_findings(findings)
        report = [*_report(robot, motors), *(yield from check_creep(session))]
        volts = session.listen(BATTERY_LISTEN_TIME_S).battery_volts
        return Outcome("motors", findings, report, _direction_faults(motors), volts=volts)


def _motion_notice(robot: Robot) -> MotionNotice:
    rated = max(robot.drive.left.motor.rated, robot.drive.right.motor.rated)
    # The longest motion in one direction: all levels, or all steps. With fast decay the speed is
    # nearly that at full duty from a duty of a third on.
    levels = len(DUTY_LEVELS) * (SETTLING_TIME_S + MEASURING_TIME_S)
    turns = RATED_SPEED_RATIO_MAX * rated * max(levels, duty_staircase(robot).seconds) / (2 * pi)
    duration = "two and a half minutes" if is_duty_board(robot) else "a minute and a half"
    return MotionNotice(
        "motors",
        "The wheels must be off the ground. Both motors run together, forward and backward, "
        f"slowly at first, then up to 0.9 of full duty, for about {duration}: at most "
        f"{turns:.0f} turns in each direction.",
        turns,
    )


def _fit_lags(
    robot: Robot, steps: list[StepResponse], curves: Mapping[str, FittedMotor]
) -> dict[str, LagFit]:
    """The lag of each wheel, as a robot file states it. Raises RunError if the wheels did not
    follow the steps."""
    staircase = duty_staircase(robot)
    shares = dict.fromkeys(SIDES, SAME_LAG)
    for side, curve in curves.items():
        law = curve.law()
        shares[side] = law.slowness(staircase.high), law.slowness(staircase.low)
    jitter = max(robot.link.command_jitter, COMMAND_JITTER_MIN_S) if is_duty_board(robot) else None
    counts = {side: section.encoder.counts for side, section in drive_sides(robot).items()}
    try:
        return fit_lags(steps, counts, shares, jitter)
    except ValueError as error:
        raise _unusable_wheel("left or the right", error) from error


def _unusable_wheel(side: str, error: ValueError) -> RunError:
    fix = "run `diffbotctl calibrate encoders`, which detects dead motors and encoders"
    return RunError(Problem("E-CALIBRATE-ROBOT", "motors", f"the {side} wheel: {error}", fix))


def _fit_motor(
    side: str,
    breakaway: dict[Motion, float],
    speeds: SpeedsByMotion,
    lag: LagFit,
    curve: FittedMotor | None,
) -> MotorFit:
    """Raises RunError if the wheel did not follow the duties."""
    points = [row for direction in DIRECTIONS for row in speeds[side, direction]]
    try:
        lines = {direction: fit_line(speeds[side, direction]) for direction in DIRECTIONS}
        curve = curve or fit_line(points)
    except ValueError as error:
        raise _unusable_wheel(side, error) from error
    starts = {name: breakaway[side, name] for name in DIRECTIONS}
    return MotorFit(starts, points, lines, lag, curve)


class FeedForward(NamedTuple):
    """Duty of the speed loop for a target: `static`, and `slope` for each rad/s; with standard
    deviations."""

    static: float
    static_sd: float
    slope: float
    slope_sd: float


def _feed_forward(motor: MotorFit, top: float) -> FeedForward:
    """A line, whatever the law of the motor; `top`: the largest speed (rad/s) that it is for.

    With fast decay a line through the speeds at all duties would start the wheel with no duty at
    all, and at low speeds its slope would be several times too large.
    """
    curve = motor.curve
    static = min(max(curve.static, 0.0), STATIC_DUTY_MAX)
    if curve.decay != "fast":
        return FeedForward(static, curve.static_sd, *slope_above(motor.points, static))
    top = min(top, SPEED_LIMIT_RATIO * curve.rated)
    slope = (curve.law().duty(top) - static) / top
    slope_sd = hypot(curve.static_sd / top, slope * curve.rated_sd / curve.rated)
    return FeedForward(static, curve.static_sd, slope, slope_sd)


def _feed_forwards(robot: Robot, motors: dict[str, MotorFit]) -> dict[str, FeedForward]:
    """That of each side, for speeds up to the limit."""
    return {
        side: _feed_forward(motors[side], 2.0 * robot.limits.speed / section.wheel.diameter)
        for side, section in drive_sides(robot).items()
    }


def motor_findings(robot: Robot, motors: dict[str, MotorFit]) -> list[Finding]:
    """The motor and the loop of each side, and a speed limit that both motors can keep."""
    lines = _feed_forwards(robot, motors)
    # Gains that belong to the feed-forward: with a curved line its own slope is far too steep.
    slope = sum(line.slope for line in lines.values()) / len(lines)
    gains = (motor.curve.gain_for(motor.lag.lag) for motor in motors.values())
    proportional, integral = default_gains(max(slope, *gains))
    findings = []
    for side, motor in motors.items():
        line, curve, path = lines[side], motor.curve, f"drive.{side}.motor"
        findings += [
            Finding(f"{path}.rated", curve.rated, curve.rated_sd),
            Finding(f"{path}.lag", motor.lag.lag, hypot(motor.lag.sd, motor.lag.split_sd)),
            Finding(f"{path}.loop.static", line.static, line.static_sd),
            Finding(f"{path}.loop.speed", line.slope, line.slope_sd),
            Finding(f"{path}.loop.proportional", proportional),
            Finding(f"{path}.loop.integral", integral),
        ]
        if curve.decay is not None:
            findings += [
                Finding(f"{path}.decay", curve.decay),
                Finding(f"{path}.friction", line.static, line.static_sd),
            ]
    speed = min(
        motors[side].full_speed * section.wheel.diameter / 2
        for side, section in drive_sides(robot).items()
    )
    limit = floor(SPEED_LIMIT_RATIO * speed * CM) / CM
    if limit < robot.limits.speed:
        findings.append(Finding("limits.speed", limit))
    return findings


def _delay_findings(nominal: Robot, motors: dict[str, MotorFit]) -> list[Finding]:
    """The delay from a command to the motors, if it differs from the stated one.

    If the board reports when a command took effect, only the dead time of the motors is added to
    the stated delay of the link.
    """
    lag = next(iter(motors.values())).lag  # both have one dead time
    if is_duty_board(nominal):
        return [Finding("link.command_delay", lag.dead_time, hypot(lag.sd, lag.split_sd))]
    if not lag.dead_time:
        return []
    delay = nominal.link.command_delay + lag.dead_time
    return [Finding("link.command_delay", delay, hypot(lag.split_sd, DEAD_TIME_SD_MIN_S))]


def _direction_faults(motors: dict[str, MotorFit]) -> list[str]:
    """Motors that are much faster in one direction than in the other."""
    faults = []
    for side, motor in motors.items():
        forward, backward = motor.lines["forward"].rated, motor.lines["backward"].rated
        if abs(forward - backward) > DIRECTION_DIFFERENCE_MAX * (forward + backward) / 2:
            faults.append(
                f"the {side} motor turns at {forward:.1f} rad/s forward and {backward:.1f} rad/s "
                "backward at full duty: the gear rubs, or an output of the driver is failing"
            )
    return faults


def _report(robot: Robot, motors: dict[str, MotorFit]) -> list[str]:
    """The table of both motors, and the lowest speed at which both wheels start."""
    lines = [
        f"{'':<15} {'starts':>7} {'runs on':>7} {'full duty':>12} {'lag':>8} {'dead time':>10}"
    ]
    for side, motor in motors.items():
        for direction, line in motor.lines.items():
            # Of a motor with fast decay the line is none: its curve is that of both directions.
            curve = motor.curve if motor.curve.decay == "fast" else line
            lines.append(
                f"{side + ' ' + direction:<15} {motor.breakaway[direction]:>7.3f} "
                f"{curve.static:>7.3f} {curve.rated:>6.2f} rad/s {motor.lag.lag * 1000:>5.0f} ms "
                f"{motor.lag.dead_time * 1000:>7.0f} ms"
            )
    speed = max(
        max(max(motors[side].breakaway.values()) - line.static, 0.0) / line.slope
        for side, line in _feed_forwards(robot, motors).items()
    )
    radius = max(robot.drive.left.wheel.diameter, robot.drive.right.wheel.diameter) / 2
    speed *= radius * CM
    lines.append(f"lowest speed at which both wheels start: {speed:.1f} cm/s")
    if all(motor.curve.decay == "fast" for motor in motors.values()):
        lines.append("the driver opens the windings between two pulses (decay: fast)")
    return lines
