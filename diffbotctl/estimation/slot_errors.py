"""Where the slots of an encoder's disc truly lie, learnt while it turns.

A slot that comes under the light barrier again, one turn later, stands where it stood: what an
edge tells beyond the cutter's tolerance is found by estimating each slot's error together with the
wheel's motion (as landmarks in simultaneous localisation and mapping; Smith, Self, Cheeseman 1990).
The wheel's first edges, whose errors hide the phase at the start, are so corrected after a turn.
The open share of the disc, which places the edges that are seen going backward, is one error more.

A disc that was measured once is `KnownSlotErrors`: where its slots lie is known, but not which one
comes first. At power-on nobody knows how the disc stands under the light barrier, so each turn of
the pattern is a hypothesis of its own (`disc_alignment.py`).
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Literal, NamedTuple

LEARNABLE_SLOTS_MAX = 64  # a finer disc has errors too small to be worth the computation
# Standard deviations in pitches.
LEARNT_SD = 0.010  # all errors known so well stay as they are, which costs nothing
KNOWN_SD = 0.008  # of a slot that was measured once
# What is left after learning goes with the motor's ripple: it does not scatter from slot to slot,
# and taken for scatter it would be trusted too much.
ADOPTED_SD = 0.015

MeasurementRow = tuple[float, ...]
"""Covariance of a measured quantity with (z, speed, gain, offset, log lag, phase)."""
TransitionRows = tuple[float, float, float, float, float, float, float, float]
"""z' = z + a v + b gain + c offset + d lag; v' = e v + f gain + g offset + h lag."""

IDENTITY: TransitionRows = (0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0)


class Transition:
    """The product of the transition matrices since it was last taken."""

    __slots__ = ("is_identity", "rows")

    def __init__(self) -> None:
        self.rows = IDENTITY
        self.is_identity = True

    def add(self, later: TransitionRows) -> None:
        """A further step follows."""
        if self.is_identity:
            self.rows, self.is_identity = later, False
            return
        a, b, c, d, e, f, g, h = self.rows
        p, q, r, s, t, u, v, w = later
        self.rows = (
            a + p * e,
            b + p * f + q,
            c + p * g + r,
            d + p * h + s,
            t * e,
            t * f + u,
            t * g + v,
            t * h + w,
        )

    def take(self) -> TransitionRows:
        """The product so far; begins anew."""
        rows, self.rows, self.is_identity = self.rows, IDENTITY, True
        return rows


class SlotEstimate(NamedTuple):
    """What is known of an edge's place."""

    error: float
    """pitches, true place minus nominal"""
    variance: float


class SlotErrors:
    """The slots' errors (pitches, true place minus nominal) and their covariance with the motion.

    The last entry is the error of the open share; with `learns_backward`, each slot has an entry
    for the edge that is seen going backward instead. `cross_covariance` holds six lists, the
    covariances of each state of the motion with every error; `covariance` the errors' own.
    """

    __slots__ = (
        "backward_errors",
        "backward_variance",
        "covariance",
        "cross_covariance",
        "errors",
        "is_fixed",
        "is_started",
        "learns_backward",
        "pending",
        "slot_variance",
        "slots",
    )

    is_fixed: bool

    def __init__(
        self,
        slots: int,
        slot_sd: float,
        open_share_sd: float,
        open_share_error: float = 0.0,
        learns_backward: bool = False,
    ) -> None:
        """`slots` of the disc, 0 when they are not to be learnt; standard deviations of a slot's
        place and of the open share, in pitches, and how far that share is beyond a half.
        `learns_backward`: learn each slot's other edge too, and never leave off: for a calibration,
        as it takes four times the computation."""
        self.slots = slots if slots <= LEARNABLE_SLOTS_MAX else 0
        self.learns_backward = learns_backward
        self.slot_variance = self.backward_variance = slot_sd * slot_sd
        # what each edge seen backward lies off beyond the open share
        self.backward_errors = [0.0] * self.slots
        entries = 2 * self.slots if learns_backward and self.slots else self.slots + 1
        self.errors = [0.0] * entries
        self.cross_covariance = [[0.0] * entries for _ in range(6)]
        self.covariance = [[0.0] * entries for _ in range(entries)]
        for entry in range(entries):
            self.covariance[entry][entry] = self.slot_variance
        if not learns_backward:
            self.covariance[-1][-1] = 0.0
        for row in range(self.slots, entries):  # the share is in all edges seen backward
            self.errors[row] = open_share_error
            for column in range(self.slots, entries):
                self.covariance[row][column] += open_share_sd * open_share_sd
        self.pending = Transition()
        self.is_started = not self.slots
        self.is_fixed = True

    def start_learning(self) -> None:
        """An edge's time is known: from now on there is something to learn."""
        if not self.is_started:
            self.is_started, self.is_fixed = True, False

    def copy(self) -> SlotErrors:
        """The same, to go its own way from now on."""
        twin = object.__new__(SlotErrors)
        for name in SlotErrors.__slots__:
            setattr(twin, name, getattr(self, name))
        twin.errors = self.errors[:]
        twin.cross_covariance = [row[:] for row in self.cross_covariance]
        twin.covariance = [row[:] for row in self.covariance]
        twin.pending = Transition()
        twin.pending.rows, twin.pending.is_identity = self.pending.rows, self.pending.is_identity
        return twin

    def index(self, slot: int, is_forward: bool) -> int:
        """Which error shows when the edge of `slot`, counted from the start, is seen."""
        if is_forward:
            return slot % self.slots
        return self.slots + slot % self.slots if self.learns_backward else -1

    def edge_estimate(self, slot: int, is_forward: bool) -> SlotEstimate:
        """What is known of the edge of `slot`, once nothing more is learnt."""
        if not self.slots:
            return SlotEstimate(0.0 if is_forward else self.errors[-1], self.slot_variance)
        index = self.index(slot, is_forward)
        fixed = self.fixed_estimate(slot, is_forward)
        return SlotEstimate(
            self.errors[index] + fixed.error, self.covariance[index][index] + fixed.variance
        )

    def fixed_estimate(self, slot: int, is_forward: bool) -> SlotEstimate:
        """What of an edge's error is in no entry."""
        if is_forward or self.learns_backward:
            return SlotEstimate(0.0, 0.0)
        error = self.backward_errors[slot % self.slots] if self.slots else 0.0
        return SlotEstimate(error, self.backward_variance)

    def propagate(self) -> None:
        """Bring the covariance with the motion up to now."""
        if self.pending.is_identity:
            return
        cross = self.cross_covariance
        z, speed, gain, offset, lag = cross[:5]
        a, b, c, d, e, f, g, h = self.pending.take()
        cross[0] = [
            p + a * q + b * r + c * s + d * t
            for p, q, r, s, t in zip(z, speed, gain, offset, lag, strict=True)
        ]
        cross[1] = [
            e * q + f * r + g * s + h * t
            for q, r, s, t in zip(speed, gain, offset, lag, strict=True)
        ]

    def wheel_stopped(self) -> None:
        """The wheel stands: its speed is known, and correlates with nothing."""
        if not self.is_fixed:
            self.propagate()
            self.cross_covariance[1] = [0.0] * len(self.errors)

    def rows(self, index: int) -> tuple[MeasurementRow, list[float]]:
        """Covariances of an error with the motion and with the other errors."""
        z, speed, gain, offset, lag, phase = self.cross_covariance
        return (
            (z[index], speed[index], gain[index], offset[index], lag[index], phase[index]),
            self.covariance[index],
        )

    def update(
        self,
        motion_row: MeasurementRow,
        slot_row: list[float],
        scaled_innovation: float,
        inverse_innovation_variance: float,
    ) -> None:
        """Take in a measurement with the covariances `motion_row` with the motion and `slot_row`
        with the slots; `scaled_innovation` is the innovation over its variance."""
        self.errors = [
            error + share * scaled_innovation
            for error, share in zip(self.errors, slot_row, strict=True)
        ]
        for rows, shares in (
            (self.cross_covariance, motion_row),
            (self.covariance, tuple(slot_row)),
        ):
            for index, share in enumerate(shares):
                if share:
                    part = share * inverse_innovation_variance
                    rows[index] = [p - part * q for p, q in zip(rows[index], slot_row, strict=True)]

    def stop_learning_if_known(self) -> None:
        """Take the errors as they are once those of all slots are known well enough."""
        limit = LEARNT_SD * LEARNT_SD
        self.is_fixed = not self.learns_backward and all(
            self.covariance[slot][slot] < limit for slot in range(self.slots)
        )


class KnownSlotErrors:
    """The slots' errors (pitches, true place minus nominal) of one turn of a measured disc.

    It learns nothing more, so it has no covariance with the motion.
    """

    __slots__ = ("edges", "first_slot", "slots")

    is_fixed: Literal[True] = True

    def __init__(self, edges: EdgeErrors, first_slot: int) -> None:
        """`first_slot`: which slot of the pattern is slot 0 of the count."""
        self.edges = edges
        self.slots = len(edges.forward)
        self.first_slot = first_slot

    def copy(self) -> KnownSlotErrors:
        """Itself: it never changes."""
        return self

    def edge_estimate(self, slot: int, is_forward: bool) -> SlotEstimate:
        """Error of the edge of `slot`, and the error's variance."""
        edges, place = self.edges, (slot + self.first_slot) % self.slots
        if is_forward:
            return SlotEstimate(edges.forward[place], edges.forward_variance)
        return SlotEstimate(edges.backward[place] + edges.open_share.error, edges.backward_variance)

    def backward_errors(self) -> list[float]:
        """By slot, what each edge seen backward lies off beyond the open share."""
        return [
            self.edges.backward[(slot + self.first_slot) % self.slots] for slot in range(self.slots)
        ]

    def wheel_stopped(self) -> None:
        """Nothing correlates with a speed."""


class EdgeErrors:
    """Both edges of each slot as they are seen going forward and backward, in pitches."""

    __slots__ = ("backward", "backward_variance", "forward", "forward_variance", "open_share")

    def __init__(
        self,
        forward: Sequence[float],
        backward: Sequence[float],
        open_share: SlotEstimate,
        slot_sd: float,
    ) -> None:
        """Errors of the edges seen `forward`; of those seen `backward` beyond the open share, which
        is stated as its error from half a pitch. None of the latter where they are not known: then
        they scatter by `slot_sd`."""
        self.forward = tuple(forward)
        self.backward = tuple(backward) or (0.0,) * len(self.forward)
        self.forward_variance = KNOWN_SD * KNOWN_SD
        self.backward_variance = self.forward_variance if backward else slot_sd * slot_sd
        self.open_share = open_share

    def alignments(self) -> Iterator[KnownSlotErrors]:
        """The disc as it may stand at power-on."""
        for first_slot in range(len(self.forward)):
            yield KnownSlotErrors(self, first_slot)


Slots = SlotErrors | KnownSlotErrors
