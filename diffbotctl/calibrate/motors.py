"""`calibrate motors`: dead band, speed against duty, lag; from these the wheels' speed loops."""

from __future__ import annotations

from dataclasses import dataclass
from math import pi

from diffbotctl.calibrate import motor_findings, motor_fit, motor_trials
from diffbotctl.calibrate.hidden_delay import common_lag
from diffbotctl.calibrate.motor_findings import Motor
from diffbotctl.calibrate.motor_fit import Lag
from diffbotctl.calibrate.motor_trials import LEVELS, MEASURING, SETTLING, Levels
from diffbotctl.calibrate.rig import Rig
from diffbotctl.calibrate.step import Announce, Outcome, Running
from diffbotctl.config.robot import Robot
from diffbotctl.config.sides import SIDES
from diffbotctl.errors import Problem, RunError
from diffbotctl.messages import Battery
from diffbotctl.runs.simulation import takes_duty

LEAST_JITTER = 0.005  # s, sd of when a board that does not tell takes a command
FASTEST = 1.6  # times the rated speed: what the robot file may understate it by


@dataclass(frozen=True, slots=True)
class Motors:
    """The step."""

    name: str = "motors"
    title: str = "dead band, speed, lag; sets the speed loops"
    lifted: bool = True

    def run(self, rig: Rig) -> Running:
        """Dead bands, then speeds, then steps, then the loops are tried."""
        rig.meet()
        yield _announced(rig)
        starts = yield from motor_trials.starts(rig)
        levels = yield from motor_trials.levels(rig)
        steps = yield from motor_trials.steps(rig)
        robot = rig.file.robot
        lags = _lags(robot, steps)
        motors = {side: _motor(side, starts, levels, lags[side]) for side in SIDES}
        findings = motor_findings.findings(robot, motors)
        findings += motor_findings.delay(rig.file.nominal, motors)
        rig.attempt(findings)
        faults = [*motor_findings.unlike(motors), *(yield from motor_trials.accepted(rig))]
        report = motor_findings.report(robot, motors)
        return Outcome("motors", findings, report, faults, volts=_volts(rig))


def _announced(rig: Rig) -> Announce:
    drive = rig.file.robot.drive
    rated = max(drive.left.motor.rated, drive.right.motor.rated)
    # The longest way in one direction: all levels, or all steps.
    levels = sum(LEVELS) * (SETTLING + MEASURING)
    way = max(levels, motor_trials.stairs(rig.file.robot).way)
    most = FASTEST * rated * way / (2 * pi)
    return Announce(
        "The wheels must be off the ground. Both motors are driven together, forward and backward, "
        f"slowly at first, then up to 0.9 of full power: about {_minutes(rig.file.robot)}, at most "
        f"{most:.0f} turns one way.",
        most,
    )


def _minutes(robot: Robot) -> str:
    return "two and a half minutes" if takes_duty(robot) else "a minute and a half"


def _lags(robot: Robot, steps: list[motor_fit.Step]) -> dict[str, Lag]:
    """Raises RunError when the wheels do not do what is to be measured."""
    slots = motor_trials.slots(robot)
    side = "left or the right"
    try:
        if takes_duty(robot):
            jitter = max(robot.link.command_jitter, LEAST_JITTER)
            return dict.fromkeys(SIDES, common_lag(steps, slots["left"], jitter))
        found = {}
        for side in SIDES:
            found[side] = motor_fit.lag(steps, side == "left", slots[side])
        return found
    except ValueError as error:
        raise _untold(side, error) from error


def _untold(side: str, error: ValueError) -> RunError:
    fix = "run `diffbotctl calibrate encoders`, which finds dead motors and encoders"
    return RunError(Problem("E-CALIBRATE-ROBOT", "motors", f"the {side} wheel: {error}", fix))


def _motor(side: str, starts: dict[str, float], levels: Levels, lag: Lag) -> Motor:
    """Raises RunError when the wheel does not do what is to be measured."""
    ways = {way: levels[f"{side} {way}"] for way in ("forward", "backward")}
    try:
        lines = {way: motor_fit.line(*zip(*points, strict=True)) for way, points in ways.items()}
        both = motor_fit.line(*zip(*ways["forward"], *ways["backward"], strict=True))
    except ValueError as error:
        raise _untold(side, error) from error
    return Motor({way: starts[f"{side} {way}"] for way in ways}, lines, both, lag)


def _volts(rig: Rig) -> float | None:
    """The battery's voltage, where the robot measures it."""
    heard = rig.listen(1.0).of(Battery)
    return heard[-1].volts if heard else None
