"""Where the level of an encoder's pin says that the light barrier is.

An edge is counted where the pin goes to the counted level: forward at each whole z, backward at
each whole z plus the open share. So the pin has the counted level from each whole z to there.
Lengths are pitches.
"""

from __future__ import annotations

from math import floor
from typing import Final

ROUNDING = 1e-9  # pitches
PART_MIN = 0.25  # pitches; a shorter part of a stretch is one that the bounds only touch

COUNTED_LEVELS: Final = {"rising": 1, "falling": 0}
"""by the edge that is counted; when both are, the pin has a counted level all the time"""


def stretches(
    low: float, high: float, has_counted_level: bool, open_share: float
) -> list[tuple[float, float]]:
    """The stretches of z from `low` to `high` in which the pin has the counted level, or not."""
    begin, end = (0.0, open_share) if has_counted_level else (open_share, 1.0)
    found = []
    slot = floor(low + ROUNDING)
    while slot + begin < high:
        part = max(slot + begin, low), min(slot + end, high)
        if part[1] - part[0] > PART_MIN:
            found.append(part)
        slot += 1
    return found
