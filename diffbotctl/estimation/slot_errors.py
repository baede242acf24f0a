"""Position errors of the slots of an encoder disc, estimated while it turns.

Slots are cut with a tolerance, but each slot has the same error on every turn. The errors are
estimated together with the wheel's motion, as landmarks are in simultaneous localisation and
mapping (Smith, Self and Cheeseman 1990). After one turn this also corrects the first edges, whose
errors limit the estimate of the initial phase. One more error is that of the open share of the
pitch, which places the edges that are seen backward.
"""

from __future__ import annotations

from copy import copy
from typing import NamedTuple

LEARNABLE_SLOTS_MAX = 64  # finer discs have errors too small to be worth the computation
LEARNT_SD = 0.010  # pitches; learning ends when all errors are known to this, to save time

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

    error: float  # pitches, true position minus nominal
    variance: float


class SlotErrors:
    """Errors of the slots (pitches, true position minus nominal), estimated with the motion.

    `errors`: (entries,), one per slot and a last one for the open share. `covariance`: (6 +
    entries, entries), row by row, of the six states of the motion, and of the errors, with the
    errors.
    """

    __slots__ = (
        "covariance",
        "errors",
        "is_fixed",
        "is_started",
        "pending",
        "slot_variance",
        "slots",
    )

    is_fixed: bool

    def __init__(
        self, slots: int, slot_sd: float, open_share_sd: float, open_share_error: float = 0.0
    ) -> None:
        """`slots` of the disc, 0 to learn none; `open_share_error`: pitches, open share - 0.5."""
        self.slots = slots if slots <= LEARNABLE_SLOTS_MAX else 0
        self.slot_variance = slot_sd * slot_sd
        self.errors = [0.0] * self.slots + [open_share_error]
        entries = len(self.errors)
        rows = [[0.0] * entries for _ in range(6 + entries)]
        for entry in range(self.slots):
            rows[6 + entry][entry] = self.slot_variance
        rows[-1][-1] = open_share_sd * open_share_sd
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
        return slot % self.slots if is_forward else self.slots

    def edge_estimate(self, slot: int, is_forward: bool) -> SlotEstimate:
        """Error of the edge of `slot` and its variance, when learning has ended."""
        if not self.slots:
            return SlotEstimate(0.0 if is_forward else self.errors[-1], self.slot_variance)
        index = self.index(slot, is_forward)
        variance = self.variance_of(index) + (0.0 if is_forward else self.slot_variance)
        return SlotEstimate(self.errors[index], variance)

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
        self.is_fixed = max(variances) < limit
