"""A slotted disc and its light barrier: edges that are late, bounce, are missed or come twice."""

from __future__ import annotations

from collections import deque
from collections.abc import Sequence
from math import pi, sin
from random import Random
from typing import NamedTuple

from diffbotctl.config.simulation import EncoderTruth
from diffbotctl.time import SECOND

BOUNCE_EDGES = 3  # additional edges of a bouncing one
# A scratch on the disc gives a second edge within this part of the way to the next slot. The speed
# is taken from the interval before, at most a tenth of a second.
SCRATCH_PART_MIN, SCRATCH_PART_MAX = 0.2, 0.8
SCRATCH_INTERVAL_MAX = SECOND // 10


class LevelChange(NamedTuple):
    """An encoder's pin goes to `level` (0 or 1) at `time` (ns)."""

    time: int
    level: int


class PulseFaults(NamedTuple):
    """What is wrong with an encoder of one channel at a time; see `EncoderDisc`."""

    missed: float = 0.0
    doubled: float = 0.0
    bounce: float = 0.0  # s; of each edge
    halved: bool = False  # every second slot gives no pulse
    silent: bool = False  # no slot gives one


class EncoderDisc(NamedTuple):
    """A slotted disc. `edges`: angles in one turn (rad), rising and falling alternately.

    With two channels those of both, see quadrature.py.
    """

    edges: tuple[float, ...]
    start: float  # rad; the disc's angle under the light barrier at the start
    jitter: float  # s; standard deviation of an edge's delay
    bounce: float = 0.0  # s; longest time that an edge bounces
    bounce_share: float = 1.0  # of the edges that bounce
    missed: float = 0.0  # probability that a slot's pulse does not reach the board
    doubled: float = 0.0  # probability that a counted edge is followed by a second one
    covered: frozenset[int] = frozenset()  # slots that give no pulse
    channels: int = 1
    every_edge: bool = False  # two channels: all four edges of a slot count, not one

    @property
    def pitch(self) -> float:
        """Angle from one slot to the next, rad."""
        return 4 * pi * self.channels / len(self.edges)


def draw_disc(truth: EncoderTruth, slots: int, rng: Random) -> EncoderDisc:
    """Draw a disc with `slots` slots."""
    pitch = 2 * pi / slots
    duty = _within(rng.gauss(0.5, truth.duty_spread), 0.3, 0.7)
    edges = []
    for slot in range(slots):
        # The limits keep the order of slots and bars.
        place = slot + _within(rng.gauss(0.0, truth.slot_spread), -0.12, 0.12)
        end = slot + duty + _within(rng.gauss(0.0, truth.slot_spread), -0.12, 0.12)
        edges += [place * pitch, end * pitch]
    start = rng.uniform(0.0, 2 * pi) if truth.phase == "random" else 0.0
    # Dirt changes nothing else of the robot: its draw does not advance `rng`.
    dirt = Random(f"{edges} {start}")
    covered = frozenset(dirt.sample(range(slots), min(truth.covered, slots - 1)))
    return EncoderDisc(
        tuple(edges),
        start,
        truth.jitter,
        truth.bounce,
        truth.bounce_share,
        truth.missed,
        truth.doubled,
        covered,
    )


def draw_eccentric(disc: EncoderDisc, spread: float, rng: Random) -> EncoderDisc:
    """`disc` mounted beside its centre: errors of up to twice `spread` (pitches), once per turn."""
    amplitude = rng.uniform(0.0, 2.0) * spread * disc.pitch
    phase = rng.uniform(0.0, 2 * pi)
    return disc._replace(edges=tuple(edge + amplitude * sin(edge + phase) for edge in disc.edges))


class EncoderPin:
    """The edges of a disc with one channel on their way to the board."""

    __slots__ = (
        "_bounce",
        "_bounce_share",
        "_changes",
        "_disc",
        "_doubled",
        "_faults",
        "_is_missing",
        "_keeps_order",
        "_missed",
        "_previous",
        "_rng",
        "counted_level",
        "pending",
    )
    taken_directions = ()

    def __init__(self, disc: EncoderDisc, falling: bool, rng: Random) -> None:
        """`falling`: the board counts falling edges instead of rising ones."""
        self._disc, self._rng = disc, rng
        self.counted_level = 0 if falling else 1
        self.pending: deque[int] = deque()  # times of counted edges that `take` has not returned
        self._changes: deque[LevelChange] | None = None
        self._is_missing = False
        self._previous = -SCRATCH_INTERVAL_MAX  # ns, the last counted edge
        self.set_faults(PulseFaults())

    def set_faults(self, faults: PulseFaults) -> None:
        """What is wrong from now on, beside the properties of the disc."""
        disc = self._disc
        self._faults = faults
        self._missed = max(disc.missed, faults.missed)
        self._doubled = max(disc.doubled, faults.doubled)
        self._bounce = max(disc.bounce, faults.bounce)
        self._bounce_share = 1.0 if faults.bounce else disc.bounce_share
        self._keeps_order = not self._doubled and self._bounce_share >= 1.0

    def watch(self, on: bool) -> None:
        """Start or stop collecting what `changes` returns."""
        self._changes = deque() if on else None

    def changes(self, until: int, channel: int = 0) -> list[LevelChange]:
        """Changes of the watched pin since the last call, until `until`; none of channel 1."""
        changes: list[LevelChange] = []
        if channel:
            return changes
        while self._changes and self._changes[0].time <= until:
            changes.append(self._changes.popleft())
        return changes

    def take(self, until: int) -> Sequence[int]:
        """Times (ns) of the counted edges since the last call, until `until`, in order."""
        pending = self.pending
        if not pending:
            return ()
        times = []
        while pending and pending[0] <= until:
            times.append(pending.popleft())
        return times

    def levels(self, index: int) -> tuple[int, ...]:
        """Level of the pin after `index` edges: 1 while a slot is open, if its pulse comes."""
        level = index % 2
        if level and self._is_dark(index):
            return (0,)
        return (1 - level if self._is_missing and level == self.counted_level else level,)

    def _is_dark(self, index: int) -> bool:
        """Whether the slot of edge number `index` gives no pulse."""
        disc = self._disc
        is_covered = bool(disc.covered) and (index % len(disc.edges)) // 2 in disc.covered
        faults = self._faults
        return faults.silent or is_covered or (faults.halved and (index // 2) % 2 == 1)

    def is_needed(self, index: int, is_forward: bool) -> bool:
        """Whether the time of edge number `index` is needed: it counts, or the pin is watched."""
        return self._changes is not None or (index + is_forward) % 2 == self.counted_level

    def record(self, time: int, index: int, is_forward: bool) -> None:
        """The disc goes past edge number `index` at `time` (ns)."""
        level = (index + is_forward) % 2
        disc, rng, is_counted = self._disc, self._rng, level == self.counted_level
        if self._is_dark(index):
            return
        if self._missed:
            if is_counted:
                self._is_missing = rng.random() < self._missed
            if self._is_missing:
                return
        if disc.jitter:
            # A light barrier can only be late. A mean delay is the same for every edge.
            time += int(abs(rng.gauss(0.0, disc.jitter)) * SECOND)
        times = [time]
        if self._bounce and (self._bounce_share >= 1.0 or rng.random() < self._bounce_share):
            window = self._bounce * SECOND
            times += sorted(time + int(rng.random() * window) for _ in range(BOUNCE_EDGES))
        if is_counted:
            if self._doubled and rng.random() < self._doubled:
                times.append(self._second_edge(time))
            self._previous = time
            self._add_pending(times)
        if self._changes is not None:
            _append_changes(self._changes, times, level)

    def _second_edge(self, time: int) -> int:
        interval = min(time - self._previous, SCRATCH_INTERVAL_MAX)
        return time + int(self._rng.uniform(SCRATCH_PART_MIN, SCRATCH_PART_MAX) * interval)

    def _add_pending(self, times: list[int]) -> None:
        pending = self.pending
        if self._keeps_order:
            if pending:
                times[0] = max(times[0], pending[-1])
            pending.extend(times)
        else:
            self.pending = deque(sorted([*pending, *times]))


def _append_changes(changes: deque[LevelChange], times: Sequence[int], level: int) -> None:
    """Append the pin's changes: it goes to `level` at all these times, and back in between."""
    earliest = changes[-1].time if changes else 0
    for before, time in zip([None, *times], times, strict=False):
        if before is not None:
            changes.append(LevelChange(max(earliest, (before + time) // 2), 1 - level))
        changes.append(LevelChange(max(earliest, time), level))


def _within(value: float, low: float, high: float) -> float:
    return min(max(value, low), high)
