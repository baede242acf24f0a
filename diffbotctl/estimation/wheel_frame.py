"""A frame of the board for one wheel: what it shows, the duty of the motor, the sign of the count.

The board counts the edges of a single-channel encoder with the sign of its command. A wheel still
rolls on when the sign changes, so the count of such a frame is the difference of the edges before
and after the change: pairs of them cancel, and only whether their number is even or odd remains.
The board of the book counts forward at a command of zero too.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import NamedTuple

from diffbotctl.control.speed_loop import SpeedGains, limit_duty
from diffbotctl.messages import Encoders

COMMAND_SDS = 2.0  # by which a command may take effect later than estimated


class BoardFrame(NamedTuple):
    """What a frame of the board states of one wheel. Times in ns, commands rad/s or duties."""

    time: int
    edge_count: int
    edge_time: int | None  # of the last edge; None for a board that does not report edge times
    command: float
    command_since: int  # when it took effect
    is_duty: bool = False
    reported_duty: float | None = None  # of the motor at its end, if the board reports it
    skipped: tuple[int, float] | None = None
    """time and value of the command before, where no frame showed it"""
    has_counted_level: bool | None = None
    """whether the pin has the level to which a counted edge leads; None: not reported"""
    is_other_driven: bool = False
    """whether the other wheel, which may drag this one along, has a command"""

    @property
    def commands(self) -> tuple[float, ...]:
        """All commands of the frame, in their order."""
        return (self.command,) if self.skipped is None else (self.skipped[1], self.command)


Levels = tuple[bool | None, bool | None]  # `has_counted_level` of the left and the right wheel


def wheel_frames(encoders: Encoders, since: int, levels: Levels) -> tuple[BoardFrame, BoardFrame]:
    """What `encoders` states of the left and the right wheel; its command took effect at `since`
    (ns)."""
    time, is_duty = encoders.time, encoders.command_kind == "duty"
    left, right, skipped = encoders.left_command, encoders.right_command, None
    other_skipped, at = None, encoders.skipped_command_time
    if at is not None:
        skipped = at, encoders.skipped_left_command
        other_skipped = at, encoders.skipped_right_command
    of_left = encoders.left, encoders.left_edge, left, since, is_duty, encoders.left_duty
    of_right = encoders.right, encoders.right_edge, right, since, is_duty, encoders.right_duty
    return (
        BoardFrame(time, *of_left, skipped, levels[0], bool(right)),
        BoardFrame(time, *of_right, other_skipped, levels[1], bool(left)),
    )


class DriveChange(NamedTuple):
    """A command of a wheel and when it took effect; as in a WheelFrame."""

    time: int
    drive: float
    duty: float


class WheelFrame(NamedTuple):
    """The same as the filter of a wheel takes it."""

    time: int
    edge_count: int
    edge_time: int | None
    drive: float  # pitches/s at which the commanded motor settles
    drive_since: int | None  # ns, when that command took effect, if known
    duty: float  # of that command
    skipped: DriveChange | None = None
    is_mixed: bool = False
    """whether edges of both signs may have been counted, of which pairs cancel"""
    has_counted_level: bool | None = None


class MotorDuty:
    """The duty of one motor, -1 to 1, by the commands and reports of its board.

    The speed loop of a board adds to the feed-forward of its target what the wheel needs besides,
    which every second frame reports. Between two reports that is taken to stay. As in the loop, a
    target that starts, stops or reverses the wheel ends it, and the duty is never against the
    target. Without any report it is the feed-forward of the commands.
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
        if target * self.target <= 0.0:
            self.addition = 0.0
        self.target = target
        return limit_duty(self.gains.duty(target) + self.addition, target)


class CountSign:
    """Follows the sign of one wheel's counts."""

    __slots__ = ("changed_until", "margin", "sign", "zero_is_forward")

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
