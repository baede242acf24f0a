"""The board's time in the host's time, from nothing but frames and their arrivals.

A frame can be late but never early, so the true offset lies below every measured one. The map is a
line under all measurements: that edge of their lower convex hull which spans the middle of the
window. It is the line with the least sum of distances (Moon, Skelly and Towsley, "Estimation and
removal of clock skew from network delay measurements", INFOCOM 1999).
"""

from __future__ import annotations

from collections import deque

WINDOW = 30_000_000_000  # ns of board time that the line is laid through
SHORTEST = 1_000_000_000  # ns; below, the delays' scatter would pass for drift
MOST_DRIFT = 0.01  # a ceramic resonator is within half of that


class BoardClock:
    """Maps ns of board time, unwrapped, to ns of host time."""

    def __init__(self) -> None:
        self._hull: deque[tuple[int, int]] = deque()
        self._origin = 0
        self._offset = 0
        self._drift = 0.0

    @property
    def known(self) -> bool:
        """True once a frame has been seen."""
        return bool(self._hull)

    def forget(self) -> None:
        """Begin anew, as after a restart of the board."""
        self._hull.clear()

    def observe(self, board: int, arrival: int) -> None:
        """A frame stamped `board` could not have arrived before `arrival`; `board` must rise."""
        point = (board, arrival - board)
        hull = self._hull
        while len(hull) >= 2 and not _below(hull[-2], hull[-1], point):
            hull.pop()
        hull.append(point)
        while board - hull[0][0] > WINDOW and len(hull) > 2:
            hull.popleft()
        self._lay()

    def to_host(self, board: int) -> int:
        """The host's time at which the board's clock showed `board`."""
        return board + self._offset + round(self._drift * (board - self._origin))

    def to_board(self, host: int) -> int:
        """The board's time at the host's time `host`, to the drift's second order."""
        board = host - self._offset
        return board - round(self._drift * (board - self._origin))

    def _lay(self) -> None:
        hull = self._hull
        first, last = hull[0], hull[-1]
        if last[0] - first[0] < SHORTEST:
            self._origin, self._offset = min(hull, key=lambda point: point[1])
            self._drift = 0.0
            return
        middle = (first[0] + last[0]) // 2
        index = next(i for i in range(1, len(hull)) if hull[i][0] >= middle)
        (start, low), (end, high) = hull[index - 1], hull[index]
        drift = (high - low) / (end - start)
        self._drift = min(max(drift, -MOST_DRIFT), MOST_DRIFT)
        self._origin, self._offset = start, low


def _below(a: tuple[int, int], b: tuple[int, int], c: tuple[int, int]) -> bool:
    """True when `b` lies below the line from `a` to `c`, and so on the lower hull."""
    return (b[1] - a[1]) * (c[0] - a[0]) < (c[1] - a[1]) * (b[0] - a[0])
