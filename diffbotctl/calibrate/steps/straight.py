"""`calibrate geometry --how straight`: the ratio of the wheel diameters, from runs along a string.

A robot whose right wheel is larger turns left by beta along a length L, and ends L beta / 2 beside
the string. An initial heading that is not along the string changes sign when the string is followed
from its other end, so the mean of both directions is the effect of the wheels alone.
"""

from __future__ import annotations

from collections.abc import Generator, Sequence
from dataclasses import dataclass
from functools import partial
from math import hypot
from statistics import median
from typing import Any

from diffbotctl.calibrate.autonomous_drive import drive_to, reach_of
from diffbotctl.calibrate.confidence import robust_mean
from diffbotctl.calibrate.contradiction import ask_checked
from diffbotctl.calibrate.end_answers import ZeroReadings
from diffbotctl.calibrate.known_lengths import known_scale_sd, with_scale
from diffbotctl.calibrate.result import LEFT_DIAMETER, RIGHT_DIAMETER, Finding
from diffbotctl.calibrate.session import RobotSession
from diffbotctl.calibrate.step import Event, Outcome, StepProgress, StepRun, marked_motion
from diffbotctl.calibrate.steps.squares import scale_report, stated_geometry
from diffbotctl.calibrate.umbmark import Angles, correct_geometry
from diffbotctl.config.robot import Robot
from diffbotctl.messages import Odometry
from diffbotctl.prompts.question import (
    ExpectedQuestion,
    MarkFloor,
    MotionNotice,
    Question,
    floor_drives,
)

REPEATS = 4  # from each end
OFFSET_SD_MIN_M = 0.001  # of a ruler beside a string
FIRST_OFFSET_RATIO_MAX = 0.15  # of the way: tyres that differ by 3 %
DIFFERENCE_RATIO_MAX = 0.06  # between runs from one end; the start is in line to a degree or two
MM = 1000.0


@dataclass(frozen=True, slots=True)
class StraightStep:
    """The step: `repeats` runs of `metres` from each end."""

    metres: float = 1.0
    repeats: int = REPEATS
    name: str = "geometry"
    title: str = "the ratio of the wheel diameters, from straight runs in both directions"
    lifted: bool = False

    def questions(self, robot: Robot) -> Sequence[ExpectedQuestion]:
        """The distance from the string after each run."""
        return [
            *floor_drives(self.name, 2 * self.repeats),
            ExpectedQuestion(self._question(), 2 * self.repeats),
        ]

    def run(self, session: RobotSession) -> StepRun:
        """Drive along the string and have the offset measured, from alternating ends."""
        session.connect()
        reach = reach_of(self.metres)
        yield MotionNotice(
            self.name,
            f"Lay a taut string of {self.metres:g} m on the floor. The robot drives along it, "
            f"{self.repeats} times from each end, and at most {reach:.2f} m.",
            reach=reach,
        )
        zeros = ZeroReadings(2 * self.repeats, "the distance from the string")
        offsets: dict[str, list[float]] = {"one": [], "other": []}
        for number in range(self.repeats):
            for end, readings in offsets.items():
                yield StepProgress("along the string", len(readings), 2 * self.repeats)
                mark = MarkFloor(
                    f"Run {number + 1} of {self.repeats} from the {end} end: put the robot on the "
                    "string, with its middle above it and its front along it.",
                    f"it drives {self.metres:g} m along the string",
                )
                drive = partial(drive_to, session, [(self.metres, 0.0, None)], reach)
                pose = yield from marked_motion(session, mark, drive)
                readings.append((yield from self._offset(pose, readings, zeros)))
        there, back = (robust_mean(readings, OFFSET_SD_MIN_M) for readings in offsets.values())
        offset = (there.value + back.value) / 2
        # Half of the intervals: a few runs do not know their own spread (Student's t).
        sd = hypot(there.half_width, back.half_width) / 4
        return self._outcome(session.file.robot, offset, sd)

    def _offset(
        self, pose: Odometry, before: Sequence[float], zeros: ZeroReadings
    ) -> Generator[Event, Any, float]:
        """The measured offset (m) to the left, minus that of odometry `pose`, after one run.

        `before`: those of the runs before from this end.
        """

        def check(offset: float) -> str | None:
            usual = median(before) if before else 0.0
            limit = (DIFFERENCE_RATIO_MAX if before else FIRST_OFFSET_RATIO_MAX) * self.metres
            if abs(offset - pose.y - usual) <= limit:
                return None
            basis = "its wheels and the runs before" if before else "its wheels"
            return (
                f"By {basis} it stopped {(pose.y + usual) * MM:+.0f} mm to the left of the string, "
                f"not {offset * MM:+.0f} mm."
            )

        offset = yield from ask_checked(self._question(), check)
        zeros.add(offset)
        return offset - pose.y

    def _question(self) -> Question:
        return Question(
            "geometry.left",
            "How far to the left of the string did it stop? Right is negative.",
            unit="m",
            default_unit="mm",
            minimum=-self.metres / 2,
            maximum=self.metres / 2,
            limit_reason="the robot cannot be that far from the string",
            quantity="left",
        )

    def _outcome(self, robot: Robot, offset: float, sd: float) -> Outcome:
        used = stated_geometry(robot)
        beta, beta_sd = 2 * offset / self.metres, 2 * sd / self.metres
        fitted = correct_geometry(used, self.metres, Angles(0.0, beta))
        ratio_sd = used.track / self.metres * beta_sd
        # The runs do not change the mean diameter.
        scale_sd = known_scale_sd(robot)
        findings = [
            Finding(field, diameter, *with_scale(diameter, ratio_sd / 2, scale_sd))
            for field, diameter in ((RIGHT_DIAMETER, fitted.right), (LEFT_DIAMETER, fitted.left))
        ]
        lines = [
            f"it stops {offset * MM:+.1f} mm to the left of the string after {self.metres:g} m, "
            f"+- {2 * sd * MM:.1f} mm",
            f"E_d, right over left: {used.ratio:.5f} before, {fitted.ratio:.5f} now, "
            f"+- {2 * ratio_sd:.5f} (95 %)",
            *scale_report(robot),
        ]
        return Outcome("straight", findings, lines)
