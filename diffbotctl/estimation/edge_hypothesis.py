"""One hypothesis about which slot edges a wheel has passed, and in which direction.

A single-channel encoder does not measure the direction. Turning forward, the board sees an edge at
each whole z; turning backward, at each whole z plus the open share of the pitch. After a reversal
several edges are possible, and the hypothesis splits. Times are integer nanoseconds, lengths
pitches.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from math import exp, log, sqrt
from typing import NamedTuple

from diffbotctl.estimation.edge_counts import (
    CERTAIN_PROBABILITY,
    MISSED_MAX,
    NO_FAULTS,
    OPEN_SHARE,
    PREDICTED_SD_MAX,
    EdgeFaults,
    bounds,
    counts_until_edge,
    counts_until_frame,
    edge_place,
)
from diffbotctl.estimation.pin_level import TurningLevel, place_by_level, update_by_level
from diffbotctl.estimation.predicted_wheel import MotorKind
from diffbotctl.estimation.wheel_frame import DriveChange, WheelFrame
from diffbotctl.estimation.wheel_kalman import WheelKalman, normal_cdf

LOG_RATIO_MAX = 8.0  # natural log; branches less likely than the best by more are not followed
DIRECTION_PROBABILITY_MIN = 1e-6  # lower limit of the prior of a direction
# Standard deviations of speed and lag up to which a wheel may roll on against its drive.
COAST_SDS = 2.0
COAST_GAIN = 0.5  # of the drive's speed; the least gain of a motor, with an empty battery
# Multiple of the creep speed; a slower wheel stops almost at once
ROLLING_CREEP_RATIO = 3.0
# Natural log; less likely explanations by faults are not followed (about 1:400).
FAULT_LOG_RATIO_MAX = 6.0
OVERDUE_LOG_RATIO_MAX = 5.0  # the same of an edge that is overdue, in each frame
# Edges that cancel in a count of both signs, and the log probability of each pair: the sign changes
# anywhere between the edges.
CANCELLED_MAX, LOG_CANCELLED = 6, log(0.5)
RESOLVED_SD_MAX = 0.2  # pitches; above it a missing edge may pass for a faster motor
# A bound is applied when the predicted probability outside of it exceeds:
OUTSIDE_MIN_AT_REST = 0.08  # repeated frames at rest carry no new information
OUTSIDE_MIN_MOVING = 0.001  # each frame carries new information
# The same while moving, for a board that reports edge times: the edge time will carry the same
# information, and applying both would count it twice. Only an overdue edge is evidence (of a wheel
# that is held).
OUTSIDE_MIN_EDGE_TIMES = 0.6


class _Branch(NamedTuple):
    """One candidate for the edge that was passed."""

    fit: float  # log likelihood including the prior
    log_prior: float  # log of the direction's probability
    direction: int
    slot: int


@dataclass(slots=True, eq=False)
class EdgeHypothesis:
    """The motion of one wheel, and the edge that was passed last."""

    motion: WheelKalman
    time: int
    count: int
    drive: float = 0.0
    duty: float = 0.0
    drive_direction: int = 0  # of the last drive: 1, -1, or 0 before the first
    edge_slot: int = 0  # slot of the last edge
    edge_direction: int = 0  # in which it was passed: 1, -1, or 0 before the first edge
    is_reversed: bool = False  # driven in the other direction since the last edge
    faults: EdgeFaults = NO_FAULTS
    unseen_edges: int = 0  # edges assumed to be missed since the last one counted
    is_placed: bool = False  # whether the pin's level has shown where in a slot it started
    # The last level since the last edge and before a reversal.
    turning_level: TurningLevel | None = None
    is_timed: bool = False  # whether the edge time of this frame is that of `edge_slot`
    # Largest speed (pitches/s) at which the wheel may still roll on against a reversed drive, which
    # only brakes it.
    coasting_speed: float = 0.0

    @property
    def last_edge(self) -> tuple[int, int, bool]:
        """Slot and direction of the last edge, and whether the drive has reversed since."""
        return self.edge_slot, self.edge_direction, self.is_reversed

    @property
    def key(self) -> tuple[tuple[int, int, bool], bool | None, MotorKind]:
        """Hypotheses with equal keys describe the same history."""
        return self.last_edge, self.motion.is_dry, self.motion.kind

    def copy(self) -> EdgeHypothesis:
        """An independent copy, for a split."""
        return replace(self, motion=self.motion.copy())

    @property
    def edge_place(self) -> float:
        """Nominal z of the last edge."""
        return edge_place(self.edge_slot, self.edge_direction)

    def update(self, frame: WheelFrame) -> list[EdgeHypothesis]:
        """Apply one frame. Returns this hypothesis, or those into which it has split."""
        hypotheses = self._update_count(frame)
        if frame.has_counted_level is not None:
            for hypothesis in hypotheses:
                hypothesis._update_level(frame.has_counted_level)
        return hypotheses

    def _update_count(self, frame: WheelFrame) -> list[EdgeHypothesis]:
        steps = abs(frame.edge_count - self.count)
        self.count = frame.edge_count
        if not frame.is_mixed or not self.motion.is_rolling(ROLLING_CREEP_RATIO):
            return self._update(frame, steps)
        span = (frame.time - self.time) * 1e-9
        most = self.motion.largest_speed(COAST_SDS) * span + 1.0
        branches = []
        for number in range(steps + 2, min(int(most), steps + CANCELLED_MAX) + 1, 2):
            branch = self.copy()
            branch.motion.log_likelihood += (number - steps) // 2 * LOG_CANCELLED
            branches += branch._update(frame, number)
        return self._update(frame, steps) + branches

    def _update(self, frame: WheelFrame, steps: int) -> list[EdgeHypothesis]:
        """Apply one frame with `steps` edges."""
        time, edge_time = frame.time, frame.edge_time
        if not steps and frame.skipped is None:
            return self._update_without_edge(frame)
        begin = self.time
        has_edge = edge_time is not None and steps != 0
        passed_time = self._clamp(edge_time, time) if has_edge else time
        changes = self._drive_changes(frame)
        while changes and changes[0].time <= passed_time:
            self._change_drive(changes.pop(0))
        self._advance(passed_time)
        self.is_timed = has_edge
        motion = self.motion
        if not steps:
            self._end_frame(time, changes)
            return self._update_bounds(abs(motion.speed) > motion.priors.creep, False)
        if motion.speed == 0.0 and frame.drive * self.edge_direction > 0.0:
            motion.release(frame.drive, (time - begin) * 1e-9)
        window = 0.0 if has_edge else abs(motion.speed) * (time - begin) * 1e-9
        branches = []
        for hypothesis in self._pass_edges(steps, window):
            motion = hypothesis.motion
            if hypothesis.is_timed:
                motion.update_edge(
                    hypothesis.edge_place, hypothesis.edge_slot, hypothesis.edge_direction > 0
                )
            hypothesis._end_frame(time, changes)
            if hypothesis.is_reversed:
                hypothesis.coasting_speed = min(
                    hypothesis.coasting_speed, motion.largest_speed(COAST_SDS)
                )
            branches += hypothesis._update_bounds(not hypothesis.is_timed, has_edge)
        return branches

    def _update_without_edge(self, frame: WheelFrame) -> list[EdgeHypothesis]:
        """Apply the usual frame: at most one command, and no edge."""
        if frame.duty != self.duty:
            self._advance(self._clamp(frame.drive_since, frame.time))
            self._set_drive(frame.drive, frame.duty)
        self._advance(frame.time)
        self.is_timed = False
        motion = self.motion
        return self._update_bounds(abs(motion.speed) > motion.priors.creep, False)

    def _end_frame(self, time: int, changes: list[DriveChange]) -> None:
        """Predict to the end of the frame at `time`, past the `changes` after its last edge."""
        for change in changes:
            self._change_drive(change)
        self._advance(time)

    def split_by_friction(self, drive: float) -> list[EdgeHypothesis]:
        """Split into hypotheses without and with dry friction when the wheel first coasts."""
        motion = self.motion
        if (
            motion.is_dry is not None
            or drive * motion.speed > 0.0
            or not motion.is_rolling(ROLLING_CREEP_RATIO)
        ):
            return [self]
        branch = self.copy()
        motion.is_dry, branch.motion.is_dry = False, True
        return [self, branch]

    def _update_bounds(self, is_moving: bool, has_edge: bool) -> list[EdgeHypothesis]:
        """Update by the knowledge that no further edge was passed. Splits when one is overdue."""
        if not self.edge_direction:
            return [self]
        motion = self.motion
        low, high = bounds(
            edge_place(self.edge_slot, self.edge_direction), self.edge_direction, self.is_reversed
        )
        if not is_moving:
            outside_min = OUTSIDE_MIN_AT_REST
        elif motion.priors.has_edge_times and not (has_edge and not self.is_timed):
            outside_min = OUTSIDE_MIN_EDGE_TIMES
        else:
            outside_min = OUTSIDE_MIN_MOVING
        probability = motion.probability_within(low, high)
        if probability > 1.0 - outside_min:
            return [self]
        hypotheses = [self]
        if self._may_be_missed(probability):
            missed = self._with_missed_edge(low, high)
            if missed is not None:
                hypotheses.append(missed)
        motion.update_bounds(low, high)
        return hypotheses

    def _update_level(self, has_counted_level: bool) -> None:
        """Update by the level of the pin. Where a pulse is missing, so is its level."""
        motion, direction = self.motion, self.edge_direction
        if self.unseen_edges:
            return
        if not direction:
            if not self.is_placed:
                self.is_placed = True
                place_by_level(motion, has_counted_level)
            return
        is_at_rest = motion.speed == 0.0
        if not self.is_reversed or (self.turning_level is None and is_at_rest):
            self.turning_level = TurningLevel(has_counted_level, is_at_rest)
        low, high = bounds(self.edge_place, direction, self.is_reversed)
        update_by_level(motion, low, high, has_counted_level, is_at_rest or self.is_reversed)

    def _may_be_missed(self, probability: float) -> bool:
        # A wheel whose first edge is overdue is still held by friction: the next edge shows more.
        return (
            not self.is_reversed
            and self.motion.edges_since_rest > 0
            and self.motion.finds_faults
            and self.unseen_edges < MISSED_MAX
            and probability < CERTAIN_PROBABILITY
            and self.motion.is_rolling(ROLLING_CREEP_RATIO)
            and self.motion.edge_variance(True) < PREDICTED_SD_MAX * PREDICTED_SD_MAX
        )

    def _with_missed_edge(self, low: float, high: float) -> EdgeHypothesis | None:
        """The hypothesis that the overdue edge was passed and not counted, if it is likely; without
        it z is between `low` and `high`."""
        direction, motion = self.edge_direction, self.motion
        log_prior = self.faults.log_prior(1)
        beyond = motion.bounds_log_likelihood(low + direction, high + direction)
        if log_prior + beyond < motion.bounds_log_likelihood(low, high) - OVERDUE_LOG_RATIO_MAX:
            return None
        branch = self.copy()
        branch.motion.log_likelihood += log_prior
        branch.edge_slot += direction
        branch.unseen_edges += 1
        branch.faults = self.faults.added(0, 1)
        if not branch.motion.priors.has_edge_times:
            branch.motion.update_bounds(low + direction, high + direction)
        return branch

    def _drive_changes(self, frame: WheelFrame) -> list[DriveChange]:
        """The commands that took effect since the last frame, in their order."""
        if frame.skipped is None and (frame.drive, frame.duty) == (self.drive, self.duty):
            return []
        last = DriveChange(self._clamp(frame.drive_since, frame.time), frame.drive, frame.duty)
        return [last] if frame.skipped is None else [frame.skipped, last]

    def _change_drive(self, change: DriveChange) -> None:
        self._advance(change.time)
        self._set_drive(change.drive, change.duty)

    def _clamp(self, moment: int | None, time: int) -> int:
        if moment is None or moment < self.time:
            moment = self.time
        return moment if moment < time else time

    def _advance(self, time: int) -> None:
        """Predict to `time` with the present drive."""
        span = time - self.time
        if span > 0:
            self.time = time
            self.motion.predict(span * 1e-9, self.drive, self.duty)
            if self.coasting_speed:
                self._brake(span * 1e-9)

    def _brake(self, span: float) -> None:
        """Reduce `coasting_speed` by `span` seconds of the slowest plausible braking."""
        priors = self.motion.priors
        lag = priors.lag * exp(COAST_SDS * priors.lag_ratio)
        drive = COAST_GAIN * abs(self.drive)
        speed = (self.coasting_speed + drive) * exp(-span / lag) - drive
        self.coasting_speed = speed if speed > priors.creep else 0.0

    def _set_drive(self, drive: float, duty: float) -> None:
        """Change the drive, and keep track of reversals."""
        self.motion.command_changed(drive - self.drive)
        self.drive, self.duty = drive, duty
        if drive == 0.0:
            return
        direction = 1 if drive > 0.0 else -1
        if self.drive_direction == 0 and self.edge_direction == 0:
            self.edge_direction = direction
            if direction < 0:
                self._start_backward()
        if direction != self.drive_direction:
            self.motion.drive_reversed()
            self.coasting_speed = self.motion.largest_speed(COAST_SDS)
        self.drive_direction = direction
        if direction != self.edge_direction:
            self.is_reversed = True

    def _start_backward(self) -> None:
        """Set the edge before which a wheel has started that turns backward first."""
        if self.is_placed:
            self.edge_slot = 1 if self.motion.z > OPEN_SHARE else 0
        else:  # the phase is equally unknown relative to backward edges
            self.motion.shift(-OPEN_SHARE)

    def _pass_edges(self, steps: int, window: float) -> list[EdgeHypothesis]:
        """Pass `steps` edges, the last of them now or within the last `window` pitches of travel.

        The sign of the board's count is ignored: the board only assumes the direction.
        """
        if not self.is_reversed:
            direction = self.edge_direction or self.drive_direction or 1
            return self._pass_in(direction, steps)
        self.unseen_edges = 0
        self.faults = self.faults.added(steps, 0)
        branches = self._branches(steps, window)
        best = max(branch.fit for branch in branches)
        likely = [branch for branch in branches if branch.fit > best - LOG_RATIO_MAX]
        hypotheses = [self, *(self.copy() for _ in likely[1:])]
        for hypothesis, branch in zip(hypotheses, likely, strict=True):
            hypothesis.motion.log_likelihood += branch.log_prior
            hypothesis._set_edge(branch.direction, branch.slot)
        return hypotheses

    def _pass_in(self, direction: int, steps: int) -> list[EdgeHypothesis]:
        """Pass `steps` edges in a known direction, or more if some were not counted, or fewer."""
        motion = self.motion
        # An edge bounces while it passes: a wheel that stands gives no additional ones.
        bounces = motion.is_rolling(ROLLING_CREEP_RATIO)
        counts = (
            counts_until_edge(motion, self.faults, self.edge_slot, direction, steps, bounces)
            if self.is_timed
            else counts_until_frame(motion, self.faults, self.edge_slot, direction, steps, bounces)
        )
        before, slot = self.faults, self.edge_slot
        if motion.edge_variance(direction > 0) > RESOLVED_SD_MAX * RESOLVED_SD_MAX:
            before = before.added_unresolved(steps, motion.is_suspect)
        hypotheses = [self]
        if len(counts) > 1:
            best = max(count.fit for count in counts)
            counts = [count for count in counts if count.fit > best - FAULT_LOG_RATIO_MAX]
            hypotheses += [self.copy() for _ in counts[1:]]
        for hypothesis, count in zip(hypotheses, counts, strict=True):
            hypothesis.motion.log_likelihood += count.log_prior
            hypothesis._set_edge(direction, slot + direction * (steps + count.missed))
            hypothesis.faults = before.added(steps, count.missed)
            hypothesis.is_timed = count.is_timed
            hypothesis.unseen_edges = 0
        return hypotheses

    def _branches(self, steps: int, window: float) -> list[_Branch]:
        """All edges that may have been the last one."""
        motion = self.motion
        # Near zero the direction is uncertain by at least the creep speed.
        forward = normal_cdf(motion.speed / sqrt(motion.speed_variance + motion.priors.creep**2))
        branches = []
        for direction, probability in ((1, forward), (-1, 1.0 - forward)):
            if direction == -self.drive_direction and not self.coasting_speed:
                continue  # a wheel at rest never starts against its drive
            log_prior = log(max(probability, DIRECTION_PROBABILITY_MIN))
            variance = motion.edge_variance(direction > 0) + window * window / 12.0
            for passed in (steps, steps - 1):
                slot = self.edge_slot + direction * passed
                error = motion.z - edge_place(slot, direction) - 0.5 * direction * window
                prior = log_prior
                if direction != self.edge_direction and self.turning_level is not None:
                    prior += self.turning_level.first_edge_log_prior(is_behind=passed == steps)
                fit = prior - 0.5 * error * error / variance
                branches.append(_Branch(fit, prior, direction, slot))
        return branches

    def _set_edge(self, direction: int, slot: int) -> None:
        """Record that the edge of `slot` was passed in `direction`."""
        self.motion.edges_since_rest += max(abs(slot - self.edge_slot), 1)
        self.edge_direction, self.edge_slot = direction, slot
        self.turning_level = None
        self.is_reversed = self.drive_direction != direction


def update_all(hypotheses: list[EdgeHypothesis], frame: WheelFrame) -> list[EdgeHypothesis]:
    if hypotheses[0].motion.is_dry is None:
        hypotheses = [
            branch
            for hypothesis in hypotheses
            for branch in hypothesis.split_by_friction(frame.drive)
        ]
    branches = []
    for hypothesis in hypotheses:
        branches += hypothesis.update(frame)
    return branches


def prune(
    hypotheses: list[EdgeHypothesis],
    count_max: int,
    log_ratio_max: float,
    key: Callable[[EdgeHypothesis], object],
) -> list[EdgeHypothesis]:
    """The most likely hypotheses, best first; one for each `key`.

    At most `count_max`, and none less likely than the best by more than `log_ratio_max`.
    """
    ranked = sorted(hypotheses, key=lambda hypothesis: -hypothesis.motion.log_likelihood)
    limit = ranked[0].motion.log_likelihood - log_ratio_max
    kept: dict[object, EdgeHypothesis] = {}
    for hypothesis in ranked[:count_max]:
        if hypothesis.motion.log_likelihood >= limit:
            kept.setdefault(key(hypothesis), hypothesis)
    return list(kept.values())
