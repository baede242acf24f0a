"""`calibrate distance`: the scale of all lengths, from straight drives measured with a tape."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from math import hypot

from diffbotctl.calibrate.autonomous_drive import drive_to, reach_of
from diffbotctl.calibrate.confidence import RobustMean, robust_mean
from diffbotctl.calibrate.contradiction import ask_checked, scale_contradiction
from diffbotctl.calibrate.known_lengths import (
    known_difference_sd,
    known_scale_sd,
    known_track_sd,
    rest_sd,
    with_scale,
)
from diffbotctl.calibrate.result import LEFT_DIAMETER, RIGHT_DIAMETER, TRACK, Finding
from diffbotctl.calibrate.session import RobotSession
from diffbotctl.calibrate.step import (
    Message,
    Outcome,
    StepProgress,
    StepRun,
    counted,
    marked_motion,
)
from diffbotctl.config.configuration import RobotFile
from diffbotctl.config.robot import Robot
from diffbotctl.errors import Problem, RunError
from diffbotctl.prompts.question import (
    ExpectedQuestion,
    MarkFloor,
    MotionNotice,
    Question,
    floor_drives,
)

REPEATS = 5
TAPE_SD_RATIO = 0.001  # of the distance
# Of the mean wheel diameter from the stated one: kit wheels, and tyres under their load, are within
# 4 %.
STATED_ERROR_MAX = 0.06
READING_ERROR_RATIO_MAX = 0.35  # of the distance; more is a mistake in writing
SCALED = "+distance"  # behind the method that found a track, whose scale this step replaces
MM = 1000.0


@dataclass(frozen=True, slots=True)
class DistanceStep:
    """The step: `repeats` drives of `metres`."""

    metres: float = 1.0
    repeats: int = REPEATS
    name: str = "distance"
    title: str = "the wheel diameters, with a tape"
    lifted: bool = False

    def questions(self, robot: Robot) -> Sequence[ExpectedQuestion]:
        """The reading of the tape after each drive."""
        return [
            *floor_drives(self.name, self.repeats),
            ExpectedQuestion(self._question(0), self.repeats),
        ]

    def run(self, session: RobotSession) -> StepRun:
        """Drive and have the distance measured, repeatedly; the scale is tape over odometry."""
        session.connect()
        reach = reach_of(self.metres)
        yield MotionNotice(
            self.name,
            f"The robot drives {self.metres:g} m straight ahead, {self.repeats} times, and at most "
            f"{reach:.2f} m: clear the floor in front of it.",
            reach=reach,
        )
        scales: list[float] = []
        for number in range(self.repeats):
            yield StepProgress("straight drives", number, self.repeats)
            start = "Put the robot at the start. Mark the floor beside both tyres."
            mark = MarkFloor(
                counted(number, self.repeats, start), f"it drives {self.metres:g} m straight ahead"
            )
            drive = partial(drive_to, session, [(self.metres, 0.0, None)], reach)
            end = yield from marked_motion(session, mark, drive)
            odometry = hypot(end.x, end.y)
            check = partial(
                scale_contradiction,
                odometry=odometry,
                scales=tuple(scales),
                scale_sd=known_scale_sd(session.file.robot),
            )
            tape = yield from ask_checked(self._question(number), check)
            scales.append(tape / odometry)
            yield Message(f"odometry: {odometry * MM:.0f} mm, tape: {tape * MM:.0f} mm")
        scale = robust_mean(scales, TAPE_SD_RATIO)
        _refuse_other_wheels(session.file, scale.value)
        common = rest_sd(session.file.robot) / self.metres
        scale = scale._replace(
            sd=hypot(scale.half_width / 2, common), half_width=hypot(scale.half_width, 2 * common)
        )
        report = [*self._report(scale, scales), *_diameter_report(session.file, scale)]
        return Outcome("distance", _findings(session.file.robot, scale), report)

    def _question(self, number: int) -> Question:
        return Question(
            "distance.reading",
            f"Drive {number + 1} of {self.repeats}: distance from the mark to the tyre?",
            unit="m",
            default_unit="mm",
            minimum=self.metres * (1 - READING_ERROR_RATIO_MAX),
            maximum=self.metres * (1 + READING_ERROR_RATIO_MAX),
            limit_reason="the wheel diameter cannot be that wrong; is the unit mm?",
            quantity="distance",
        )

    def _report(self, scale: RobustMean, scales: list[float]) -> list[str]:
        lines = [
            f"drive {number + 1} left out: scale {scales[number]:.4f} differs from the others"
            for number in scale.outliers
        ]
        lines.append(
            f"the robot goes {scale.value:.4f} times as far as odometry reports, +- "
            f"{scale.half_width:.4f} (95 %); standard deviation of one drive "
            f"{scale.spread * self.metres * MM:.1f} mm"
        )
        return lines


def _refuse_other_wheels(file: RobotFile, scale: float) -> None:
    """Raises RunError if wheels that make `scale` of their present way are none of those that the
    robot file states."""
    ratio = scale * _mean_diameter(file.robot) / _mean_diameter(file.nominal)
    if abs(ratio - 1) <= STATED_ERROR_MAX:
        return
    size = "larger" if ratio > 1 else "smaller"
    stated = _mean_diameter(file.nominal) * MM
    cause = (
        f"by the tape the wheels have {stated * ratio:.1f} mm, {100 * abs(ratio - 1):.0f} % {size} "
        f"than the {stated:.1f} mm of the robot file"
    )
    fix = (
        "measure a wheel with a ruler and the way from the mark to the tyre with another tape. If "
        "the wheel has that size, correct `diameter` in the robot file; if not, is the number of "
        "slots right? Then run this step again"
    )
    raise RunError(Problem("E-CALIBRATE-ROBOT", "distance", cause, fix))


def _diameter_report(file: RobotFile, scale: RobustMean) -> list[str]:
    stated, now = _mean_diameter(file.nominal), _mean_diameter(file.robot) * scale.value
    return [
        f"mean wheel diameter: {now * MM:.2f} mm, {100 * (now / stated - 1):+.1f} % from the "
        f"{stated * MM:.2f} mm that the robot file states"
    ]


def _mean_diameter(robot: Robot) -> float:
    return (robot.drive.left.wheel.diameter + robot.drive.right.wheel.diameter) / 2


def _findings(robot: Robot, scale: RobustMean) -> list[Finding]:
    """Both diameters. A track that was calibrated by turning is scaled with them: turning
    determines the ratio of track and diameter.

    The drives show the mean of both wheels; each may differ from it until the ratio is known.
    """
    drive = robot.drive
    lengths = {RIGHT_DIAMETER: drive.right.wheel.diameter, LEFT_DIAMETER: drive.left.wheel.diameter}
    findings = [
        Finding(
            field,
            length * scale.value,
            *with_scale(length * scale.value, known_difference_sd(robot, field), scale.sd),
        )
        for field, length in lengths.items()
    ]
    entry = robot.calibration.get(TRACK)
    if entry is not None:
        track = drive.track * scale.value
        sds = with_scale(track, known_track_sd(robot) / drive.track, scale.sd)
        method = (entry.method or "").removesuffix(SCALED)
        findings.append(Finding(TRACK, track, *sds, method=f"{method}{SCALED}" if method else ""))
    return findings
