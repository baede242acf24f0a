"""An encoder's wire that tells nothing of its wheel: a dead light barrier, or a wire that is off.

The firmware's inputs have no pull-up, so a wire that hangs in the air picks up the mains.
"""

from __future__ import annotations

from random import Random

MAINS = 20_000_000  # ns; one period of 50 Hz
TREMBLE = 1_000_000  # ns, standard deviation: no pick-up is quite regular


class Hum:
    """Edges that come without any wheel; none at all when `chance` is None."""

    def __init__(self, chance: Random | None) -> None:
        self._chance = chance
        self._next = 0 if chance is None else chance.randrange(MAINS)

    def edges(self, until: int) -> list[int]:
        """The times of the edges since the last call until `until`."""
        found: list[int] = []
        if self._chance is None:
            return found
        while self._next <= until:
            found.append(self._next)
            wait = MAINS + int(self._chance.gauss(0.0, TREMBLE))
            self._next += max(wait, MAINS // 2)
        return found
