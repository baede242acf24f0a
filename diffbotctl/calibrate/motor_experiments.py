"""The experiments of `calibrate motors`: breakaway duty, steady speeds, duty steps, creep."""

from __future__ import annotations

from collections.abc import Generator, Mapping
from typing import Any, NamedTuple

from diffbotctl.calibrate.motor_fit import NS, StepResponse, mean_speed
from diffbotctl.calibrate.session import Received, RobotSession, drive_sides
from diffbotctl.calibrate.step import Event, Message, StepProgress
from diffbotctl.config.robot import SIDES, Robot
from diffbotctl.drivers.robot_ports import is_duty_board, wheel_command
from diffbotctl.messages import Duty, Encoders

PWM_STEPS = 255  # of full duty, on every board
# Above every usual dead band, below full duty. Whole steps: a board rounds other duties by up to
# half a step, which would make the friction wrong by 0.003.
DUTY_LEVELS = tuple(step / PWM_STEPS for step in (77, 115, 153, 191, 230))
# Some boards add a step to each duty, and which do is not known.
DUTY_SD = 1 / PWM_STEPS / 12**0.5
SETTLING_TIME_S = 0.9  # before a speed is measured: six lags of a slow motor
MEASURING_TIME_S = 2.5  # more than a turn of usual motors
# Slower wheels get as much more as a whole turn takes, up to this: the errors of the slots and the
# ripple of the gears cancel over whole turns only, and at the lowest level they decide friction.
MEASURING_TIME_MAX_S = 8.0
BREAKAWAY_DUTY_MIN, BREAKAWAY_DUTY_MAX = 0.02, 0.30  # the board detects a stall above the maximum
BISECTIONS = 6
BREAKAWAY_RESOLUTION = (BREAKAWAY_DUTY_MAX - BREAKAWAY_DUTY_MIN) / 2**BISECTIONS
BREAKAWAY_TIME_S = 2.0  # a wheel that starts reaches a slot in this time
CREEP_SPEED_M_S = 0.03
CREEP_TIME_S = 5.0  # the wheels must have settled in the second half
CREEP_ERROR_RATIO_MAX = 0.35
CM = 100  # in a metre

DIRECTIONS = {"forward": 1, "backward": -1}
Motion = tuple[str, str]  # side and direction, such as ("left", "forward")
SpeedsByMotion = dict[Motion, list[tuple[float, float]]]  # (duty, rad/s) at each level


class DutyStaircase(NamedTuple):
    """Steps up and down between two duties."""

    low: float
    high: float
    plateau: float  # s between two steps
    steps: int
    increment: float = 0.0
    """s by which each plateau is longer than the last, so that the phase of the frames varies"""

    @property
    def seconds(self) -> float:
        """Duration."""
        return (self.steps + 1) * self.plateau + sum(range(self.steps)) * self.increment


STAIRCASE = DutyStaircase(0.35, 0.75, 1.6, 8)
# Without edge times, the counts, the frames and the time at which a command takes effect all
# scatter: larger steps, and more of them.
STOCK_STAIRCASE = DutyStaircase(0.32, 0.92, 1.9, 24, 0.007)


def measure_breakaway(session: RobotSession) -> Generator[Event, Any, dict[Motion, float]]:
    """The duty at which each wheel starts, by bisection of both wheels at once."""
    duties = {}
    for direction, sign in DIRECTIONS.items():
        low = dict.fromkeys(SIDES, BREAKAWAY_DUTY_MIN)
        high = dict.fromkeys(SIDES, BREAKAWAY_DUTY_MAX)
        for number in range(BISECTIONS):
            yield StepProgress(f"breakaway duty, {direction}", number, BISECTIONS)
            trial = {side: (low[side] + high[side]) / 2 for side in SIDES}
            before = session.latest_frame()
            session.run_for(Duty(0, sign * trial["left"], sign * trial["right"]), BREAKAWAY_TIME_S)
            session.stop_and_wait()
            after = session.latest_frame()
            for side in SIDES:
                has_moved = getattr(after, side) != getattr(before, side)
                (high if has_moved else low)[side] = trial[side]
        for side in SIDES:
            duties[side, direction] = (low[side] + high[side]) / 2
    return duties


def measure_speeds(session: RobotSession) -> Generator[Event, Any, SpeedsByMotion]:
    """Speeds at steady duties in both directions."""
    sides = drive_sides(session.file.robot)
    speeds: SpeedsByMotion = {(side, direction): [] for direction in DIRECTIONS for side in SIDES}
    for direction, sign in DIRECTIONS.items():
        for number, level in enumerate(DUTY_LEVELS):
            text = f"speed at {level:.2f} of full duty, {direction}"
            yield StepProgress(text, number, len(DUTY_LEVELS))
            duty = Duty(0, sign * level, sign * level)
            session.run_for(duty, SETTLING_TIME_S)
            counts = {side: section.encoder.counts for side, section in sides.items()}
            frames = _whole_turns(session, duty, counts)
            for side in SIDES:
                speed = mean_speed(frames, side == "left", sides[side].encoder.counts)
                speeds[side, direction].append((level, abs(speed)))
        session.stop_and_wait()
    return speeds


def _whole_turns(session: RobotSession, duty: Duty, counts: Mapping[str, int]) -> list[Encoders]:
    """The frames of a whole turn or more of both wheels, if they are fast enough.

    `counts`: per turn, by side.
    """
    frames = session.run_for(duty, MEASURING_TIME_S).encoders
    for _ in range(round(MEASURING_TIME_MAX_S / MEASURING_TIME_S) - 1):
        if frames and all(
            abs(getattr(frames[-1], s) - getattr(frames[0], s)) > counts[s] for s in counts
        ):
            break
        frames += session.run_for(duty, MEASURING_TIME_S).encoders
    return frames


def record_steps(session: RobotSession) -> Generator[Event, Any, list[StepResponse]]:
    """Steps up and down between two duties.

    The time of a step is when it took effect; when it was sent if the board does not report that.
    """
    robot = session.file.robot
    staircase = duty_staircase(robot)
    before = session.run_for(Duty(0, staircase.low, staircase.low), staircase.plateau)
    steps = []
    for number in range(staircase.steps):
        yield StepProgress("step responses", number, staircase.steps)
        is_up = number % 2 == 0
        level = staircase.high if is_up else staircase.low
        sent = session.now * NS
        plateau = staircase.plateau + number * staircase.increment
        after = session.run_for(Duty(0, level, level), plateau)
        time = sent if is_duty_board(robot) else _effect_time(after, level, sent)
        steps.append(StepResponse([*before.encoders, *after.encoders], time, is_up))
        before = after
    session.stop_and_wait()
    return steps


def duty_staircase(robot: Robot) -> DutyStaircase:
    """The steps that suit the board of this robot."""
    return STOCK_STAIRCASE if is_duty_board(robot) else STAIRCASE


def _effect_time(received: Received, level: float, sent: float) -> float:
    """When (s) the board reports that the duty took effect; `sent` if it does not."""
    for frame in received.encoders:
        if abs(frame.left_command - level) < 0.01 and frame.command_time is not None:
            return frame.command_time * NS
    return sent


def check_creep(session: RobotSession) -> Generator[Event, Any, list[str]]:
    """Start both wheels to a creep with the fitted loops. Returns advice for each that fails."""
    session.connect()
    robot = session.file.robot
    sides = drive_sides(robot)
    target = {side: 2 * CREEP_SPEED_M_S / sides[side].wheel.diameter for side in SIDES}
    yield Message(
        f"Test: the fitted loops must start both wheels at {CREEP_SPEED_M_S * CM:g} cm/s."
    )
    command = wheel_command(robot, target["left"], target["right"])
    session.run_for(command, CREEP_TIME_S / 2)
    frames = session.run_for(command, CREEP_TIME_S / 2).encoders
    session.stop_and_wait()
    advice = []
    for side in SIDES:
        speed = mean_speed(frames, side == "left", sides[side].encoder.counts)
        ratio = speed / target[side]
        if abs(ratio - 1.0) > CREEP_ERROR_RATIO_MAX:
            speeds = f"{ratio * CREEP_SPEED_M_S * CM:.1f} instead of {CREEP_SPEED_M_S * CM:g} cm/s"
            advice.append(
                f"the {side} wheel does not hold a low speed: {speeds}. Does the gear need oil, "
                "or is the battery low?"
            )
    return advice
