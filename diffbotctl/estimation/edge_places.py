"""Where a slotted disc has its edges, and the wheel after one of them.

z is the position of the disc under the light barrier in pitches. Turning forward, the board counts
an edge at each whole z; turning backward, at each whole z plus the open share of the pitch.
"""

from __future__ import annotations

OPEN_SHARE = 0.5  # of the pitch; mean of all discs


def edge_place(slot: int, direction: int) -> float:
    """Nominal z of the edge of `slot` that is counted in `direction` (1 or -1)."""
    return slot + (OPEN_SHARE if direction < 0 else 0.0)


def bounds(place: float, direction: int, is_reversed: bool) -> tuple[float, float]:
    """Range of z after an edge at `place` that was passed in `direction`.

    After a reversal the next edge may be either edge of the slot, which narrows the range.
    """
    if direction > 0:
        return place - (1.0 - OPEN_SHARE if is_reversed else 0.0), place + 1.0
    return place - 1.0, place + (1.0 - OPEN_SHARE if is_reversed else 0.0)
