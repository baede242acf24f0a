"""Where the slots of an encoder's disc truly lie, learnt while it turns.

A slot that comes under the light barrier again, one turn later, stands where it stood: what an
edge tells beyond the cutter's tolerance is found by estimating each slot's error together with the
wheel's motion (as landmarks in simultaneous localisation and mapping; Smith, Self, Cheeseman 1990).
The wheel's first edges, whose errors hide the phase at the start, are so corrected after a turn.
The open share of the disc, which places the flanks that are seen going backward, is one error more.
"""

from __future__ import annotations

from typing import NamedTuple

from diffbotctl.estimation.wheel_transition import Transition

MOST = 64  # slots; a finer disc has errors too small to be worth the reckoning
LEARNT = 0.010  # pitches; all errors known so well stay as they are, which costs nothing

MeasurementRow = tuple[float, float, float, float, float, float]
"""What something has in common with (z, speed, gain, offset, log lag, phase)."""


class SlotEstimate(NamedTuple):
    """What is known of a flank's place."""

    error: float
    """pitches, true place minus nominal"""
    variance: float


class SlotErrors:
    """The slots' errors (pitches, true place minus nominal) and what they share with the motion.

    The last entry is the error of the open share; where `both` flanks are learnt, each slot has an
    entry for the flank that is seen going backward instead. `shared` holds six lists, the
    covariances of each state of the motion with every error; `own` the errors' covariances with
    each other.
    """

    __slots__ = (
        "back",
        "back_variance",
        "begun",
        "both",
        "error",
        "learnt",
        "own",
        "shared",
        "slots",
        "tolerance",
        "waiting",
    )

    def __init__(
        self, slots: int, slot: float, share: float, beyond: float = 0.0, both: bool = False
    ) -> None:
        """`slots` of the disc, 0 when they are not to be learnt; standard deviations of a `slot`'s
        place and of the open `share`, in pitches, and how far that share is `beyond` a half.
        `both`: learn each slot's other flank too, and never leave off: for a calibration, as it
        takes four times the reckoning."""
        self.slots = slots if slots <= MOST else 0
        self.both = both
        self.tolerance = self.back_variance = slot * slot
        self.back = [0.0] * self.slots  # what each flank seen backward lies off beyond the share
        entries = 2 * self.slots if both and self.slots else self.slots + 1
        self.error = [0.0] * entries
        self.shared = [[0.0] * entries for _ in range(6)]
        self.own = [[0.0] * entries for _ in range(entries)]
        for entry in range(entries):
            self.own[entry][entry] = self.tolerance
        if not both:
            self.own[-1][-1] = 0.0
        for one in range(self.slots, entries):  # the share is in all flanks seen backward
            self.error[one] = beyond
            for other in range(self.slots, entries):
                self.own[one][other] += share * share
        self.waiting = Transition()
        self.begun = not self.slots
        self.learnt = True

    def begin(self) -> None:
        """An edge's time is known: from now on there is something to learn."""
        if not self.begun:
            self.begun, self.learnt = True, False

    def copy(self) -> SlotErrors:
        """The same, to go its own way from now on."""
        twin = object.__new__(SlotErrors)
        twin.slots, twin.begun, twin.learnt = self.slots, self.begun, self.learnt
        twin.both, twin.tolerance = self.both, self.tolerance
        twin.back, twin.back_variance = self.back, self.back_variance
        twin.error = self.error[:]
        twin.shared = [row[:] for row in self.shared]
        twin.own = [row[:] for row in self.own]
        twin.waiting = Transition()
        twin.waiting.factors, twin.waiting.still = self.waiting.factors, self.waiting.still
        return twin

    def entry(self, slot: int, forward: bool) -> int:
        """Which error shows when the flank of `slot`, counted from the start, is seen."""
        if forward:
            return slot % self.slots
        return self.slots + slot % self.slots if self.both else -1

    def told(self, slot: int, forward: bool) -> SlotEstimate:
        """What is known of the flank of `slot`, once nothing more is learnt."""
        if not self.slots:
            return SlotEstimate(0.0 if forward else self.error[-1], self.tolerance)
        entry = self.entry(slot, forward)
        alone = self.alone(slot, forward)
        return SlotEstimate(
            self.error[entry] + alone.error, self.own[entry][entry] + alone.variance
        )

    def alone(self, slot: int, forward: bool) -> SlotEstimate:
        """What of a flank's error is its own, and in no entry."""
        if forward or self.both:
            return SlotEstimate(0.0, 0.0)
        return SlotEstimate(self.back[slot % self.slots] if self.slots else 0.0, self.back_variance)

    def carry(self) -> None:
        """Let what the slots share with the motion follow it to now."""
        waiting = self.waiting
        if waiting.still:
            return
        shared = self.shared
        z, speed, gain, offset, lag = shared[:5]
        a, b, c, d, e, f, g, h = waiting.take()
        shared[0] = [
            p + a * q + b * r + c * s + d * t
            for p, q, r, s, t in zip(z, speed, gain, offset, lag, strict=True)
        ]
        shared[1] = [
            e * q + f * r + g * s + h * t
            for q, r, s, t in zip(speed, gain, offset, lag, strict=True)
        ]

    def halt(self) -> None:
        """The wheel stands: its speed is known, and has nothing in common with anything."""
        if not self.learnt:
            self.carry()
            self.shared[1] = [0.0] * len(self.error)

    def with_entry(self, entry: int) -> tuple[MeasurementRow, list[float]]:
        """What an error shares with the motion and with the other errors."""
        z, speed, gain, offset, lag, phase = self.shared
        return (
            (z[entry], speed[entry], gain[entry], offset[entry], lag[entry], phase[entry]),
            self.own[entry],
        )

    def absorb(self, motion: MeasurementRow, slots: list[float], pull: float, cut: float) -> None:
        """Take in a measurement that shares `motion` with the motion and `slots` with the slots."""
        self.error = [error + share * pull for error, share in zip(self.error, slots, strict=True)]
        for state, share in enumerate(motion):
            if share:
                part = share * cut
                self.shared[state] = [
                    p - part * q for p, q in zip(self.shared[state], slots, strict=True)
                ]
        own = self.own
        for place, share in enumerate(slots):
            if share:
                part = share * cut
                own[place] = [p - part * q for p, q in zip(own[place], slots, strict=True)]

    def settle(self) -> None:
        """Take the errors as they are once those of all slots are known well enough."""
        limit = LEARNT * LEARNT
        self.learnt = not self.both and all(
            self.own[slot][slot] < limit for slot in range(self.slots)
        )
