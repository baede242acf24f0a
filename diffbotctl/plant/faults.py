"""The faults of one simulated robot: drawn by its seed, and those that act at a time."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from math import prod
from random import Random
from typing import NamedTuple

from diffbotctl.config.faults import FAULTS, FaultEntry
from diffbotctl.params import Spread
from diffbotctl.plant.encoder_disc import PulseFaults
from diffbotctl.time import NEVER, SECOND

SIDES = {"left": (True, False), "right": (False, True)}
BLOCKING_DRAG = 3.0  # duty; no motor overcomes more than 1


class Fault(NamedTuple):
    """A fault from `start` to `end` (ns), of the left wheel, the right one or both."""

    kind: str
    start: int
    end: int
    sides: tuple[bool, bool]
    size: float
    part: str | None = None  # the sensor or program, None: all


def draw_fault(entry: FaultEntry, rng: Random) -> Fault:
    """Draw the times, the side and the size of a fault."""
    start = round(rng.uniform(*entry.at) * SECOND)
    lasts = FAULTS[entry.fault].lasts
    duration = entry.duration or (None if lasts is None else Spread(lasts, lasts))
    end = NEVER
    if duration is not None:
        end = start + max(round(rng.uniform(*duration) * SECOND), 1)
    side = rng.choice(("left", "right")) if entry.side == "either" else entry.side
    declared = FAULTS[entry.fault].size
    size: Spread | None = entry.size or (None if declared is None else declared.default)
    drawn = 0.0 if size is None else rng.uniform(*size)
    sides = SIDES.get(side or "both", (True, True))
    return Fault(entry.fault, start, end, sides, drawn, entry.sensor or entry.program)


class ActiveFaults:
    """The faults that act at one time. Pairs are of the left and the right wheel."""

    def __init__(self, faults: Sequence[Fault] = ()) -> None:
        self._faults = faults

    def sizes(self, kind: str, side: int | None = None) -> list[float]:
        """Those of all faults of this kind; `side`: 0 left, 1 right."""
        return [
            fault.size
            for fault in self._faults
            if fault.kind == kind and (side is None or fault.sides[side])
        ]

    def has(self, kind: str, side: int | None = None) -> bool:
        """Whether one of this kind acts."""
        return bool(self.sizes(kind, side))

    def of(self, kind: str, sensor: str) -> bool:
        """Whether one of this kind acts on a sensor."""
        return any(fault.kind == kind and fault.part in (None, sensor) for fault in self._faults)

    def largest(self, kind: str, usual: float = 0.0, side: int | None = None) -> float:
        """The largest size of this kind, at least `usual`."""
        return max([usual, *self.sizes(kind, side)])

    def supply(self) -> float:
        """Factor of the battery's voltage."""
        return prod(self.sizes("battery_step")) * (not self.has("battery_cut"))

    def encoder(self, side: int) -> PulseFaults:
        """What is wrong with an encoder of one channel."""
        return PulseFaults(
            self.largest("edges_missed", 0.0, side),
            self.largest("edges_doubled", 0.0, side),
            self.largest("edges_chatter", 0.0, side),
            self.has("edges_halved", side),
            self.has("edges_silent", side),
        )

    def pushes(self) -> float:
        """Speed to the left at which the robot is pushed, m/s."""
        pushes = [
            (1.0 if fault.sides[0] else -1.0) * fault.size * SECOND / (fault.end - fault.start)
            for fault in self._faults
            if fault.kind == "robot_pushed"
        ]
        return sum(pushes, 0.0)

    def drags(self) -> tuple[float, float]:
        """Further friction of the wheels, in duty."""
        left, right = (
            sum(self.sizes("wheel_drag", side)) + BLOCKING_DRAG * self.has("wheel_blocked", side)
            for side in (0, 1)
        )
        return left, right

    def slides(self) -> tuple[float, float]:
        """Shares of their turns by which the wheels slide."""
        left, right = (
            max(self.largest("wheel_slide", 0.0, side), float(self.has("wheel_lifted", side)))
            for side in (0, 1)
        )
        return left, right


class FaultSchedule:
    """The faults of one run. `due`: when the next one begins or ends, ns; `active`: what acts.

    `rng` draws what happens while they act.
    """

    def __init__(self, entries: Iterable[FaultEntry], rng: Random) -> None:
        self.rng, self.active = rng, ActiveFaults()
        self.faults = [draw_fault(entry, rng) for entry in entries]
        self.due = self._next(-1)

    def update(self, now: int) -> ActiveFaults:
        """What acts from `now` on."""
        self.due = self._next(now)
        acting = [fault for fault in self.faults if fault.start <= now < fault.end]
        self.active = ActiveFaults(acting)
        return self.active

    def beginning(self, kind: str, now: int) -> list[Fault]:
        """Those of this kind that begin at `now`."""
        return [fault for fault in self.faults if fault.kind == kind and fault.start == now]

    def loses(self) -> bool:
        """Whether the link loses what is sent now."""
        share = self.active.largest("link_loss")
        return self.active.has("link_cut") or (share > 0.0 and self.rng.random() < share)

    def delay(self) -> int:
        """Further delay of the link in one direction, ns."""
        return round(self.active.largest("link_delay") * SECOND)

    def _next(self, now: int) -> int:
        """The first beginning or end after `now`."""
        times = [time for fault in self.faults for time in (fault.start, fault.end)]
        return min((time for time in times if time > now), default=NEVER)
