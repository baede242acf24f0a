"""What `calibrate motors` has the wheels do: creep up on their dead band, run, step, creep."""

from __future__ import annotations

from collections.abc import Generator
from typing import Any, NamedTuple

from diffbotctl.calibrate import motor_fit
from diffbotctl.calibrate.session import Received, RobotSession
from diffbotctl.calibrate.step import Event, Message, StepProgress
from diffbotctl.config.robot import SIDES, Robot
from diffbotctl.drivers.robot_link import is_duty_board, wheel_command
from diffbotctl.messages import Duty

DUTY_LEVELS = (0.3, 0.45, 0.6, 0.75, 0.9)  # duty; above every usual dead band, below full
SETTLING_TIME_S = 0.9  # s before a speed is measured: six lags of a slow motor
MEASURING_TIME_S = 2.5  # s; a turn and more at the slowest level
# A breakaway duty is looked for below the duty at which the board watches for a stall.
BREAKAWAY_DUTY_RANGE = (0.02, 0.30)
BISECTION_STEPS = 6  # leave 0.005 of duty
TRIAL_TIME_S = 2.0  # s; a wheel that broke loose has met a slot by then
CREEP_SPEED_M_S = 0.03  # m/s of the step that accepts the loop
CREEP_TIME_S = 5.0  # s of it, of which the second half must be settled
CREEP_ERROR_RATIO_MAX = 0.35  # how far the creeping speed may be off
BREAKAWAY_DUTY_RESOLUTION = (
    BREAKAWAY_DUTY_RANGE[1] - BREAKAWAY_DUTY_RANGE[0]
) / 2**BISECTION_STEPS  # duty
CM = 100  # in a metre


class DutyStaircase(NamedTuple):
    """Steps up and down in turn, between two duties."""

    slow: float
    fast: float
    plateau: float
    """s between two"""
    steps: int
    longer: float = 0.0
    """s by which each is longer than the one before, so that frames meet each at another moment"""

    @property
    def way(self) -> float:
        """Duty times seconds of the whole."""
        seconds = (self.steps + 1) * self.plateau + sum(range(self.steps)) * self.longer
        return seconds * (self.slow + self.fast) / 2


STAIRCASE = DutyStaircase(0.35, 0.75, 1.6, 8)
# Of a board that tells no edge times, the counts, the frames and when it takes a command all
# scatter: larger steps, and more of them.
STOCK_STAIRCASE = DutyStaircase(0.32, 0.92, 1.9, 24, 0.007)

SpeedsByDuty = dict[str, list[tuple[float, float]]]
"""(duty, rad/s) by `left forward`, `left backward`, ..."""


def measure_breakaway(rig: RobotSession) -> Generator[Event, Any, dict[str, float]]:
    """Breakaway duty by `left forward` and so on, halving both wheels' bands at once."""
    found = {}
    for sign, way in ((1, "forward"), (-1, "backward")):
        low, high = (
            dict.fromkeys(SIDES, BREAKAWAY_DUTY_RANGE[0]),
            dict.fromkeys(SIDES, BREAKAWAY_DUTY_RANGE[1]),
        )
        for number in range(BISECTION_STEPS):
            yield StepProgress(f"what starts the wheels {way}", number, BISECTION_STEPS)
            tried = {side: (low[side] + high[side]) / 2 for side in SIDES}
            moved = _moved_sides(rig, Duty(0, sign * tried["left"], sign * tried["right"]))
            for side in SIDES:
                (high if moved[side] else low)[side] = tried[side]
        for side in SIDES:
            found[f"{side} {way}"] = (low[side] + high[side]) / 2
    return found


def _moved_sides(rig: RobotSession, duty: Duty) -> dict[str, bool]:
    """Which wheels turn out of rest."""
    before = rig.latest()
    rig.hold(duty, TRIAL_TIME_S)
    rig.rest()
    after = rig.latest()
    return {"left": after.left != before.left, "right": after.right != before.right}


def measure_speeds(rig: RobotSession) -> Generator[Event, Any, SpeedsByDuty]:
    """Speeds at steady duties, both ways."""
    turn = slots_by_side(rig.file.robot)
    found: SpeedsByDuty = {}
    for sign, way in ((1, "forward"), (-1, "backward")):
        for number, level in enumerate(DUTY_LEVELS):
            yield StepProgress(f"speed at {level:g} of full power, {way}", number, len(DUTY_LEVELS))
            duty = Duty(0, sign * level, sign * level)
            rig.hold(duty, SETTLING_TIME_S)
            heard = rig.hold(duty, MEASURING_TIME_S).encoders
            for side in SIDES:
                speed = motor_fit.mean_speed(heard, side == "left", turn[side])
                found.setdefault(f"{side} {way}", []).append((level, abs(speed)))
        rig.rest()
    return found


def record_steps(rig: RobotSession) -> Generator[Event, Any, list[motor_fit.StepResponse]]:
    """Steps up and down between two duties, timed by when they took hold; where the board does not
    tell that, by when they were sent."""
    told = not is_duty_board(rig.file.robot)
    made = duty_staircase(rig.file.robot)
    before = rig.hold(Duty(0, made.slow, made.slow), made.plateau)
    found = []
    for number in range(made.steps):
        yield StepProgress("how late the wheels follow", number, made.steps)
        up = number % 2 == 0
        level = made.fast if up else made.slow
        sent = rig.now * motor_fit.NS
        after = rig.hold(Duty(0, level, level), made.plateau + number * made.longer)
        frames = [*before.encoders, *after.encoders]
        taken = _time_taken_effect(after, level, sent) if told else sent
        found.append(motor_fit.StepResponse(frames, taken, up))
        before = after
    rig.rest()
    return found


def duty_staircase(robot: Robot) -> DutyStaircase:
    """The steps that suit this robot's board."""
    return STOCK_STAIRCASE if is_duty_board(robot) else STAIRCASE


def _time_taken_effect(after: Received, level: float, sent: float) -> float:
    """When (s) the board says that the duty took hold; `sent` where it does not say."""
    for frame in after.encoders:
        if abs(frame.left_command - level) < 0.01 and frame.command_time is not None:
            return frame.command_time * motor_fit.NS
    return sent


def check_creep(rig: RobotSession) -> Generator[Event, Any, list[str]]:
    """A step from rest to a creep, with the loops as found: both wheels must start and settle."""
    rig.meet()
    robot = rig.file.robot
    drive = {"left": robot.drive.left, "right": robot.drive.right}
    wanted = {side: 2 * CREEP_SPEED_M_S / drive[side].wheel.diameter for side in SIDES}
    yield Message(f"The loops as found must start both wheels at {CREEP_SPEED_M_S * CM:g} cm/s.")
    command = wheel_command(robot, wanted["left"], wanted["right"])
    rig.hold(command, CREEP_TIME_S / 2)
    heard = rig.hold(command, CREEP_TIME_S / 2).encoders
    rig.rest()
    faults = []
    for side in SIDES:
        speed = motor_fit.mean_speed(heard, side == "left", drive[side].encoder.slots)
        share = speed / wanted[side]
        if abs(share - 1.0) > CREEP_ERROR_RATIO_MAX:
            came = f"{share * CREEP_SPEED_M_S * CM:.1f} cm/s came of {CREEP_SPEED_M_S * CM:g}"
            faults.append(
                f"the {side} wheel does not hold a creep: {came}. Is the gear dry, or the "
                "battery low? Then this motor cannot drive slower than it breaks loose"
            )
    return faults


def slots_by_side(robot: Robot) -> dict[str, int]:
    """Counts per turn of each wheel."""
    return {"left": robot.drive.left.encoder.slots, "right": robot.drive.right.encoder.slots}
