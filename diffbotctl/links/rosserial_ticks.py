"""One wheel's ticks as a rosserial board sends them, made whole: unwrapped, and only when credible.

The protocol's 8-bit sums let about one damaged frame in a thousand through, with a value that is
typically off by a million counts.
"""

from __future__ import annotations

from math import floor

from diffbotctl.time import SECOND

MARGIN = 1.5  # over the rated speed: a light robot on a full battery, and one bounce in two counts
SCATTER = 50_000_000  # ns; a frame's age varies by about one pass of the sketch's loop
PROMPT = 400_000_000  # ns; after a longer gap the reach is wide enough for a damaged value
SLACK = 2  # counts; the edge that is just due, and a bounce of it
INT16 = 1 << 15
WRAPS = (0, 1 << 16, -(1 << 16), 1 << 32, -(1 << 32))


class TickUnwrapper:
    """The count of one wheel.

    A value beyond what the wheel can have turned since the last accepted one is held back as a
    suspect. Only when the next one agrees with it is it believed: the board has counted anew, and
    `take` says so. The very first value needs the same confirmation, and so does the first after a
    gap, when a wheel can have turned so far that damage would pass for it.
    """

    def __init__(self, rate: float) -> None:
        """`rate`: counts/s at the wheel's rated speed."""
        self.rate = rate
        self.value = 0  # unwrapped
        self.based = False
        self.taken = self.rejected = 0  # values judged, and those held back though based
        self._last = (0, 0)  # time and raw value of the last accepted one
        self._suspect: tuple[int, int] | None = None

    def reach(self, elapsed: int) -> int:
        """The most counts that the wheel can make in `elapsed` ns."""
        return floor(self.rate * MARGIN * (elapsed + SCATTER) / SECOND) + SLACK

    def take(self, now: int, raw: int) -> str:
        """Judge a value that arrived at `now`: `counted`, `suspect`, or `anew`: counting restarted
        from another base, and `value` has nothing to do with the one before."""
        self.taken += 1
        step = self._step(self._last, now, raw) if self.based else None
        confirmed = self._suspect is not None and self._step(self._suspect, now, raw) is not None
        if step is not None and (confirmed or now - self._last[0] <= PROMPT):
            self.value += step
            self._accept(now, raw)
            return "counted"
        if confirmed:
            verdict = "anew" if self.based else "counted"
            self.based, self.value = True, raw
            self._accept(now, raw)
            return verdict
        self.rejected += self.based
        self._suspect = (now, raw)
        return "suspect"

    def rebase(self) -> None:
        """The board has restarted: start from its next two values that agree."""
        if self.based:
            self.based = False
            if self._suspect is None:
                self._suspect = self._last

    def forget(self) -> None:
        """As `rebase`, where not even the last value may count as one of the two."""
        self.based, self._suspect = False, None

    def _accept(self, now: int, raw: int) -> None:
        self._last, self._suspect = (now, raw), None

    def _step(self, since: tuple[int, int], now: int, raw: int) -> int | None:
        """Counts from an earlier value to this one, or None where the wheel cannot have made them.

        The published sketch counts in 16 bits and sends 32. A value outside 16 bits after one
        inside is no wrap of such a counter, which damage could otherwise pass for.
        """
        then, before = since
        most = self.reach(now - then)
        if most >= INT16:
            return None  # so long ago that one wrap looks like another
        for wrap in WRAPS:
            if abs(wrap) == 2 * INT16 and not (-INT16 <= raw < INT16 and -INT16 <= before < INT16):
                continue
            step = raw - before + wrap
            if abs(step) <= most:
                return step
        return None
