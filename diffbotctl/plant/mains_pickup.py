"""An encoder's wire that tells nothing of its wheel: a dead light barrier, or a wire that is off.

The firmware's inputs have no pull-up, so a wire that hangs in the air picks up the mains.
"""

from __future__ import annotations

from random import Random

from diffbotctl.plant.wheel import LevelChange

MAINS = 20_000_000  # ns; one period of 50 Hz
HIGH = MAINS // 4  # ns that the pin is high in each: its threshold lies above the middle
TREMBLE = 1_000_000  # ns, standard deviation: no pick-up is quite regular


class MainsPickup:
    """What a pin does without any wheel; nothing at all when `chance` is None."""

    def __init__(self, chance: Random | None) -> None:
        self._chance = chance
        self._rise = 0 if chance is None else chance.randrange(MAINS)
        self._fall: int | None = None

    def changes(self, until: int) -> list[LevelChange]:
        """All that the pin did since the last call, until `until`."""
        found: list[LevelChange] = []
        if self._chance is None:
            return found
        while True:
            if self._fall is not None:
                if self._fall > until:
                    return found
                found.append(LevelChange(self._fall, 0))
                self._fall = None
            if self._rise > until:
                return found
            found.append(LevelChange(self._rise, 1))
            self._fall = self._rise + HIGH
            wait = MAINS + int(self._chance.gauss(0.0, TREMBLE))
            self._rise += max(wait, MAINS // 2)
