"""Where the slots of both encoders' discs lie, learnt from what the board told of a drive.

It is what odometry does while it drives (`estimation/slot_errors.py`), with two differences: the
flanks that are seen going backward are learnt slot by slot too, and it never leaves off learning.
Any recording will do in which the wheels turn a few times each way; lifted wheels are best.

`calibrate discs`: where the slots of both encoders' discs lie, from lifted wheels that turn.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from math import pi, sqrt
from statistics import fmean
from typing import NamedTuple

from diffbotctl.blocks.odometry import OdometryBlock
from diffbotctl.calibrate.result import Finding
from diffbotctl.calibrate.session import RobotSession
from diffbotctl.calibrate.step import MotionNotice, Outcome, Running, StepProgress
from diffbotctl.config.robot import Robot
from diffbotctl.errors import Problem, RunError
from diffbotctl.estimation.slot_errors import SlotErrors
from diffbotctl.estimation.wheel_odometer import LinkTiming, WheelOdometer
from diffbotctl.messages import Battery, Encoders, Wheels

SPEED_WANDER_RATIO = (
    0.35  # of what odometry expects the wheels' speeds to wander: nothing gets in their way
)
SLOT_SD_MAX_PITCHES = (
    0.015  # pitches: half of what slots are usually cut to; less sure than this is not learnt
)
NO_EDGE_TIMES = "the board does not tell when edges came: set `board: {edge_times: true}`"


class LearntDisc(NamedTuple):
    """One wheel's disc, its slots in the order of turning forward from an unknown one."""

    forward: tuple[float, ...]
    """(slots,): pitches, how far each flank lies from its even place, on average nothing"""
    backward: tuple[float, ...]
    """the same of the flanks seen going backward, about the mean of these; empty: not learnt.
    How far apart both means lie, the open share, is not told: that hangs on a single reversal"""
    sd: float
    """pitches, of a place, one standard deviation"""


class LearningWheel(WheelOdometer):
    """A wheel whose both flanks are learnt, for as long as it turns."""

    __slots__ = ()

    def learn(self, slots: int) -> LearningWheel:
        """Begin to."""
        self.filter.known_edges = None  # what was learnt before is not leant on
        motion = self.filter.motion
        priors = motion.priors
        motion.priors = priors._replace(model_noise=SPEED_WANDER_RATIO * priors.model_noise)
        motion.disc = SlotErrors(
            slots, priors.slot, priors.open_share, priors.open_share_error, learns_backward=True
        )
        return self

    def disc(self) -> LearntDisc:
        """What is learnt so far. Raises ValueError with the reason when that is too little."""
        places = self.filter.motion.disc
        assert isinstance(places, SlotErrors)
        slots = places.slots
        forward, sd = _centred(places, range(slots))
        if sd > SLOT_SD_MAX_PITCHES:
            raise ValueError(
                f"places are known to {sd:.1%} of a pitch only; let the wheel turn a few times more"
            )
        backward, doubt = _centred(places, range(slots, 2 * slots))
        if doubt > SLOT_SD_MAX_PITCHES:
            return LearntDisc(forward, (), sd)
        return LearntDisc(forward, backward, max(sd, doubt))


class DiscLearner(OdometryBlock):
    """Odometry that learns the discs of both wheels."""

    def _start(self, encoders: Encoders) -> tuple[WheelOdometer, WheelOdometer]:
        timing = LinkTiming(0.0, 0.0, has_edge_times=True)
        left = LearningWheel(self.left_side, encoders.time, encoders.left, timing)
        right = LearningWheel(self.right_side, encoders.time, encoders.right, timing)
        return left.learn(self.left_side.encoder.slots), right.learn(self.right_side.encoder.slots)


def learn_discs(odometry: DiscLearner, frames: Iterable[Encoders]) -> tuple[LearntDisc, LearntDisc]:
    """The discs of the left and the right wheel.

    Raises ValueError with the reason when the frames do not tell them.
    """
    boot = None
    for frame in frames:
        if boot is not None and frame.boot != boot:
            raise ValueError("the board restarted meanwhile, and the discs may have turned")
        boot = frame.boot
        odometry.react(frame.time, frame)
    if odometry.wheels is None:
        raise ValueError("the board told no counts")
    found = []
    for side, wheel in zip(("left", "right"), odometry.wheels, strict=True):
        assert isinstance(wheel, LearningWheel)
        try:
            found.append(wheel.disc())
        except ValueError as error:
            raise ValueError(f"{side} wheel: {error}") from None
    return found[0], found[1]


def _centred(places: SlotErrors, entries: Sequence[int]) -> tuple[tuple[float, ...], float]:
    """Errors of some entries about their mean, and their standard deviation."""
    errors = [places.errors[each] for each in entries]
    middle, count = fmean(errors), len(errors)
    own = [fmean(places.covariance[one][each] for each in entries) for one in entries]
    whole = fmean(own)
    variance = sum(places.covariance[each][each] for each in entries) / count - whole
    return tuple(each - middle for each in errors), sqrt(max(variance, 0.0))


RATED_SPEED_RATIO = 0.75  # of the slower motor's rated speed: slower, the motors' ripple hides more
STEADY_TIME_S = 10.0  # s at that speed each way
RAMP = ((0.3, 0.4), (0.3, 0.7))  # s, share of the speed
EDGES_PER_FRAME_MAX = 0.8  # edges between two frames at most, so that each one's time is told
TURNS_MARGIN = 1.3  # times the turns that are expected
REPORTED_ERROR_MIN_PITCHES = 0.05  # pitches; a slot that is off by more is named
MOTOR_RIPPLE_SD_PITCHES = (
    0.007  # pitches: the motor's ripple goes round with the wheel and passes for slots
)


@dataclass(frozen=True, slots=True)
class DiscStep:
    """The step: `seconds` of steady turning each way."""

    seconds: float = STEADY_TIME_S
    name: str = "discs"
    title: str = "where the slots of both discs lie"
    lifted: bool = True

    def run(self, rig: RobotSession) -> Running:
        """Turn both wheels forward, and then backward; learn the discs from the edges' times."""
        robot = rig.file.robot
        if robot.link.protocol == "rosserial" or not robot.board.edge_times:
            raise RunError(
                Problem("E-CALIBRATE-ROBOT", "discs", NO_EDGE_TIMES, "then run it again")
            )
        rig.meet()
        speed = turning_speed(robot)
        turns = TURNS_MARGIN * (self.seconds + 1.0) * speed / (2 * pi)
        yield MotionNotice(
            f"Wheels off the ground. Both turn forward and then backward, for {self.seconds:g} s "
            f"each, at {speed / (2 * pi):.1f} turns a second.",
            turns=turns,
        )
        frames, volts = [rig.latest()], None
        for number, way in enumerate((1.0, -1.0)):
            yield StepProgress("turning", number, 2)
            for seconds, share in (*RAMP, (self.seconds, 1.0)):
                held = way * share * speed
                heard = rig.hold(Wheels(rig.now, held, held), seconds)
                frames += heard.encoders
                volts = next((each.volts for each in heard.of(Battery)), volts)
            frames += rig.rest().encoders
        found = self._learnt(robot, frames)
        return Outcome("discs", list(_findings(found)), list(_report(found)), volts=volts)

    def _learnt(self, robot: Robot, frames: list[Encoders]) -> tuple[LearntDisc, LearntDisc]:
        try:
            return learn_discs(disc_learner(robot), frames)
        except ValueError as error:
            fix = "are the wheels off the ground, and did `calibrate encoders` find no fault?"
            raise RunError(Problem("E-CALIBRATE-ROBOT", "discs", str(error), fix)) from error


def disc_learner(robot: Robot) -> DiscLearner:
    """The odometry that learns the discs of `robot`."""
    drive, link = robot.drive, robot.link
    made = DiscLearner(
        command_delay=link.command_delay,
        command_jitter=link.command_jitter,
        stamp_jitter=link.stamp_jitter,
        telemetry=robot.board.telemetry,
        edge_times=robot.board.edge_times,
        track=drive.track,
        left_side=drive.left,
        right_side=drive.right,
    )
    made.reset()
    return made


def turning_speed(robot: Robot) -> float:
    """rad/s at which both wheels turn steadily, and each edge's time arrives."""
    sides = (robot.drive.left, robot.drive.right)
    by_motor = RATED_SPEED_RATIO * min(side.motor.rated for side in sides)
    slots = max(side.encoder.slots for side in sides)
    return float(min(by_motor, EDGES_PER_FRAME_MAX * robot.board.telemetry * 2 * pi / slots))


def _findings(discs: tuple[LearntDisc, LearntDisc]) -> Iterator[Finding]:
    for side, disc in zip(("left", "right"), discs, strict=True):
        sd = sqrt(disc.sd**2 + MOTOR_RIPPLE_SD_PITCHES**2)
        yield Finding(f"drive.{side}.encoder.slot_errors", disc.forward, sd)
        if disc.backward:
            yield Finding(f"drive.{side}.encoder.back_errors", disc.backward, sd)


def _report(discs: tuple[LearntDisc, LearntDisc]) -> Iterator[str]:
    for side, disc in zip(("left", "right"), discs, strict=True):
        errors = disc.forward
        spread = sqrt(sum(each * each for each in errors) / len(errors))
        far = [
            number for number, each in enumerate(errors) if abs(each) > REPORTED_ERROR_MIN_PITCHES
        ]
        named = f"; {len(far)} of them by more than {REPORTED_ERROR_MIN_PITCHES:.0%}" if far else ""
        yield (
            f"{side} disc: {len(errors)} slots lie {spread:.1%} of a pitch from their even places"
            f"{named}; known to {disc.sd:.1%}"
        )
