"""How far a wheel may turn: what was announced, and the error when it does not keep to it."""

from __future__ import annotations

from diffbotctl.config.robot import Robot
from diffbotctl.errors import Problem, RunError
from diffbotctl.messages import Encoders

SPARE = 1  # count; the edge that a wheel stood on


class Bound:
    """Turns that either wheel may be from where it began."""

    def __init__(self, turns: float) -> None:
        self.turns = turns
        self._from: tuple[int, int] | None = None

    def begin(self) -> None:
        """Counts start anew with the next frame."""
        self._from = None

    def check(self, frame: Encoders, robot: Robot) -> None:
        """Raises RunError when a wheel is beyond."""
        if self._from is None:
            self._from = (frame.left, frame.right)
        drive = robot.drive
        for side, count, begun in zip(
            (drive.left, drive.right), (frame.left, frame.right), self._from, strict=True
        ):
            if abs(count - begun) > self.turns * side.encoder.slots + SPARE:
                cause = f"a wheel turned more than the {self.turns:g} turns that were announced"
                raise stopped(cause, "noise on its encoder, or a wrong count of slots?")


def stopped(cause: str, fix: str) -> RunError:
    """What to raise when the robot had to be stopped."""
    return RunError(Problem("E-CALIBRATE-STOPPED", "calibrate", cause, fix))
