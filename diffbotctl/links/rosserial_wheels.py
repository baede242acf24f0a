"""The two wheels of a rosserial board: duties sent to it, always as a pair, and ticks received."""

from __future__ import annotations

import struct
from collections import deque
from enum import StrEnum, auto
from math import floor, isfinite
from typing import NamedTuple

from diffbotctl.links.rosserial_frames import encode
from diffbotctl.time import MILLISECOND, NEVER, SECOND

# Sent 20 times a second, since the board loses a quarter of single frames. The periods differ: a
# board whose loop takes 20 ms loses the frames that straddle two passes, and with a constant period
# would lose the same frame of each pair for a long time.
SEND_PERIODS = (41 * MILLISECOND, 52 * MILLISECOND, 57 * MILLISECOND)
GAP_BYTES = 28  # minimum time between two pairs, in byte times: 24 of the pair, and replies
PWM_MAX = 255  # PWM value of duty 1
RATE_MARGIN = 1.5  # light robot, full battery, one bounce per two counts
LOOP_TIME = 50 * MILLISECOND  # a count's age varies by about one pass of the sketch's loop
GAP_TIME_MAX = 400 * MILLISECOND  # after a longer gap a damaged value may be plausible
COUNT_TOLERANCE = 2  # the edge that is due, and a bounce of it
INT16 = 1 << 15
WRAPS = (0, 1 << 16, -(1 << 16), 1 << 32, -(1 << 32))


class SpeedInForce(NamedTuple):
    """Duties assumed to be in force on the board, and since when (ns; None: from the start)."""

    left: float
    right: float
    since: int | None


class SpeedSender:
    """Sends duties to both wheels and keeps track of those in force.

    The board echoes no command: it is assumed to take effect `delay` ns after it was sent.
    `byte_time` is the time of a byte on the wire, in ns.
    """

    def __init__(self, delay: int, byte_time: int) -> None:
        self.due = NEVER
        self._delay = delay
        self._gap = GAP_BYTES * byte_time
        self._target = (0, 0)
        self._sent_at = -NEVER
        self._period = 0  # index
        self._sent: deque[tuple[int, int, int]] = deque([(-NEVER, 0, 0)])
        self._moving_sent_at = -NEVER  # when a pair other than zeros was sent last

    def set_target(self, now: int, left: float, right: float) -> None:
        """Set the duties to send, -1 to 1; a value that is not finite is sent as 0."""
        target = (_pwm(left), _pwm(right))
        if target != self._target:
            self._target = target
            self.due = min(self.due, max(now, self._sent_at + self._gap))

    def send_at(self, now: int) -> None:
        """Send the next pair at `now` instead of after the usual period."""
        self.due = now

    def next_frames(self, now: int, topics: tuple[int, int], moving: bool, urgent: bool) -> bytes:
        """Pair of frames to write now, to the topic numbers `topics`; zeros unless `moving`.

        The next is due after the usual period, or when `urgent` as soon as the line is free.
        """
        left, right = self._target if moving else (0, 0)
        self._period = (self._period + 1) % len(SEND_PERIODS)
        self._sent_at = now
        if left or right:
            self._moving_sent_at = now
        self.due = now + (self._gap if urgent else SEND_PERIODS[self._period])
        if (left, right) != self._sent[-1][1:]:
            self._sent.append((now + self._delay, left, right))
        return pair_frames(topics, left, right)

    def moves_within(self, now: int, span: int) -> bool:
        """Whether a duty other than zero is the target, or was sent in the last `span` ns."""
        return self._target != (0, 0) or now - self._moving_sent_at <= span

    def in_force(self, now: int) -> SpeedInForce:
        """Duties in force at `now`, from what was sent and when."""
        while len(self._sent) > 1 and self._sent[1][0] <= now:
            self._sent.popleft()
        since, left, right = self._sent[0]
        return SpeedInForce(left / PWM_MAX, right / PWM_MAX, since if since > -NEVER else None)


def pair_frames(topics: tuple[int, int], left: int, right: int) -> bytes:
    """Frames for both wheels, back to back: the wheels are never commanded singly."""
    return b"".join(
        encode(topic, struct.pack("<i", value))
        for topic, value in zip(topics, (left, right), strict=True)
    )


def _pwm(duty: float) -> int:
    if not isfinite(duty):
        return 0
    return round(max(-1.0, min(1.0, duty)) * PWM_MAX)


class TickVerdict(StrEnum):
    """Result of `TickUnwrapper.take`."""

    COUNTED = auto()
    SUSPECT = auto()  # not counted unless the next value agrees with it
    ANEW = auto()  # counting restarted: `value` has a new base


class TickUnwrapper:
    """The count of one wheel, unwrapped, from plausible values only.

    The protocol's 8-bit sums let about one damaged frame in a thousand through, with a value that
    is typically off by a million counts. So a value beyond what the wheel can have turned since the
    last accepted one is held back as a suspect. When the next one agrees with it, both are
    accepted: the board has counted anew. The very first value needs the same confirmation, and so
    does the first after a gap, when a wheel can have turned so far that damage would pass for it.
    """

    def __init__(self, rate: float) -> None:
        """`rate`: counts/s at the wheel's rated speed."""
        self.rate = rate
        self.value = 0  # unwrapped
        self.taken = 0  # values judged
        self._based = False  # `_last` is a value to count from
        self._last = (0, 0)  # time and raw value of the last accepted one
        self._suspect: tuple[int, int] | None = None

    def reach(self, elapsed: int) -> int:
        """Maximum counts of the wheel in `elapsed` ns."""
        return floor(self.rate * RATE_MARGIN * (elapsed + LOOP_TIME) / SECOND) + COUNT_TOLERANCE

    def take(self, now: int, raw: int) -> TickVerdict:
        """Check and count a value that arrived at `now`."""
        self.taken += 1
        step = self._step(self._last, now, raw) if self._based else None
        confirmed = self._suspect is not None and self._step(self._suspect, now, raw) is not None
        if step is not None and (confirmed or now - self._last[0] <= GAP_TIME_MAX):
            self.value += step
            self._accept(now, raw)
            return TickVerdict.COUNTED
        if confirmed:
            verdict = TickVerdict.ANEW if self._based else TickVerdict.COUNTED
            self._based, self.value = True, raw
            self._accept(now, raw)
            return verdict
        self._suspect = (now, raw)
        return TickVerdict.SUSPECT

    def rebase(self) -> None:
        """The board has restarted: count from its next two values that agree."""
        if self._based:
            self._based = False
            if self._suspect is None:
                self._suspect = self._last

    def forget(self) -> None:
        """As `rebase`, but the last value is not one of the two."""
        self._based, self._suspect = False, None

    def _accept(self, now: int, raw: int) -> None:
        self._last, self._suspect = (now, raw), None

    def _step(self, since: tuple[int, int], now: int, raw: int) -> int | None:
        """Counts from an earlier value to this one; None when the wheel cannot have made them.

        The published sketch counts in 16 bits and sends 32. A value outside 16 bits after one
        inside is no wrap of such a counter; damage could otherwise look like one.
        """
        then, before = since
        reach = self.reach(now - then)
        if reach >= INT16:
            return None  # so long ago that one wrap looks like another
        for wrap in WRAPS:
            if abs(wrap) == 2 * INT16 and not (-INT16 <= raw < INT16 and -INT16 <= before < INT16):
                continue
            step = raw - before + wrap
            if abs(step) <= reach:
                return step
        return None
