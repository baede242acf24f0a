"""Counts of a 16-bit counter, unwrapped and believed only as far as wheels can turn."""

from __future__ import annotations

WIDTH = 1 << 16  # counts after which the counter of an AVR `int` starts again
SLACK = 3  # counts that jitter of the frames and one edge on either side may add
CONFIRMED = 3  # readings in a row that must agree before a jump counts as a new start


class Ticks:
    """Both wheels' counts. `accept` takes a reading; a jump beyond `fastest` (counts a second) is
    set aside, and becomes a new start (`boot` rises) only when the readings after it agree."""

    def __init__(self, fastest: float) -> None:
        self.fastest = fastest
        self.boot = 0
        self.counts = (0, 0)
        self.raw: tuple[int, int] | None = None
        self.time = 0
        self.aside: tuple[int, tuple[int, int], int] | None = None  # time, raw, how often agreed
        self.rejected = 0

    def accept(self, time: int, left: int, right: int) -> bool:
        """Take the raw counts at `time` (ns). True when they were believed."""
        raw = (left, right)
        if not all(-WIDTH // 2 <= count < WIDTH // 2 for count in raw):
            self.rejected += 1
            return False
        if self.raw is None:
            self.raw, self.time, self.counts = raw, time, raw
            return True
        if self._can_follow(self.time, self.raw, time, raw):
            ahead = [_steps(old, new) for old, new in zip(self.raw, raw, strict=True)]
            self.counts = (self.counts[0] + ahead[0], self.counts[1] + ahead[1])
            self.raw, self.time, self.aside = raw, time, None
            return True
        self.rejected += 1
        return self._begins_anew(time, raw)

    def _begins_anew(self, time: int, raw: tuple[int, int]) -> bool:
        agreed = 1
        if self.aside is not None and self._can_follow(self.aside[0], self.aside[1], time, raw):
            agreed = self.aside[2] + 1
        self.aside = (time, raw, agreed)
        if agreed < CONFIRMED:
            return False
        self.boot += 1
        self.raw, self.time, self.counts, self.aside = raw, time, raw, None
        return True

    def _can_follow(
        self, before: int, old: tuple[int, int], time: int, new: tuple[int, int]
    ) -> bool:
        most = self.fastest * (time - before) * 1e-9 + SLACK
        return all(abs(_steps(a, b)) <= most for a, b in zip(old, new, strict=True))


def _steps(old: int, new: int) -> int:
    """Counts from `old` to `new` the short way round the counter."""
    return (new - old + WIDTH // 2) % WIDTH - WIDTH // 2
