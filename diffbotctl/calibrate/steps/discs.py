"""`calibrate discs`: where the slots of both encoders' discs lie, from lifted wheels that turn."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from math import pi, sqrt

from diffbotctl.calibrate.result import Finding
from diffbotctl.calibrate.session import RobotSession
from diffbotctl.calibrate.slot_fit import NO_EDGES, Learning, LearntDisc, learn_discs
from diffbotctl.calibrate.step import MotionNotice, Outcome, Running, StepProgress
from diffbotctl.config.robot import Robot
from diffbotctl.errors import Problem, RunError
from diffbotctl.messages import Battery, Encoders, Wheels

SHARE = 0.75  # of the slower motor's rated speed: slower, the motors' ripple hides more
STEADY = 10.0  # s at that speed each way
RAMP = ((0.3, 0.4), (0.3, 0.7))  # s, share of the speed
EDGES_A_FRAME = 0.8  # edges between two frames at most, so that each one's time is told
SPARE = 1.3  # times the turns that are expected
REPORTED = 0.05  # pitches; a slot that is off by more is named
RIPPLE = 0.007  # pitches: the motor's ripple goes round with the wheel and passes for slots


@dataclass(frozen=True, slots=True)
class DiscStep:
    """The step: `seconds` of steady turning each way."""

    seconds: float = STEADY
    name: str = "discs"
    title: str = "where the slots of both discs lie"
    lifted: bool = True

    def run(self, rig: RobotSession) -> Running:
        """Turn both wheels forward, and then backward; learn the discs from the edges' times."""
        robot = rig.file.robot
        if robot.link.protocol == "rosserial" or not robot.board.edge_times:
            raise RunError(Problem("E-CALIBRATE-ROBOT", "discs", NO_EDGES, "then run it again"))
        rig.meet()
        speed = turning_speed(robot)
        turns = SPARE * (self.seconds + 1.0) * speed / (2 * pi)
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
            return learn_discs(learning(robot), frames)
        except ValueError as error:
            fix = "are the wheels off the ground, and did `calibrate encoders` find no fault?"
            raise RunError(Problem("E-CALIBRATE-ROBOT", "discs", str(error), fix)) from error


def learning(robot: Robot) -> Learning:
    """The odometry that learns the discs of `robot`."""
    drive, link = robot.drive, robot.link
    made = Learning(
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
    by_motor = SHARE * min(side.motor.rated for side in sides)
    slots = max(side.encoder.slots for side in sides)
    return float(min(by_motor, EDGES_A_FRAME * robot.board.telemetry * 2 * pi / slots))


def _findings(discs: tuple[LearntDisc, LearntDisc]) -> Iterator[Finding]:
    for side, disc in zip(("left", "right"), discs, strict=True):
        sd = sqrt(disc.sd**2 + RIPPLE**2)
        yield Finding(f"drive.{side}.encoder.slot_errors", disc.forward, sd)
        if disc.backward:
            yield Finding(f"drive.{side}.encoder.back_errors", disc.backward, sd)


def _report(discs: tuple[LearntDisc, LearntDisc]) -> Iterator[str]:
    for side, disc in zip(("left", "right"), discs, strict=True):
        errors = disc.forward
        spread = sqrt(sum(each * each for each in errors) / len(errors))
        far = [number for number, each in enumerate(errors) if abs(each) > REPORTED]
        named = f"; {len(far)} of them by more than {REPORTED:.0%}" if far else ""
        yield (
            f"{side} disc: {len(errors)} slots lie {spread:.1%} of a pitch from their even places"
            f"{named}; known to {disc.sd:.1%}"
        )
