"""How often something may be done: so many at once, and so many a second in the long run."""

from __future__ import annotations


class Pace:
    """A purse that fills with `rate` coins a second up to `most`."""

    def __init__(self, rate: float, most: float, now: float) -> None:
        self.rate = rate
        self.most = most
        self.saved = most
        self.at = now

    def allows(self, now: float) -> bool:
        """True when one may be done at `now` (s)."""
        self.saved = min(self.saved + (now - self.at) * self.rate, self.most)
        self.at = now
        return self.saved >= 1.0

    def spend(self) -> None:
        """One was done."""
        self.saved -= 1.0
