"""`calibrate motors`: dead band, speed against duty, lag; from these the wheels' speed loops."""

from __future__ import annotations

from dataclasses import dataclass
from math import pi

from diffbotctl.calibrate import motor_findings, motor_fit, motor_trials
from diffbotctl.calibrate.motor_findings import Motor
from diffbotctl.calibrate.motor_trials import LEVELS, MEASURING, SETTLING, Levels
from diffbotctl.calibrate.rig import Rig
from diffbotctl.calibrate.step import Announce, Outcome, Running
from diffbotctl.config.robot import Robot
from diffbotctl.config.sides import SIDES
from diffbotctl.errors import Problem, RunError
from diffbotctl.messages import Battery
from diffbotctl.runs.simulation import takes_duty

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
        motors = {side: _motor(robot, side, starts, levels, steps) for side in SIDES}
        if takes_duty(robot):
            motors = motor_findings.alike(motors)
        findings = motor_findings.findings(robot, motors)
        rig.attempt(findings)
        faults = [*motor_findings.unlike(motors), *(yield from motor_trials.accepted(rig))]
        report = motor_findings.report(robot, motors)
        return Outcome("motors", findings, report, faults, volts=_volts(rig))


def _announced(rig: Rig) -> Announce:
    drive = rig.file.robot.drive
    rated = max(drive.left.motor.rated, drive.right.motor.rated)
    # The longest way in one direction: all levels.
    most = FASTEST * rated * sum(LEVELS) * (SETTLING + MEASURING) / (2 * pi)
    return Announce(
        "The wheels must be off the ground. Both motors are driven together, forward and backward, "
        "slowly at first, then up to 0.9 of full power: about a minute and a half, at most "
        f"{most:.0f} turns one way.",
        most,
    )


def _motor(
    robot: Robot, side: str, starts: dict[str, float], levels: Levels, steps: list[motor_fit.Step]
) -> Motor:
    """Raises RunError when the wheel does not do what is to be measured."""
    ways = {way: levels[f"{side} {way}"] for way in ("forward", "backward")}
    try:
        lines = {way: motor_fit.line(*zip(*points, strict=True)) for way, points in ways.items()}
        both = motor_fit.line(*zip(*ways["forward"], *ways["backward"], strict=True))
        lag = motor_fit.lag(steps, side == "left", motor_trials.slots(robot)[side])
    except ValueError as error:
        fix = "run `diffbotctl calibrate encoders`, which finds dead motors and encoders"
        cause = f"the {side} wheel: {error}"
        raise RunError(Problem("E-CALIBRATE-ROBOT", "motors", cause, fix)) from error
    return Motor({way: starts[f"{side} {way}"] for way in ways}, lines, both, lag)


def _volts(rig: Rig) -> float | None:
    """The battery's voltage, where the robot measures it."""
    heard = rig.listen(1.0).of(Battery)
    return heard[-1].volts if heard else None
