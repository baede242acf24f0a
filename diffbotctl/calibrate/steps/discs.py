"""`calibrate discs`: the positions of the slots of both encoder discs, learned from lifted wheels.

The learner is odometry (`estimation/slot_errors.py`) with two differences: the edges seen in
backward motion are learned slot by slot too, and learning never ends. The motors turn with a
constant duty: a speed loop answers each slot that is cut unevenly, which looks like another place
of the slot.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from math import inf, pi, sqrt
from statistics import fmean
from typing import NamedTuple

from diffbotctl.blocks.odometry import OdometryBlock
from diffbotctl.calibrate.result import Finding
from diffbotctl.calibrate.session import RobotSession, drive_sides
from diffbotctl.calibrate.step import Outcome, StepProgress, StepRun
from diffbotctl.config.robot import SIDES, Robot
from diffbotctl.control.speed_loop import speed_gains
from diffbotctl.errors import Problem, RunError
from diffbotctl.estimation.slot_errors import SlotErrors
from diffbotctl.estimation.wheel_odometer import WheelOdometer
from diffbotctl.estimation.wheel_side import LinkTiming
from diffbotctl.messages import Battery, Duty, Encoders
from diffbotctl.prompts.question import ExpectedQuestion, MotionNotice, motion_consent
from diffbotctl.runs.build_graph import build_block

SPEED_WANDER_RATIO = 0.35  # of the noise that odometry assumes for the speeds on a floor
SLOT_SD_MAX_PITCHES = 0.015  # half of the usual cutting error; above, a disc is not learned
NO_EDGE_TIMES = "the board does not report edge times: set `board: {edge_times: true}`"
RATED_SPEED_RATIO = 0.75  # of the slower motor; at lower speeds the motor ripple is larger
STEADY_TIME_S = 10.0  # in each direction
RAMP = ((0.3, 0.4), (0.3, 0.7))  # s, ratio of the speed
EDGES_PER_FRAME_MAX = 0.8  # so that the time of each edge is reported
TURNS_MARGIN = 1.3  # times the expected turns
REPORTED_ERROR_MIN_PITCHES = 0.05
MOTOR_RIPPLE_SD_PITCHES = 0.007  # ripple in phase with the wheel looks like slot errors


class LearnedDisc(NamedTuple):
    """The slots of one disc, in the order of forward rotation from an arbitrary slot."""

    forward: tuple[float, ...]
    """(slots,): pitches, position error of each edge; the mean is 0"""
    backward: tuple[float, ...]
    """(slots,): likewise for the edges seen in backward motion, about their own mean; empty if not
    learned. The distance of the two means (the slot duty) is unknown: it depends on one reversal"""
    sd: float
    """pitches, standard deviation of a position"""


class LearningWheel(WheelOdometer):
    """A wheel that learns both edges of each slot for as long as it turns."""

    __slots__ = ()

    def start_learning(self, slots: int) -> LearningWheel:
        """Replace what is known of the disc by wide priors."""
        self.filter.known_edges = None
        del self.filter.hypotheses[1:]  # at a steady speed the kind of motor does not matter
        motion = self.filter.motion
        priors = motion.priors
        motion.priors = priors._replace(
            model_noise=SPEED_WANDER_RATIO * priors.model_noise, gain_drift=0.0, change_cost=inf
        )
        motion.disc = SlotErrors(
            slots, priors.slot, priors.open_share, priors.open_share_error, learns_backward=True
        )
        return self

    def learned_disc(self) -> LearnedDisc:
        """The disc as learned so far. Raises ValueError with the reason if that is too little."""
        disc = self.filter.motion.disc
        assert isinstance(disc, SlotErrors)
        forward, sd = _about_mean(disc, range(disc.slots))
        if sd > SLOT_SD_MAX_PITCHES:
            raise ValueError(
                f"positions are known to {sd:.1%} of a pitch only; let the wheel turn a few "
                "more times"
            )
        backward, backward_sd = _about_mean(disc, range(disc.slots, 2 * disc.slots))
        if backward_sd > SLOT_SD_MAX_PITCHES:
            return LearnedDisc(forward, (), sd)
        return LearnedDisc(forward, backward, max(sd, backward_sd))


class DiscLearner(OdometryBlock):
    """Odometry that learns the discs of both wheels."""

    def _start(self, encoders: Encoders) -> tuple[WheelOdometer, WheelOdometer]:
        timing = LinkTiming(0.0, 0.0, has_edge_times=True)
        left = LearningWheel(self.left_side, encoders.time, encoders.left, timing)
        right = LearningWheel(self.right_side, encoders.time, encoders.right, timing)
        slots = self.left_side.encoder.slots, self.right_side.encoder.slots
        return left.start_learning(slots[0]), right.start_learning(slots[1])


def learn_discs(
    odometry: DiscLearner, frames: Iterable[Encoders]
) -> tuple[LearnedDisc, LearnedDisc]:
    """The discs of the left and the right wheel.

    Raises ValueError with the reason if the frames are not sufficient.
    """
    boot = None
    for frame in frames:
        if boot is not None and frame.boot != boot:
            raise ValueError("the board restarted meanwhile, and the discs may have turned")
        boot = frame.boot
        odometry.react(frame.time, frame)
    if odometry.wheels is None:
        raise ValueError("the board reported no counts")
    discs = []
    for side, wheel in zip(SIDES, odometry.wheels, strict=True):
        assert isinstance(wheel, LearningWheel)
        try:
            discs.append(wheel.learned_disc())
        except ValueError as error:
            raise ValueError(f"{side} wheel: {error}") from None
    return discs[0], discs[1]


def _about_mean(disc: SlotErrors, entries: Sequence[int]) -> tuple[tuple[float, ...], float]:
    """Errors of some entries relative to their mean, and their standard deviation."""
    errors = [disc.errors[entry] for entry in entries]
    mean = fmean(errors)
    row_means = [fmean(disc.row(6 + row)[entry] for entry in entries) for row in entries]
    trace = sum(map(disc.variance_of, entries))
    variance = trace / len(errors) - fmean(row_means)
    return tuple(error - mean for error in errors), sqrt(max(variance, 0.0))


@dataclass(frozen=True, slots=True)
class DiscStep:
    """The step: `seconds` of steady rotation in each direction."""

    seconds: float = STEADY_TIME_S
    name: str = "discs"
    title: str = "the slot positions of both encoder discs"
    lifted: bool = True

    def questions(self, robot: Robot) -> Sequence[ExpectedQuestion]:
        """Consent alone."""
        return [ExpectedQuestion(motion_consent(self.name))]

    def run(self, session: RobotSession) -> StepRun:
        """Turn both wheels forward, then backward; learn the discs from the edge times."""
        robot = session.file.robot
        if robot.link.protocol == "rosserial" or not robot.board.edge_times:
            raise _error(NO_EDGE_TIMES, "then run this step again")
        session.connect()
        speed = turning_speed(robot)
        turns = TURNS_MARGIN * (self.seconds + 1.0) * speed / (2 * pi)
        yield MotionNotice(
            self.name,
            f"The wheels must be off the ground. Both turn forward and then backward, for "
            f"{self.seconds:g} s each, at {speed / (2 * pi):.1f} turns per second.",
            turns=turns,
        )
        frames, volts = [session.latest_frame()], None
        for number, sign in enumerate((1.0, -1.0)):
            yield StepProgress("turning", number, 2)
            for seconds, ratio in (*RAMP, (self.seconds, 1.0)):
                duty = turning_duty(session.now, robot, sign * ratio * speed)
                received = session.run_for(duty, seconds)
                frames += received.encoders
                volts = next((battery.volts for battery in received.of(Battery)), volts)
            frames += session.stop_and_wait().encoders
        learner = build_block(DiscLearner, robot)
        learner.reset()
        try:
            discs = dict(zip(SIDES, learn_discs(learner, frames), strict=True))
        except ValueError as error:
            fix = "are the wheels off the ground, and did `calibrate encoders` find no fault?"
            raise _error(str(error), fix) from error
        return Outcome("discs", list(_findings(discs)), list(_report(discs)), volts=volts)


def _error(cause: str, fix: str) -> RunError:
    return RunError(Problem("E-CALIBRATE-ROBOT", "discs", cause, fix))


def turning_speed(robot: Robot) -> float:
    """The speed (rad/s) at which both wheels turn steadily, and each edge time is reported."""
    sides = drive_sides(robot).values()
    motor_limit = RATED_SPEED_RATIO * min(side.motor.rated for side in sides)
    slots = max(side.encoder.slots for side in sides)
    return float(min(motor_limit, EDGES_PER_FRAME_MAX * robot.board.telemetry * 2 * pi / slots))


def turning_duty(time: int, robot: Robot, speed: float) -> Duty:
    """The duties at which both wheels turn at about `speed` (rad/s, not 0)."""
    left, right = (speed_gains(side.motor).duty(speed) for side in drive_sides(robot).values())
    return Duty(time, left, right)


def _findings(discs: dict[str, LearnedDisc]) -> Iterator[Finding]:
    for side, disc in discs.items():
        sd = sqrt(disc.sd**2 + MOTOR_RIPPLE_SD_PITCHES**2)
        yield Finding(f"drive.{side}.encoder.slot_errors", disc.forward, sd)
        if disc.backward:
            yield Finding(f"drive.{side}.encoder.back_errors", disc.backward, sd)


def _report(discs: dict[str, LearnedDisc]) -> Iterator[str]:
    for side, disc in discs.items():
        errors = disc.forward
        spread = sqrt(sum(error * error for error in errors) / len(errors))
        large = sum(abs(error) > REPORTED_ERROR_MIN_PITCHES for error in errors)
        named = f"; {large} of them more than {REPORTED_ERROR_MIN_PITCHES:.0%}" if large else ""
        yield (
            f"{side} disc: the {len(errors)} slots are {spread:.1%} of a pitch off{named}; "
            f"uncertainty {disc.sd:.1%}"
        )
