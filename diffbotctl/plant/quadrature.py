"""The two channels of an encoder: B follows A by a quarter of a pitch, so their order shows the
direction.

A pitch has four edges, in forward order: A rises, B rises, A falls, B falls. A board counts the
first of them in both directions, up when A rises and down when it falls, or all four.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Sequence
from random import Random

from diffbotctl.plant.encoder_disc import EncoderDisc, LevelChange
from diffbotctl.time import SECOND

EDGES_PER_PITCH = 4
# Hall sensors and their comparators are later by microseconds only: far less than the time from one
# edge to the next, so the order of the edges stays.
JITTER_SHARE_MAX = 1 / 16


def edges_of_two(edges: Sequence[float], turn: float) -> tuple[float, ...]:
    """The edges of both channels from those of A; B's lie in the middle between A's."""
    following = [*edges[1:], edges[0] + turn]
    return tuple(
        angle
        for edge, after in zip(edges, following, strict=True)
        for angle in (edge, 0.5 * (edge + after))
    )


class TwoChannelPins:
    """The edges of both channels on their way to the board."""

    __slots__ = ("_changes", "_directions", "_disc", "_last", "_rng", "pending", "taken_directions")

    def __init__(self, disc: EncoderDisc, rng: Random) -> None:
        self._disc, self._rng = disc, rng
        self._last = 0  # ns, the last edge of either channel
        self.pending: deque[int] = deque()  # times of counted edges that `take` has not returned
        self._directions: deque[int] = deque()
        self.taken_directions: list[int] = []
        """1 forward, -1 backward: of the edges that `take` has returned last"""
        self._changes: tuple[deque[LevelChange], deque[LevelChange]] | None = None

    def watch(self, on: bool) -> None:
        """Start or stop collecting what `changes` returns."""
        self._changes = (deque(), deque()) if on else None

    def changes(self, until: int, channel: int = 0) -> list[LevelChange]:
        """Changes of a watched pin (0 A, 1 B) since the last call, until `until`."""
        changes: list[LevelChange] = []
        waiting = self._changes[channel] if self._changes is not None else None
        while waiting and waiting[0].time <= until:
            changes.append(waiting.popleft())
        return changes

    def take(self, until: int) -> Sequence[int]:
        """Times (ns) of the counted edges since the last call, until `until`, in order."""
        times: list[int] = []
        self.taken_directions = []
        while self.pending and self.pending[0] <= until:
            times.append(self.pending.popleft())
            self.taken_directions.append(self._directions.popleft())
        return times

    def levels(self, index: int) -> tuple[int, ...]:
        """Levels of A and B after `index` edges."""
        return levels_of_two(index)

    def is_needed(self, index: int, is_forward: bool) -> bool:
        """Whether the time of edge number `index` is needed: it counts, or the pins are watched."""
        return index % EDGES_PER_PITCH == 0 or self._disc.every_edge or self._changes is not None

    def record(self, time: int, index: int, is_forward: bool) -> None:
        """The disc goes past edge number `index` at `time` (ns)."""
        jitter, last = self._disc.jitter, self._last
        if jitter:
            delay = int(abs(self._rng.gauss(0.0, jitter)) * SECOND)
            time += min(delay, int(max(time - last, 0) * JITTER_SHARE_MAX))
        time = self._last = max(time, last)
        if self._changes is not None:
            kind = index % EDGES_PER_PITCH
            level = int((kind < EDGES_PER_PITCH // 2) == is_forward)
            self._changes[kind % 2].append(LevelChange(time, level))
        if self._counts(index):
            self.pending.append(time)
            self._directions.append(1 if is_forward else -1)

    def _counts(self, index: int) -> bool:
        return self._disc.every_edge or index % EDGES_PER_PITCH == 0


def levels_of_two(index: int) -> tuple[int, int]:
    """Levels of A and B after `index` edges."""
    passed = index % EDGES_PER_PITCH
    return int(passed in (1, 2)), int(passed in (2, 3))
