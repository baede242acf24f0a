"""One hypothesis about which slot edges a wheel has passed, and in which direction.

A single-channel encoder does not measure the direction. Turning forward, the board sees an edge at
each whole z; turning backward, at each whole z plus the open share of the pitch. After a reversal
several edges are possible, and the hypothesis splits. Times are integer nanoseconds, lengths
pitches.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from math import log, sqrt
from typing import NamedTuple

from diffbotctl.estimation.wheel_kalman import WheelKalman, normal_cdf

OPEN_SHARE = 0.5  # of the pitch; mean of all discs
LOG_RATIO_MAX = 8.0  # natural log; branches less likely than the best by more are not followed
DIRECTION_PROBABILITY_MIN = 1e-6  # lower limit of the prior of a direction
# Multiple of the creep speed; a slower wheel stops almost at once
ROLLING_CREEP_RATIO = 3.0
# A bound is applied when the predicted probability outside of it exceeds:
OUTSIDE_MIN_AT_REST = 0.08  # repeated frames at rest carry no new information
OUTSIDE_MIN_MOVING = 0.001  # each frame carries new information
# The same while moving, for a board that reports edge times: the edge time will carry the same
# information, and applying both would count it twice. Only an overdue edge is evidence (of a wheel
# that is held).
OUTSIDE_MIN_EDGE_TIMES = 0.6


class WheelFrame(NamedTuple):
    """One frame of the board, for one wheel."""

    time: int
    """ns"""
    edge_count: int
    edge_time: int | None
    """ns, of the last edge; None for a board that does not report edge times"""
    drive: float
    """pitches/s at which the commanded motor settles"""
    drive_since: int | None
    """ns, when that command took effect, if known"""


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
    drive_direction: int = 0  # of the last drive: 1, -1, or 0 before the first
    edge_slot: int = 0  # slot of the last edge
    edge_direction: int = 0  # in which it was passed: 1, -1, or 0 before the first edge
    is_reversed: bool = False  # driven in the other direction since the last edge

    @property
    def last_edge(self) -> tuple[int, int, bool]:
        """Slot and direction of the last edge, and whether the drive has reversed since."""
        return self.edge_slot, self.edge_direction, self.is_reversed

    @property
    def key(self) -> tuple[tuple[int, int, bool], bool | None]:
        """Hypotheses with equal keys describe the same history."""
        return self.last_edge, self.motion.is_dry

    def copy(self) -> EdgeHypothesis:
        """An independent copy, for a split."""
        return replace(self, motion=self.motion.copy())

    @property
    def edge_place(self) -> float:
        """Nominal z of the last edge."""
        return _edge_place(self.edge_slot, self.edge_direction)

    def update(self, frame: WheelFrame) -> list[EdgeHypothesis]:
        """Apply one frame. Returns this hypothesis, or those into which it has split."""
        time, count, edge_time, drive, drive_since = frame
        steps = abs(count - self.count)
        self.count = count
        begin = self.time
        has_edge = edge_time is not None and steps != 0
        is_changing = drive != self.drive
        change_time = self._clamp(drive_since, time) if is_changing else time
        passed_time = self._clamp(edge_time, time) if has_edge else time
        if is_changing and change_time <= passed_time:
            self._advance(change_time)
            self._set_drive(drive)
            is_changing = False
        self._advance(passed_time)
        hypotheses = [self]
        if steps:
            window = 0.0 if has_edge else abs(self.motion.speed) * (time - begin) * 1e-9
            hypotheses = self._pass_edges(steps, window)
        for hypothesis in hypotheses:
            motion = hypothesis.motion
            if has_edge:
                motion.update_edge(
                    hypothesis.edge_place, hypothesis.edge_slot, hypothesis.edge_direction > 0
                )
            if is_changing:
                hypothesis._advance(change_time)
                hypothesis._set_drive(drive)
            hypothesis._advance(time)
            is_moving = steps != 0 or abs(motion.speed) > motion.priors.creep
            hypothesis._update_bounds(is_moving and not has_edge)
        return hypotheses

    def split_by_friction(self, drive: float) -> list[EdgeHypothesis]:
        """Split into hypotheses without and with dry friction when the wheel first coasts."""
        motion = self.motion
        if (
            motion.is_dry is not None
            or drive * motion.speed > 0.0
            or not motion.is_rolling(ROLLING_CREEP_RATIO)
        ):
            return [self]
        twin = self.copy()
        motion.is_dry, twin.motion.is_dry = False, True
        return [self, twin]

    def estimated_edge_time(self, time: int, steps: int) -> int:
        """Predicted time (ns) of the last of `steps` edges counted in the frame at `time`."""
        span = (time - self.time) * 1e-9
        speed = self.motion.speed
        if not self.motion.is_rolling(ROLLING_CREEP_RATIO):
            return time - int(0.5e9 * span)
        direction = -1 if speed < 0.0 else 1
        beyond = direction * (self.motion.z + speed * span - self.edge_place) - abs(steps)
        age = min(max(beyond / abs(speed), 0.0), span, 1.0 / abs(speed))
        return time - int(age * 1e9)

    def _update_bounds(self, is_moving: bool) -> None:
        if not self.edge_direction:
            return
        low, high = bounds(self.edge_place, self.edge_direction, self.is_reversed)
        if not is_moving:
            outside_min = OUTSIDE_MIN_AT_REST
        elif self.motion.priors.has_edge_times:
            outside_min = OUTSIDE_MIN_EDGE_TIMES
        else:
            outside_min = OUTSIDE_MIN_MOVING
        self.motion.update_bounds(low, high, outside_min)

    def _clamp(self, moment: int | None, time: int) -> int:
        return self.time if moment is None else min(max(moment, self.time), time)

    def _advance(self, time: int) -> None:
        """Predict to `time` with the present drive."""
        span = time - self.time
        if span > 0:
            self.time = time
            self.motion.predict(span * 1e-9, self.drive)

    def _set_drive(self, drive: float) -> None:
        """Change the drive, and keep track of reversals."""
        self.motion.command_changed(drive - self.drive)
        self.drive = drive
        if drive == 0.0:
            return
        direction = 1 if drive > 0.0 else -1
        if self.drive_direction == 0 and self.edge_direction == 0:
            self.edge_direction = direction
            if direction < 0:  # the phase is equally unknown relative to backward edges
                self.motion.shift(-OPEN_SHARE)
                self.edge_slot = 0
        self.drive_direction = direction
        if direction != self.edge_direction:
            self.is_reversed = True

    def _pass_edges(self, steps: int, window: float) -> list[EdgeHypothesis]:
        """Pass `steps` edges, the last of them now or within the last `window` pitches of travel.

        The sign of the board's count is ignored: the board only assumes the direction.
        """
        if not self.is_reversed:
            direction = self.edge_direction or self.drive_direction or 1
            self._set_edge(direction, self.edge_slot + direction * steps)
            return [self]
        branches = self._branches(steps, window)
        best = max(branch.fit for branch in branches)
        likely = [branch for branch in branches if branch.fit > best - LOG_RATIO_MAX]
        hypotheses = [self, *(self.copy() for _ in likely[1:])]
        for hypothesis, branch in zip(hypotheses, likely, strict=True):
            hypothesis.motion.log_likelihood += branch.log_prior
            hypothesis._set_edge(branch.direction, branch.slot)
        return hypotheses

    def _branches(self, steps: int, window: float) -> list[_Branch]:
        """All edges that may have been the last one."""
        motion = self.motion
        # Near zero the direction is uncertain by at least the creep speed.
        forward = normal_cdf(motion.speed / sqrt(motion.speed_variance + motion.priors.creep**2))
        branches = []
        for direction, probability in ((1, forward), (-1, 1.0 - forward)):
            log_prior = log(max(probability, DIRECTION_PROBABILITY_MIN))
            variance = motion.edge_variance(direction > 0) + window * window / 12.0
            for passed in (steps, steps - 1):
                slot = self.edge_slot + direction * passed
                error = motion.z - _edge_place(slot, direction) - 0.5 * direction * window
                fit = log_prior - 0.5 * error * error / variance
                branches.append(_Branch(fit, log_prior, direction, slot))
        return branches

    def _set_edge(self, direction: int, slot: int) -> None:
        """Record that the edge of `slot` was passed in `direction`."""
        self.edge_direction, self.edge_slot = direction, slot
        self.is_reversed = self.drive_direction != direction


def _edge_place(slot: int, direction: int) -> float:
    return slot + (OPEN_SHARE if direction < 0 else 0.0)


def bounds(place: float, direction: int, is_reversed: bool) -> tuple[float, float]:
    """Range of z after an edge at `place` that was passed in `direction`.

    After a reversal the next edge may be either edge of the slot, which narrows the range.
    """
    if direction > 0:
        return place - (1.0 - OPEN_SHARE if is_reversed else 0.0), place + 1.0
    return place - 1.0, place + (1.0 - OPEN_SHARE if is_reversed else 0.0)


def update_all(hypotheses: list[EdgeHypothesis], frame: WheelFrame) -> list[EdgeHypothesis]:
    """Update all hypotheses with one frame, including splits."""
    if hypotheses[0].motion.is_dry is None:
        hypotheses = [
            twin for hypothesis in hypotheses for twin in hypothesis.split_by_friction(frame.drive)
        ]
    return [branch for hypothesis in hypotheses for branch in hypothesis.update(frame)]


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
