"""`calibrate distance`: the scale of all lengths, from a metre by the tape."""

from __future__ import annotations

from dataclasses import dataclass
from math import hypot

from diffbotctl.calibrate import autonomous_drive
from diffbotctl.calibrate.confidence import RobustMean, robust_mean
from diffbotctl.calibrate.result import LEFT_DIAMETER, RIGHT_DIAMETER, TRACK, Finding
from diffbotctl.calibrate.session import RobotSession
from diffbotctl.calibrate.step import (
    MarkFloor,
    Message,
    MotionNotice,
    Outcome,
    Running,
    StepProgress,
)
from diffbotctl.prompts.question import Question

REPEATS = 5
TAPE_SD_RATIO = 0.001  # of the distance: what a tape on the floor and an eye can tell
REACH_MARGIN_RATIO = 0.25  # of the commanded distance: what a wrong wheel size may add
READING_ERROR_RATIO_MAX = (
    0.35  # of the commanded distance that a reading may differ; more is a slip of the pen
)
MM = 1000.0


@dataclass(frozen=True, slots=True)
class DistanceStep:
    """The step: `repeats` drives of `metres`."""

    metres: float = 1.0
    repeats: int = REPEATS
    name: str = "distance"
    title: str = "the size of the wheels, by the tape"
    lifted: bool = False

    def run(self, rig: RobotSession) -> Running:
        """Drive, have it measured, again; the scale is the tape's over the odometry's."""
        rig.meet()
        reach = self.metres * (1 + REACH_MARGIN_RATIO)
        yield MotionNotice(
            f"The robot drives {self.metres:g} m straight ahead, {self.repeats} times, and never "
            f"further than {reach:.2f} m: clear so much floor before it.",
            reach=reach,
        )
        scales = []
        for number in range(self.repeats):
            yield StepProgress("metre by metre", number, self.repeats)
            yield MarkFloor("Put the robot at the start and mark the floor beside both tyres.")
            end = autonomous_drive.drive_to(rig, [(self.metres, 0.0, None)], reach)
            gone = hypot(end.x, end.y)
            reading = yield self._question(number)
            scales.append(float(reading) / gone)
            yield Message(
                f"the wheels told {gone * MM:.0f} mm, the tape {float(reading) * MM:.0f} mm"
            )
        scale = robust_mean(scales, TAPE_SD_RATIO)
        return Outcome("distance", _findings(rig, scale), self._report(rig, scale, scales))

    def _question(self, number: int) -> Question:
        return Question(
            "distance.reading",
            f"Drive {number + 1} of {self.repeats}: how far did it go, from mark to tyre, by the "
            "tape?",
            unit="m",
            written="mm",
            least=self.metres * (1 - READING_ERROR_RATIO_MAX),
            most=self.metres * (1 + READING_ERROR_RATIO_MAX),
            why="no tyre is so far off its stated size; is it millimetres?",
            quantity="distance",
        )

    def _report(self, rig: RobotSession, scale: RobustMean, scales: list[float]) -> list[str]:
        lines = [
            f"drive {number + 1} left out: {scales[number]:.4f} times, unlike the others"
            for number in scale.strays
        ]
        lines.append(
            f"the robot goes {scale.value:.4f} times as far as it believed, +- {scale.half:.4f} "
            f"(95 %), spread of one drive {scale.spread * self.metres * MM:.1f} mm"
        )
        return lines


def _findings(rig: RobotSession, scale: RobustMean) -> list[Finding]:
    """Both diameters. A track that was found by turning goes with them: what was told by turning
    is the share of track and diameter, and that stays."""
    drive = rig.file.robot.drive
    found = [
        Finding(path, side.wheel.diameter * scale.value, side.wheel.diameter * scale.sd)
        for path, side in ((RIGHT_DIAMETER, drive.right), (LEFT_DIAMETER, drive.left))
    ]
    if TRACK in rig.file.robot.calibration:
        found.append(Finding(TRACK, drive.track * scale.value, drive.track * scale.sd))
    return found
