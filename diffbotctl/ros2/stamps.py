"""Stamps of ROS messages from the logical time of a run."""

from __future__ import annotations

from collections import deque

from diffbotctl.time import SECOND

WINDOW = 10 * SECOND  # over which the least delay is taken
WINDOWS_MAX = 3


class StampClock:
    """Converts logical times into times of the ROS clock, both in ns.

    With the epoch of the run the difference of both clocks is known. Without it, it is estimated:
    a message arrives at the earliest when its time has come, so the least difference within the
    last half minute is the best estimate. It is late by the least delay of the connection, and
    follows a drift of the clocks. With `epoch` 0 the stamps are the time of the run itself.
    """

    def __init__(self, epoch: int | None = None) -> None:
        self.epoch = epoch
        self.least: deque[int] = deque(maxlen=WINDOWS_MAX)
        self.window_end = 0

    def stamp(self, logical: int, now: int) -> int:
        """The stamp of a message of the time `logical` that has arrived at `now`."""
        if self.epoch is not None:
            return self.epoch + logical
        offset = now - logical
        if now >= self.window_end:
            self.least.append(offset)
            self.window_end = now + WINDOW
        elif offset < self.least[-1]:
            self.least[-1] = offset
        return logical + min(self.least)


def seconds_and_nanoseconds(stamp: int) -> tuple[int, int]:
    """A stamp in ns as builtin_interfaces/Time has it."""
    return divmod(stamp, SECOND)


AGE_MAX = SECOND // 2
CLOCK_ERROR_MAX = SECOND // 2


def stamp_complaint(stamp: int, now: int) -> str:
    """Why a velocity with this stamp must not drive; empty when it may. 0 is no stamp."""
    if not stamp or -CLOCK_ERROR_MAX <= now - stamp <= AGE_MAX:
        return ""
    if now > stamp:
        return f"is {(now - stamp) / SECOND:.1f} s old"
    return f"has a stamp {(stamp - now) / SECOND:.1f} s in the future; compare both clocks"
