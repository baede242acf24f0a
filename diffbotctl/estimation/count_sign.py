"""The sign with which a board counts the edges of a single-channel encoder: that of its command.

A wheel still rolls on when the sign changes, so the count of such a frame is the difference of the
edges before and after the change: pairs of them cancel, and only whether their number is even or
odd remains. The board of the book counts forward at a command of zero too.
"""

from __future__ import annotations

COMMAND_SDS = 2.0  # by which a command may take effect later than estimated


class CountSign:
    """Follows the sign of one wheel's counts."""

    def __init__(self, command_time: float, zero_is_forward: bool) -> None:
        """`command_time`: standard deviation (s) of the time at which a command takes effect.
        `zero_is_forward`: whether the board counts forward at a command of zero; otherwise it keeps
        its sign."""
        self.sign = 1
        self.margin = int(COMMAND_SDS * command_time * 1e9)
        self.zero_is_forward = zero_is_forward
        self.changed_until: int | None = None
        """ns, until which the last change may have taken effect"""

    def update(self, begin: int, command: float, since: int, steps: int) -> bool:
        """Whether edges may cancel in the `steps` of a frame that began at `begin` (ns), with
        `command` in effect since `since` (ns)."""
        before = self.sign
        if command or self.zero_is_forward:
            self.sign = -1 if command < 0.0 else 1
        if self.sign != before:
            self.changed_until = since + self.margin
        if self.changed_until is not None and self.changed_until > begin:
            return True
        return steps * self.sign < 0  # the sign has changed earlier or later than estimated
