"""Duty of one motor whose board runs a speed loop: reported by every second frame.

The loop adds to the feed-forward of its target what the wheel needs besides. Between two reports
that is taken to stay. As in the loop, a target that starts, stops or reverses the wheel ends it,
and the duty is never against the target.
"""

from __future__ import annotations

from collections.abc import Iterable

from diffbotctl.control.speed_loop import SpeedGains, limit_duty


class MotorDuty:
    """The duty of one motor, -1 to 1, by the commands and reports of its board.

    Without any report it is the feed-forward of the commands.
    """

    __slots__ = ("addition", "gains", "target")

    def __init__(self, gains: SpeedGains) -> None:
        self.gains = gains
        self.target = 0.0  # rad/s
        self.addition = 0.0  # duty, of the loop

    def update(
        self, commands: Iterable[float], is_duty: bool, reported: float | None
    ) -> list[float]:
        """Apply one frame: the duty from each of its `commands` on (rad/s, or `is_duty`), and at
        its end the one `reported`, if it is."""
        if is_duty:
            self.target = 0.0  # the loop begins from rest after it
            return list(commands)
        duties = [self._command(target) for target in commands]
        if reported is not None:
            self.addition = reported - self.gains.duty(self.target)
            duties[-1] = reported
        return duties

    def _command(self, target: float) -> float:
        """The duty with this target."""
        if target * self.target <= 0.0:
            self.addition = 0.0
        self.target = target
        return limit_duty(self.gains.duty(target) + self.addition, target)
