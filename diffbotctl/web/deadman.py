"""Dead-man logic of a page: which of its commands drive, and when its operator is lost.

The server numbers the moments at which it sends to a page; each command of the page echoes the
newest number that the page has. So the age of a command is known on the server's own clock, and
what piled up in a gap of the network is recognised as old. After a loss the finger must be lifted:
each press of the joystick has a number, and a press during which something was lost drives no more.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from enum import StrEnum

BEAT_PERIOD_S = 0.05  # between two numbers, and between two commands of a page
NUMBERS_MAX = 40  # that are remembered: two seconds
COMMAND_MAX_AGE_S = 0.3  # of the number that a command echoes
SILENCE_MAX_S = 0.25  # between two commands
# A command holds until its number is this old: however slow the network is, the wheels are
# commanded to zero within half a second of the moment at which the finger left the joystick.
HOLD_MAX_S = 0.4


class BeatNumbers:
    """The numbers that the server sends, with the time (s) of each."""

    def __init__(self) -> None:
        self.number = 0
        self.times: deque[tuple[int, float]] = deque(maxlen=NUMBERS_MAX)

    def next(self, now: float) -> int:
        """The next number, sent at `now`."""
        self.number += 1
        self.times.append((self.number, now))
        return self.number

    def sent_at(self, number: int) -> float | None:
        """When `number` was sent. None for one that is older than two seconds, or never was."""
        return next((time for known, time in self.times if known == number), None)


class PageLoss(StrEnum):
    """Why a page that drives can no longer be followed, as the cause of the stop words it."""

    HIDDEN = "its page was hidden"
    BLURRED = "its page lost the focus"
    CLOSED = "its page was closed"
    SILENT = "its page sent no command in time"
    LATE = "its commands came too late"


class DriveResult(StrEnum):
    """What became of a drive command."""

    DRIVES = "drives"
    ENDED = "ended"  # its press drives no more
    LATE = "late"


class EndedPresses:
    """The newest press of a device that drives no more; earlier ones do not either.

    It outlives a connection: a finger that stays down while the page connects again must be lifted.
    """

    def __init__(self) -> None:
        self.press = 0

    def add(self, press: int) -> None:
        """End `press` and earlier ones."""
        self.press = max(self.press, press)


class PageDeadman:
    """The drive commands of one page. Times are in s of one clock.

    `ended` is shared by all connections of a device. `send` sends a request to the engine.
    `on_loss` is called with the cause when the operator is lost while driving.
    """

    def __init__(
        self, ended: EndedPresses, send: Callable[..., None], on_loss: Callable[[str], None]
    ) -> None:
        self.ended = ended
        self.send = send
        self.on_loss = on_loss
        self.press = 0  # of the finger that drives
        self.deadline: float | None = None  # of the next command; None while it does not drive

    @property
    def is_driving(self) -> bool:
        """Whether the engine has a command of this page that is in force."""
        return self.deadline is not None

    def drive(
        self, now: float, press: int, sent_at: float | None, linear: float, angular: float
    ) -> DriveResult:
        """A command of `press`, which echoes a number sent at `sent_at`."""
        if press <= self.ended.press:
            return DriveResult.ENDED
        if sent_at is None or now - sent_at > COMMAND_MAX_AGE_S:
            if self.is_driving:
                self.lose(PageLoss.LATE)
            return DriveResult.LATE
        self.press = press
        self.deadline = min(now + SILENCE_MAX_S, sent_at + HOLD_MAX_S)
        self.send("drive", linear=linear, angular=angular)
        return DriveResult.DRIVES

    def release(self, press: int) -> None:
        """The finger of `press` was lifted: zero, in order."""
        if press < self.press:
            return
        self.ended.add(press)
        if self.is_driving:
            self.deadline = None
            self.send("release")

    def beat(self, now: float) -> None:
        """Notice that commands have ceased; to be called every BEAT_PERIOD_S."""
        if self.deadline is not None and now > self.deadline:
            self.lose(PageLoss.SILENT)

    def lose(self, cause: PageLoss) -> None:
        """Report to the engine that the operator is lost, if this page drives."""
        self.ended.add(self.press)
        if self.is_driving:
            self.deadline = None
            self.send("operator_lost", reason=str(cause))
            self.on_loss(cause)

    def on_refusal(self) -> None:
        """The engine did not accept a command: the finger must be lifted."""
        self.ended.add(self.press)
        self.deadline = None
