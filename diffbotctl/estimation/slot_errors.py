"""Position errors of the slots of an encoder disc, estimated while it turns.

Slots are cut with a tolerance, but each slot has the same error on every turn. The errors are
estimated together with the wheel's motion, as landmarks are in simultaneous localisation and
mapping (Smith, Self and Cheeseman 1990). After one turn this also corrects the first edges, whose
errors limit the estimate of the initial phase. One more error is that of the open share of the
pitch, which places the edges that are seen backward.

`KnownSlotErrors` is a disc whose errors were measured before. Its rotation at power-on is unknown;
`disc_alignment.py` finds it.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from copy import copy
from typing import Literal, NamedTuple

LEARNABLE_SLOTS_MAX = 64  # finer discs have errors too small to be worth the computation
# Standard deviations in pitches.
LEARNT_SD = 0.010  # learning ends when all errors are known to this, to save time
KNOWN_SD = 0.008  # of a slot measured by a calibration
# The errors that remain after learning follow the motor's ripple. They are correlated between
# slots, so this is larger than KNOWN_SD.
ADOPTED_SD = 0.015

MeasurementRow = tuple[float, ...]
"""Covariance of a measured quantity with (z, speed, gain, offset, log lag, phase)."""
TransitionRows = tuple[float, float, float, float, float, float, float, float]
"""z' = z + a v + b gain + c offset + d lag; v' = e v + f gain + g offset + h lag."""


def _followed(rows: TransitionRows, later: TransitionRows) -> TransitionRows:
    """The product of two successive transitions."""
    a, b, c, d, e, f, g, h = rows
    p, q, r, s, t, u, v, w = later
    return (
        a + p * e,
        b + p * f + q,
        c + p * g + r,
        d + p * h + s,
        t * e,
        t * f + u,
        t * g + v,
        t * h + w,
    )


class SlotEstimate(NamedTuple):
    """Estimated position error of an edge."""

    error: float
    """pitches, true position minus nominal"""
    variance: float


class SlotErrors:
    """Errors of the slots (pitches, true position minus nominal), estimated with the motion.

    `errors`: (entries,), one per slot and a last one for the open share; with `learns_backward` one
    more per slot, for its backward edge, instead. `covariance`: (6 + entries, entries), row by row,
    of the six states of the motion, and of the errors, with the errors.
    """

    __slots__ = (
        "backward_errors",
        "backward_variance",
        "covariance",
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
        """`slots` of the disc, 0 to learn none; `open_share_error`: open share minus 0.5 (pitches).

        `learns_backward`: also learn the backward edge of each slot, and never stop learning; for
        calibration only, as it takes four times the computation.
        """
        self.slots = slots if slots <= LEARNABLE_SLOTS_MAX else 0
        self.learns_backward = learns_backward
        self.slot_variance = self.backward_variance = slot_sd * slot_sd
        # of each backward edge, in addition to the open share
        self.backward_errors = [0.0] * self.slots
        entries = 2 * self.slots if learns_backward and self.slots else self.slots + 1
        self.errors = [0.0] * entries
        rows = [[0.0] * entries for _ in range(6 + entries)]
        for entry in range(entries if learns_backward else entries - 1):
            rows[6 + entry][entry] = self.slot_variance
        for row in range(self.slots, entries):  # the open share contributes to all backward edges
            self.errors[row] = open_share_error
            for column in range(self.slots, entries):
                rows[6 + row][column] += open_share_sd * open_share_sd
        self.covariance = [value for row in rows for value in row]
        self.pending: TransitionRows | None = None  # not yet applied to the rows of the motion
        self.is_started = not self.slots
        self.is_fixed = True

    def start_learning(self) -> None:
        """Start at the first edge with a known time."""
        if not self.is_started:
            self.is_started, self.is_fixed = True, False

    def copy(self) -> SlotErrors:
        """An independent copy, for a new hypothesis."""
        duplicate = copy(self)
        duplicate.errors = self.errors[:]
        duplicate.covariance = self.covariance[:]
        return duplicate

    def index(self, slot: int, is_forward: bool) -> int:
        """Index of the error that applies to the edge of `slot`, counted from the start."""
        if is_forward:
            return slot % self.slots
        return self.slots + (slot % self.slots if self.learns_backward else 0)

    def edge_estimate(self, slot: int, is_forward: bool) -> SlotEstimate:
        """Error of the edge of `slot` and its variance, when learning has ended."""
        if not self.slots:
            return SlotEstimate(0.0 if is_forward else self.errors[-1], self.slot_variance)
        index = self.index(slot, is_forward)
        fixed = self.fixed_estimate(slot, is_forward)
        return SlotEstimate(
            self.errors[index] + fixed.error, self.variance_of(index) + fixed.variance
        )

    def fixed_estimate(self, slot: int, is_forward: bool) -> SlotEstimate:
        """The part of an edge's error that is not estimated here."""
        if is_forward or self.learns_backward:
            return SlotEstimate(0.0, 0.0)
        error = self.backward_errors[slot % self.slots] if self.slots else 0.0
        return SlotEstimate(error, self.backward_variance)

    def predict(self, rows: TransitionRows) -> None:
        self.pending = rows if self.pending is None else _followed(self.pending, rows)

    def propagate(self) -> None:
        """Apply the pending transition to the covariance with the motion."""
        if self.pending is None:
            return
        z, speed, gain, offset, lag = map(self.row, range(5))
        (a, b, c, d, e, f, g, h), self.pending = self.pending, None
        moved = [
            p + a * q + b * r + c * s + d * t
            for p, q, r, s, t in zip(z, speed, gain, offset, lag, strict=True)
        ]
        moved += [
            e * q + f * r + g * s + h * t
            for q, r, s, t in zip(speed, gain, offset, lag, strict=True)
        ]
        self.covariance[: len(moved)] = moved

    def wheel_stopped(self) -> None:
        """At rest the speed is known, so its covariance with the errors is zero."""
        if not self.is_fixed:
            self.propagate()
            entries = len(self.errors)
            self.covariance[entries : 2 * entries] = [0.0] * entries

    def row(self, state: int) -> list[float]:
        """Covariance of one state of the motion, or from 6 on of one error, with all errors."""
        entries = len(self.errors)
        return self.covariance[state * entries : (state + 1) * entries]

    def variance_of(self, index: int) -> float:
        return self.covariance[(6 + index) * len(self.errors) + index]

    def rows(self, index: int) -> tuple[MeasurementRow, list[float]]:
        """Covariance of one error with the motion, and with all errors."""
        entries = len(self.errors)
        return tuple(self.covariance[index : 6 * entries : entries]), self.row(6 + index)

    def update(
        self,
        motion_row: MeasurementRow,
        slot_row: list[float],
        scaled_innovation: float,
        inverse_innovation_variance: float,
    ) -> None:
        """Kalman update by a quantity whose covariance with the motion is `motion_row`, with the
        errors `slot_row`. `scaled_innovation`: innovation divided by its variance."""
        self.errors = [
            error + share * scaled_innovation
            for error, share in zip(self.errors, slot_row, strict=True)
        ]
        parts = [share * inverse_innovation_variance for share in (*motion_row, *slot_row)]
        changes = [part * share for part in parts for share in slot_row]
        self.covariance = [a - b for a, b in zip(self.covariance, changes, strict=True)]

    def stop_learning_if_known(self) -> None:
        """End learning when the errors of all slots are known to LEARNT_SD."""
        limit, entries = LEARNT_SD * LEARNT_SD, len(self.errors)
        variances = self.covariance[6 * entries :: entries + 1][: self.slots]
        self.is_fixed = not self.learns_backward and max(variances) < limit


class KnownSlotErrors:
    """Slot errors of a measured disc in one rotation. Constant."""

    is_fixed: Literal[True] = True

    def __init__(self, edges: EdgeErrors, first_slot: int) -> None:
        """`first_slot`: index in the pattern of slot 0 of the count."""
        self.edges = edges
        self.slots = len(edges.forward)
        self.first_slot = first_slot

    def copy(self) -> KnownSlotErrors:
        """The object itself, as it is constant."""
        return self

    def edge_estimate(self, slot: int, is_forward: bool) -> SlotEstimate:
        """Error of the edge of `slot`, and the error's variance."""
        edges, place = self.edges, (slot + self.first_slot) % self.slots
        if is_forward:
            return SlotEstimate(edges.forward[place], edges.forward_variance)
        return SlotEstimate(edges.backward[place] + edges.open_share.error, edges.backward_variance)

    def backward_errors(self) -> list[float]:
        """Error of the backward edge of each slot, without that of the open share."""
        return [
            self.edges.backward[(slot + self.first_slot) % self.slots] for slot in range(self.slots)
        ]

    def wheel_stopped(self) -> None:
        """No covariance to update."""


class EdgeErrors:
    """Measured errors of both edges of each slot, in pitches."""

    def __init__(
        self,
        forward: Sequence[float],
        backward: Sequence[float],
        open_share: SlotEstimate,
        slot_sd: float,
    ) -> None:
        """`forward`, `backward`: errors of the edges seen in that direction, (slots,), the latter
        without the error of the open share. `backward` may be empty: not measured; their standard
        deviation is then `slot_sd`. `open_share`: open share minus 0.5, with its variance.
        """
        self.forward = tuple(forward)
        self.backward = tuple(backward) or (0.0,) * len(self.forward)
        self.forward_variance = KNOWN_SD * KNOWN_SD
        self.backward_variance = self.forward_variance if backward else slot_sd * slot_sd
        self.open_share = open_share

    def alignments(self) -> Iterator[KnownSlotErrors]:
        """The disc in each possible rotation."""
        for first_slot in range(len(self.forward)):
            yield KnownSlotErrors(self, first_slot)


Slots = SlotErrors | KnownSlotErrors
