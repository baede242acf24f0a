"""`calibrate geometry --how straight`: the wheels' ratio alone, from runs along a string both ways.

A robot whose right wheel is larger curves left by beta along a way L, and ends L beta / 2 beside
the string. A string that is not quite where the robot looks shows with the other sign when it is
followed from the other end, so the mean of both is the wheels' alone.
"""

from __future__ import annotations

from collections.abc import Generator
from dataclasses import dataclass
from typing import Any

from diffbotctl.calibrate import autonomous_drive, umbmark
from diffbotctl.calibrate.confidence import robust_mean
from diffbotctl.calibrate.result import LEFT_DIAMETER, RIGHT_DIAMETER, Finding
from diffbotctl.calibrate.session import RobotSession
from diffbotctl.calibrate.step import Event, MarkFloor, MotionNotice, Outcome, Running, StepProgress
from diffbotctl.calibrate.steps.squares import stated_geometry
from diffbotctl.calibrate.umbmark import Angles
from diffbotctl.prompts.question import Question

REPEATS = 4  # there and back
REACH_MARGIN_RATIO = 0.25  # of the way: what a wrong wheel size may add
OFFSET_SD_M = 0.001  # m: what a rule beside a string tells
MM = 1000.0


@dataclass(frozen=True, slots=True)
class StraightStep:
    """The step: `repeats` runs of `metres` each way."""

    metres: float = 1.0
    repeats: int = REPEATS
    name: str = "geometry"
    title: str = "the wheels' ratio, by straight runs both ways"
    lifted: bool = False

    def run(self, rig: RobotSession) -> Running:
        """Run along the string, have the offset read, from the other end; as often as wanted."""
        rig.meet()
        reach = self.metres * (1 + REACH_MARGIN_RATIO)
        yield MotionNotice(
            f"Stretch a string of {self.metres:g} m on the floor. The robot drives along it, "
            f"{self.repeats} times from each end, and never further than {reach:.2f} m.",
            reach=reach,
        )
        offsets: dict[str, list[float]] = {"one": [], "other": []}
        for number in range(self.repeats):
            for end, found in offsets.items():
                yield StepProgress("along the string", len(found), 2 * self.repeats)
                found.append((yield from self._once(rig, end, reach, number)))
        there, back = (robust_mean(each, OFFSET_SD_M) for each in offsets.values())
        offset = (there.value + back.value) / 2
        sd = (there.sd**2 + back.sd**2) ** 0.5 / 2
        return self._outcome(rig, offset, sd)

    def _once(
        self, rig: RobotSession, end: str, reach: float, number: int
    ) -> Generator[Event, Any, float]:
        yield MarkFloor(
            f"Run {number + 1} of {self.repeats} from the {end} end: put the robot on the string, "
            "its middle above it, looking along it."
        )
        pose = autonomous_drive.drive_to(rig, [(self.metres, 0.0, None)], reach)
        answer = yield Question(
            "geometry.left",
            "How far to the left of the string did it end? To the right is less than 0.",
            unit="m",
            written="mm",
            least=-self.metres / 2,
            most=self.metres / 2,
            why="no robot leaves a string so far",
            quantity="left",
        )
        return float(answer) - pose.y

    def _outcome(self, rig: RobotSession, offset: float, sd: float) -> Outcome:
        used = stated_geometry(rig)
        beta, beta_sd = 2 * offset / self.metres, 2 * sd / self.metres
        found = umbmark.correct_geometry(used, self.metres, Angles(0.0, beta))
        ratio_sd = used.track / self.metres * beta_sd
        findings = [
            Finding(RIGHT_DIAMETER, found.right, found.right * ratio_sd / 2),
            Finding(LEFT_DIAMETER, found.left, found.left * ratio_sd / 2),
        ]
        lines = [
            f"it ends {offset * MM:+.1f} mm beside the string after {self.metres:g} m, "
            f"+- {2 * sd * MM:.1f} mm",
            f"Ed, right over left: {used.ratio:.5f} before, {found.ratio:.5f} found, "
            f"+- {2 * ratio_sd:.5f} (95 %)",
        ]
        return Outcome("straight", findings, lines)
