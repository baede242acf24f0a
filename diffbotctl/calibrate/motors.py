"""`calibrate motors`: dead band, speed against duty, lag; from these the wheels' speed loops."""

from __future__ import annotations

from collections.abc import Generator
from dataclasses import dataclass
from math import floor, hypot, pi
from typing import Any, NamedTuple

from diffbotctl.calibrate import commanded, motor_fit, wheel_log
from diffbotctl.calibrate.findings import Finding
from diffbotctl.calibrate.motor_fit import Lag, Line
from diffbotctl.calibrate.rig import Heard, Rig
from diffbotctl.calibrate.step import Announce, Event, Outcome, Progress, Running, Said
from diffbotctl.config.robot import Robot
from diffbotctl.config.sides import SIDES
from diffbotctl.errors import Problem, RunError
from diffbotctl.messages import Battery, Duty
from diffbotctl.runs.simulation import takes_duty

LEVELS = (0.3, 0.45, 0.6, 0.75, 0.9)  # duty; above every usual dead band, below full
SETTLING = 0.9  # s before a speed is measured: six lags of a slow motor
MEASURING = 2.5  # s; a turn and more at the slowest level
# A breakaway duty is looked for below the duty at which the board watches for a stall.
BAND = (0.02, 0.30)
HALVINGS = 6  # leave 0.005 of duty
TRIAL = 2.0  # s; a wheel that broke loose has met a slot by then
SLOW, FAST = 0.35, 0.75  # duty of the steps
PLATEAU = 1.6  # s between two steps
STEPS = 8  # up and down in turn
FASTEST = 1.6  # times the rated speed: what the robot file may understate it by
INTEGRAL = 0.25  # 1/s; integral gain over kV: what is missing is made good within some seconds
PROPORTIONAL = 0.0  # of kV: the speed of one slot alone is 4 % wrong, and would be passed on
CREEP = 0.03  # m/s of the step that accepts the loop
CREEPING = 5.0  # s of it, of which the second half must be settled
SETTLED = 0.35  # how far the creeping speed may be off
MARGIN = 0.95  # of full power's speed: the loops need the rest, and so does a weaker battery
CENTIMETRES = 100  # in a metre; limits are rounded down to whole ones
DIFFERENT = 0.15  # between the directions of one motor: more is a fault of its gear or driver


class Motor(NamedTuple):
    """What was measured of one motor."""

    start: dict[str, float]
    """duty that breaks it loose, by direction"""
    lines: dict[str, Line]
    """by direction"""
    line: Line
    """of both directions together"""
    lag: Lag


Levels = dict[str, list[tuple[float, float]]]
"""(duty, rad/s) by `left forward`, `left backward`, ..."""


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
        starts = yield from _starts(rig)
        levels = yield from _levels(rig)
        steps = yield from _steps(rig)
        motors = {side: _motor(rig.file.robot, side, starts, levels, steps) for side in SIDES}
        if takes_duty(rig.file.robot):
            motors = _alike(motors)
        findings = [*_findings(motors), *_limit(rig.file.robot, motors)]
        rig.attempt(findings)
        faults = [*_unlike(motors), *(yield from _accepted(rig))]
        return Outcome("motors", findings, _report(rig.file.robot, motors), faults,
                       volts=_volts(rig))  # fmt: skip


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


def _starts(rig: Rig) -> Generator[Event, Any, dict[str, float]]:
    """Breakaway duty by `left forward` and so on, halving both wheels' bands at once."""
    found = {}
    for sign, way in ((1, "forward"), (-1, "backward")):
        low, high = dict.fromkeys(SIDES, BAND[0]), dict.fromkeys(SIDES, BAND[1])
        for number in range(HALVINGS):
            yield Progress(f"what starts the wheels {way}", number, HALVINGS)
            tried = {side: (low[side] + high[side]) / 2 for side in SIDES}
            moved = _moves(rig, Duty(0, sign * tried["left"], sign * tried["right"]))
            for side in SIDES:
                (high if moved[side] else low)[side] = tried[side]
        for side in SIDES:
            found[f"{side} {way}"] = (low[side] + high[side]) / 2
    return found


def _moves(rig: Rig, duty: Duty) -> dict[str, bool]:
    """Which wheels turn out of rest."""
    before = rig.latest()
    rig.hold(duty, TRIAL)
    rig.rest()
    after = rig.latest()
    return {"left": after.left != before.left, "right": after.right != before.right}


def _levels(rig: Rig) -> Generator[Event, Any, Levels]:
    slots = _slots(rig.file.robot)
    found: Levels = {}
    for sign, way in ((1, "forward"), (-1, "backward")):
        for number, level in enumerate(LEVELS):
            yield Progress(f"speed at {level:g} of full power, {way}", number, len(LEVELS))
            duty = Duty(0, sign * level, sign * level)
            rig.hold(duty, SETTLING)
            heard = rig.hold(duty, MEASURING).encoders
            for side in SIDES:
                speed = wheel_log.speed(heard, side == "left", slots[side])
                found.setdefault(f"{side} {way}", []).append((level, abs(speed)))
        rig.rest()
    return found


def _steps(rig: Rig) -> Generator[Event, Any, list[motor_fit.Step]]:
    delay = rig.file.robot.link.command_delay
    before = rig.hold(Duty(0, SLOW, SLOW), PLATEAU)
    steps = []
    for number in range(STEPS):
        yield Progress("how late the wheels follow", number, STEPS)
        up = number % 2 == 0
        level = FAST if up else SLOW
        sent = rig.now * wheel_log.SECONDS + delay
        after = rig.hold(Duty(0, level, level), PLATEAU)
        frames = [*before.encoders, *after.encoders]
        steps.append(motor_fit.Step(frames, _taken(after, level, sent), up))
        before = after
    rig.rest()
    return steps


def _taken(after: Heard, level: float, sent: float) -> float:
    """When (s) the board says that the duty took hold; `sent` where it does not say."""
    for frame in after.encoders:
        if abs(frame.left_command - level) < 0.01 and frame.command_time is not None:
            return frame.command_time * wheel_log.SECONDS
    return sent


def _motor(
    robot: Robot, side: str, starts: dict[str, float], levels: Levels, steps: list[motor_fit.Step]
) -> Motor:
    """Raises RunError when the wheel does not do what is to be measured."""
    ways = {way: levels[f"{side} {way}"] for way in ("forward", "backward")}
    try:
        lines = {way: motor_fit.line(*zip(*points, strict=True)) for way, points in ways.items()}
        both = motor_fit.line(*zip(*ways["forward"], *ways["backward"], strict=True))
        lag = motor_fit.lag(steps, side == "left", _slots(robot)[side])
    except ValueError as error:
        fix = "run `diffbotctl calibrate encoders`, which finds dead motors and encoders"
        cause = f"the {side} wheel: {error}"
        raise RunError(Problem("E-CALIBRATE-ROBOT", "motors", cause, fix)) from error
    return Motor({way: starts[f"{side} {way}"] for way in ways}, lines, both, lag)


def _alike(motors: dict[str, Motor]) -> dict[str, Motor]:
    """Both with the mean of their lags.

    A board that does not tell when a command took hold takes it for each wheel at another moment:
    what differs between its wheels is that, and the motors are of one kind.
    """
    left, right = (motors[side].lag for side in SIDES)
    both = Lag(
        (left.lag + right.lag) / 2, (left.dead + right.dead) / 2, hypot(left.sd, right.sd) / 2
    )
    return {side: motor._replace(lag=both) for side, motor in motors.items()}


def _findings(motors: dict[str, Motor]) -> list[Finding]:
    slope = sum(motor.line.slope for motor in motors.values()) / len(motors)
    made = []
    for side, motor in motors.items():
        line, path = motor.line, f"drive.{side}.motor"
        static = min(max(line.static, 0.0), 0.75)
        start = max(sum(motor.start.values()) / len(motor.start), static)
        resolution = (BAND[1] - BAND[0]) / 2**HALVINGS
        made += [
            Finding(f"{path}.rated", line.rated, line.rated * line.slope_sd / line.slope),
            Finding(f"{path}.start_duty", start, resolution),
            Finding(f"{path}.keep_duty", static, line.static_sd),
            Finding(f"{path}.lag", motor.lag.lag, motor.lag.sd),
            Finding(f"{path}.loop.static", static, line.static_sd),
            Finding(f"{path}.loop.speed", line.slope, line.slope_sd),
            Finding(f"{path}.loop.proportional", PROPORTIONAL * slope),
            Finding(f"{path}.loop.integral", INTEGRAL * slope),
        ]
    return made


def _limit(robot: Robot, motors: dict[str, Motor]) -> list[Finding]:
    """A speed limit that both motors can keep, where the stated one is too much for them."""
    drive = {"left": robot.drive.left, "right": robot.drive.right}
    reach = min(motors[side].line.rated * drive[side].wheel.diameter / 2 for side in SIDES)
    kept = floor(MARGIN * reach * CENTIMETRES) / CENTIMETRES
    return [Finding("limits.speed", kept)] if kept < robot.limits.speed else []


def _unlike(motors: dict[str, Motor]) -> list[str]:
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


def _accepted(rig: Rig) -> Generator[Event, Any, list[str]]:
    """A step from rest to a creep, with the loops as found: both wheels must start and settle."""
    rig.meet()
    robot = rig.file.robot
    drive = {"left": robot.drive.left, "right": robot.drive.right}
    wanted = {side: 2 * CREEP / drive[side].wheel.diameter for side in SIDES}
    yield Said(f"The loops as found must start both wheels at {CREEP * 100:g} cm/s.")
    command = commanded.wheels(robot, wanted["left"], wanted["right"])
    rig.hold(command, CREEPING / 2)
    heard = rig.hold(command, CREEPING / 2).encoders
    rig.rest()
    faults = []
    for side in SIDES:
        speed = wheel_log.speed(heard, side == "left", drive[side].encoder.slots)
        share = speed / wanted[side]
        if abs(share - 1.0) > SETTLED:
            came = f"{share * CREEP * 100:.1f} cm/s came of {CREEP * 100:g}"
            faults.append(
                f"the {side} wheel does not hold a creep: {came}. Is the gear dry, or the "
                "battery low? Then this motor cannot drive slower than it breaks loose"
            )
    return faults


def _report(robot: Robot, motors: dict[str, Motor]) -> list[str]:
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


def _slots(robot: Robot) -> dict[str, int]:
    return {"left": robot.drive.left.encoder.slots, "right": robot.drive.right.encoder.slots}


def _volts(rig: Rig) -> float | None:
    """The battery's voltage, where the robot measures it."""
    heard = rig.listen(1.0).of(Battery)
    return heard[-1].volts if heard else None
