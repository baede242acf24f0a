"""The two wheels' speeds on their way to a rosserial board: always as a pair, newest first."""

from __future__ import annotations

import struct
from collections import deque
from math import isfinite
from typing import NamedTuple

from diffbotctl.links.rosserial_frames import encode
from diffbotctl.time import NEVER

# ns; repeated 20 times a second, since the board loses a quarter of single frames. Unevenly: a
# board whose loop takes 20 ms loses the frames that straddle two passes, and would lose the same
# one of each pair for long.
PERIODS = (41_000_000, 52_000_000, 57_000_000)
GAP_BYTES = 28  # bytes' time between two pairs of 24: the replies need room
FULL = 255  # PWM value of duty 1


class SpeedInForce(NamedTuple):
    """The duty reckoned to be in force on the board, and since when (ns; None: since ever)."""

    left: float
    right: float
    since: int | None


class SpeedSender:
    """What is wanted, what was sent, and what of it is in force by now.

    The board echoes nothing: a command is reckoned to take hold `delay` ns after it was sent.
    `byte_time` is what a byte takes on the wire, in ns.
    """

    def __init__(self, delay: int, byte_time: int) -> None:
        self.delay = delay
        self.gap = GAP_BYTES * byte_time
        self.wanted = (0, 0)
        self.due = NEVER
        self._sent_at = -NEVER
        self._turn = 0
        self._sent: deque[tuple[int, int, int]] = deque([(-NEVER, 0, 0)])

    def want(self, now: int, left: float, right: float) -> None:
        """Replace what waits by these duties, -1 to 1; what is not a number is 0."""
        pair = (_pwm(left), _pwm(right))
        if pair != self.wanted:
            self.wanted = pair
            self.due = min(self.due, max(now, self._sent_at + self.gap))

    def hurry(self, now: int) -> None:
        """Send again as soon as possible."""
        self.due = now

    def take(self, now: int, numbers: tuple[int, int], moving: bool, hurried: bool) -> bytes:
        """The pair to write now, for the board's topics `numbers`; zeros unless `moving`. The next
        is due after the usual period, or `hurried` as soon as the wire is free."""
        left, right = self.wanted if moving else (0, 0)
        self._turn = (self._turn + 1) % len(PERIODS)
        self._sent_at = now
        self.due = now + (self.gap if hurried else PERIODS[self._turn])
        if (left, right) != self._sent[-1][1:]:
            self._sent.append((now + self.delay, left, right))
        return pair(numbers, left, right)

    def in_force(self, now: int) -> SpeedInForce:
        """By what was sent and when."""
        while len(self._sent) > 1 and self._sent[1][0] <= now:
            self._sent.popleft()
        since, left, right = self._sent[0]
        return SpeedInForce(left / FULL, right / FULL, since if since > -NEVER else None)


def pair(numbers: tuple[int, int], left: int, right: int) -> bytes:
    """Frames for both wheels, back to back: never one wheel without the other."""
    return b"".join(
        encode(number, struct.pack("<i", value))
        for number, value in zip(numbers, (left, right), strict=True)
    )


def _pwm(duty: float) -> int:
    if not isfinite(duty):
        return 0
    return round(max(-1.0, min(1.0, duty)) * FULL)
