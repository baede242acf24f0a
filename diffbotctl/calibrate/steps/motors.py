"""`calibrate motors`: dead band, speed against duty, lag; from these the wheels' speed loops."""

from __future__ import annotations

from dataclasses import dataclass
from math import pi

from diffbotctl.calibrate import motor_experiments, motor_findings, motor_fit
from diffbotctl.calibrate.motor_experiments import LEVELS, MEASURING, SETTLING, Levels
from diffbotctl.calibrate.motor_findings import MotorFit
from diffbotctl.calibrate.motor_fit import LagFit
from diffbotctl.calibrate.motor_lag_fit import common_lag
from diffbotctl.calibrate.session import RobotSession
from diffbotctl.calibrate.step import MotionNotice, Outcome, Running
from diffbotctl.config.drive_sides import SIDES
from diffbotctl.config.robot import Robot
from diffbotctl.drivers.robot_link import is_duty_board
from diffbotctl.errors import Problem, RunError
from diffbotctl.messages import Battery

LEAST_JITTER = 0.005  # s, sd of when a board that does not tell takes a command
FASTEST = 1.6  # times the rated speed: what the robot file may understate it by


@dataclass(frozen=True, slots=True)
class MotorStep:
    """The step."""

    name: str = "motors"
    title: str = "dead band, speed, lag; sets the speed loops"
    lifted: bool = True

    def run(self, rig: RobotSession) -> Running:
        """Dead bands, then speeds, then steps, then the loops are tried."""
        rig.meet()
        yield _announced(rig)
        starts = yield from motor_experiments.starts(rig)
        levels = yield from motor_experiments.levels(rig)
        steps = yield from motor_experiments.steps(rig)
        robot = rig.file.robot
        lags = _lags(robot, steps)
        motors = {side: _motor(side, starts, levels, lags[side]) for side in SIDES}
        findings = motor_findings.motor_findings(robot, motors)
        findings += motor_findings.delay(rig.file.nominal, motors)
        rig.attempt(findings)
        faults = [*motor_findings.unlike(motors), *(yield from motor_experiments.accepted(rig))]
        report = motor_findings.report(robot, motors)
        return Outcome("motors", findings, report, faults, volts=_volts(rig))


def _announced(rig: RobotSession) -> MotionNotice:
    drive = rig.file.robot.drive
    rated = max(drive.left.motor.rated, drive.right.motor.rated)
    # The longest way in one direction: all levels, or all steps.
    levels = sum(LEVELS) * (SETTLING + MEASURING)
    way = max(levels, motor_experiments.stairs(rig.file.robot).way)
    most = FASTEST * rated * way / (2 * pi)
    return MotionNotice(
        "The wheels must be off the ground. Both motors are driven together, forward and backward, "
        f"slowly at first, then up to 0.9 of full power: about {_minutes(rig.file.robot)}, at most "
        f"{most:.0f} turns one way.",
        most,
    )


def _minutes(robot: Robot) -> str:
    return "two and a half minutes" if is_duty_board(robot) else "a minute and a half"


def _lags(robot: Robot, steps: list[motor_fit.StepResponse]) -> dict[str, LagFit]:
    """Raises RunError when the wheels do not do what is to be measured."""
    slots = motor_experiments.slots(robot)
    side = "left or the right"
    try:
        if is_duty_board(robot):
            jitter = max(robot.link.command_jitter, LEAST_JITTER)
            return dict.fromkeys(SIDES, common_lag(steps, slots["left"], jitter))
        found = {}
        for side in SIDES:
            found[side] = motor_fit.fit_lag(steps, side == "left", slots[side])
        return found
    except ValueError as error:
        raise _untold(side, error) from error


def _untold(side: str, error: ValueError) -> RunError:
    fix = "run `diffbotctl calibrate encoders`, which finds dead motors and encoders"
    return RunError(Problem("E-CALIBRATE-ROBOT", "motors", f"the {side} wheel: {error}", fix))


def _motor(side: str, starts: dict[str, float], levels: Levels, lag: LagFit) -> MotorFit:
    """Raises RunError when the wheel does not do what is to be measured."""
    ways = {way: levels[f"{side} {way}"] for way in ("forward", "backward")}
    try:
        lines = {
            way: motor_fit.fit_line(*zip(*points, strict=True)) for way, points in ways.items()
        }
        both = motor_fit.fit_line(*zip(*ways["forward"], *ways["backward"], strict=True))
    except ValueError as error:
        raise _untold(side, error) from error
    return MotorFit({way: starts[f"{side} {way}"] for way in ways}, lines, both, lag)


def _volts(rig: RobotSession) -> float | None:
    """The battery's voltage, where the robot measures it."""
    heard = rig.listen(1.0).of(Battery)
    return heard[-1].volts if heard else None
