"""One hypothesis about which slot edges a wheel has passed, and in which direction.

A single-channel encoder does not measure the direction. Turning forward, the board sees an edge at
each whole z; turning backward, at each whole z plus the open share of the pitch. After a reversal
several edges are possible, and the hypothesis splits. Times are integer nanoseconds, lengths
pitches.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from itertools import islice
from math import ceil, exp, floor, log, sqrt
from typing import NamedTuple

from diffbotctl.estimation.edge_faults import NO_FAULTS, EdgeFaults
from diffbotctl.estimation.likelihood import normal_cdf, robust_log_likelihood
from diffbotctl.estimation.pin_level import stretches
from diffbotctl.estimation.pose_history import FRAMES_MAX
from diffbotctl.estimation.wheel_kalman import MotorKind, WheelKalman

OPEN_SHARE = 0.5  # of the pitch; mean of all discs
SAME = 1e-9  # pitches; a smaller difference is one of rounding
LOG_RATIO_MAX = 8.0  # natural log; branches less likely than the best by more are not followed
DIRECTION_PROBABILITY_MIN = 1e-6  # lower limit of the prior of a direction
# Standard deviations of speed and lag up to which a wheel may roll on against its drive.
COAST_SDS = 2.0
COAST_GAIN = 0.5  # of the drive's speed; the least gain of a motor, with an empty battery
# Multiple of the creep speed; a slower wheel stops almost at once
ROLLING_CREEP_RATIO = 3.0
# Missed and additional edges. An edge this near to its expected place (pitches) is that edge: all
# others are farther away, and less likely from the start.
EXPECTED_MAX = 0.4
FAULT_LOG_RATIO_MAX = 6.0  # natural log; less likely explanations are not followed (about 1:400)
OVERDUE_LOG_RATIO_MAX = 5.0  # the same of an edge that is overdue, in each frame
# Edges that cancel in a count of both signs, and the log probability of each pair: the sign changes
# anywhere between the edges.
CANCELLED_MAX, LOG_CANCELLED = 6, log(0.5)
MISSED_MAX = 2  # in a row; a wheel without edges for longer is held
EXTRA_MAX = 4  # in a frame
# An additional edge mostly bounces, soon after the edge: log density in the pitch, and beyond.
EXTRA_PITCHES, EXTRA_LOG_DENSITY, LATE_EXTRA_LOG_DENSITY = 0.3, 1.1, -2.0
RESOLVED_SD_MAX = 0.2  # pitches; above it a missing edge may pass for a faster motor
PREDICTED_SD_MAX = 0.5  # pitches; above it an edge cannot be told from its neighbours
CERTAIN_PROBABILITY = 0.3  # of the count being right, above which no fault is considered
# A bound is applied when the predicted probability outside of it exceeds:
OUTSIDE_MIN_AT_REST = 0.08  # repeated frames at rest carry no new information
OUTSIDE_MIN_MOVING = 0.001  # each frame carries new information
# The same while moving, for a board that reports edge times: the edge time will carry the same
# information, and applying both would count it twice. Only an overdue edge is evidence (of a wheel
# that is held).
OUTSIDE_MIN_EDGE_TIMES = 0.6
# The same of the stretches in which the pin has the level that the board tells: at rest or after a
# reversal, and else. No edge time carries that information.
OUTSIDE_MIN_LEVEL_AT_REST, OUTSIDE_MIN_LEVEL = 0.08, 0.01
# A stretch is that in which the wheel is when it is this likely, given the level. One less likely
# than the minimum contradicts the prediction, unless the wheel stands so near to an edge (standard
# deviations) that the level may be either.
STRETCH_PROBABILITY, STRETCH_PROBABILITY_MIN, AT_EDGE_SDS = 0.95, 0.01, 2.0
LOG_WRONG_LEVEL = -4.0  # natural log; of a level that says nothing of the next edge (about 1:50)


class DriveChange(NamedTuple):
    """A command of a wheel and when it took effect; as in a WheelFrame."""

    time: int
    drive: float
    duty: float


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
    duty: float
    """of that command"""
    skipped: DriveChange | None = None
    """the command before, where no frame showed it"""
    is_mixed: bool = False
    """whether edges of both signs may have been counted, of which pairs cancel"""
    has_counted_level: bool | None = None
    """whether the pin has the level to which a counted edge leads; None: not told"""


class _Branch(NamedTuple):
    """One candidate for the edge that was passed."""

    fit: float  # log likelihood including the prior
    log_prior: float  # log of the direction's probability
    direction: int
    slot: int


class _Count(NamedTuple):
    """One candidate for the number of edges that were passed."""

    fit: float  # log likelihood including the prior
    log_prior: float
    missed: int  # edges passed but not counted; negative: counted but not passed
    is_timed: bool  # whether the edge time is that of the last edge passed


EXPECTED_COUNT = (_Count(0.0, 0.0, 0, True),)


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
    is_placed: bool = False  # whether the pin's level has told where in a slot it started
    # The last level since the last edge and before a reversal (see WheelFrame), and whether the
    # wheel was at rest then.
    turning_level: bool | None = None
    was_at_rest: bool = False
    is_timed: bool = False  # whether the edge time of this frame is that of `edge_slot`
    # Largest speed (pitches/s) at which the wheel may still roll on against a reversed drive, which
    # only brakes it.
    coasting_speed: float = 0.0
    # Travel (pitches) since the start, but for its phase, after each of the last frames.
    travels: list[float] = field(default_factory=list)

    @property
    def last_edge(self) -> tuple[int, int, bool]:
        """Slot and direction of the last edge, and whether the drive has reversed since."""
        return self.edge_slot, self.edge_direction, self.is_reversed

    @property
    def key(self) -> tuple[tuple[int, int, bool], bool | None, MotorKind]:
        """Hypotheses with equal keys describe the same history."""
        return self.last_edge, self.motion.is_dry, self.motion.kind

    def moves_as(self, other: EdgeHypothesis) -> bool:
        """Whether both passed the last edge in the same direction, and neither or both reverse."""
        same = self.edge_direction == other.edge_direction
        return same and self.is_reversed == other.is_reversed

    def copy(self) -> EdgeHypothesis:
        """An independent copy, for a split."""
        return replace(self, motion=self.motion.copy(), travels=self.travels.copy())

    def remember(self) -> None:
        """Note the travel at the end of a frame."""
        travels, motion = self.travels, self.motion
        travels.append(motion.z - motion.z_shift)
        if len(travels) >= 2 * FRAMES_MAX:
            del travels[:FRAMES_MAX]

    def frames_since(self, other: EdgeHypothesis) -> int:
        """Frames since the travel of `other` had less than half of its present difference."""
        limit = 0.5 * abs(other.travels[-1] - self.travels[-1])
        pairs = zip(reversed(self.travels), reversed(other.travels), strict=False)
        for frames, (own, its) in enumerate(islice(pairs, FRAMES_MAX)):
            if -limit < its - own < limit:
                return frames
        return min(len(self.travels), len(other.travels), FRAMES_MAX)

    def corrections(self, other: EdgeHypothesis) -> list[float]:
        """What the travel of `other` exceeds the own one by (pitches) in each of the last frames,
        from the first one in which they differ."""
        own, its = self.travels[-FRAMES_MAX:], other.travels[-FRAMES_MAX:]
        differences = [b - a for a, b in zip(own, its, strict=False)]
        added = [b - a for a, b in zip([0.0, *differences], differences, strict=False)]
        first = next((n for n, each in enumerate(added) if abs(each) > SAME), len(added))
        return added[first:]

    @property
    def edge_place(self) -> float:
        """Nominal z of the last edge."""
        return _edge_place(self.edge_slot, self.edge_direction)

    def update(self, frame: WheelFrame) -> list[EdgeHypothesis]:
        """Apply one frame. Returns this hypothesis, or those into which it has split."""
        hypotheses = self._update_count(frame)
        if frame.has_counted_level is not None:
            for hypothesis in hypotheses:
                hypothesis._update_level(frame.has_counted_level)
        return hypotheses

    def _update_count(self, frame: WheelFrame) -> list[EdgeHypothesis]:
        """Apply the count of a frame and its time."""
        steps = abs(frame.edge_count - self.count)
        self.count = frame.edge_count
        if not frame.is_mixed or not self.motion.is_rolling(ROLLING_CREEP_RATIO):
            return self._update(frame, steps)
        span = (frame.time - self.time) * 1e-9
        most = self.motion.largest_speed(COAST_SDS) * span + 1.0
        branches = []
        for number in range(steps + 2, min(int(most), steps + CANCELLED_MAX) + 1, 2):
            twin = self.copy()
            twin.motion.log_likelihood += (number - steps) // 2 * LOG_CANCELLED
            branches += twin._update(frame, number)
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
            motion.release(frame.drive, frame.duty, (time - begin) * 1e-9)
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

    def _update_bounds(self, is_moving: bool, has_edge: bool) -> list[EdgeHypothesis]:
        """Update by the knowledge that no further edge was passed. Splits when one is overdue."""
        if not self.edge_direction:
            return [self]
        motion = self.motion
        low, high = bounds(
            _edge_place(self.edge_slot, self.edge_direction), self.edge_direction, self.is_reversed
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
        if self.unseen_edges:
            return
        motion, direction = self.motion, self.edge_direction
        open_share = OPEN_SHARE + motion.priors.open_share_error
        if not direction:
            if not self.is_placed:
                self.is_placed = True
                motion.update_uniform(*stretches(0.0, 1.0, has_counted_level, open_share)[0])
            return
        if not self.is_reversed or (self.turning_level is None and motion.speed == 0.0):
            self.turning_level, self.was_at_rest = has_counted_level, motion.speed == 0.0
        low, high = bounds(_edge_place(self.edge_slot, direction), direction, self.is_reversed)
        parts = stretches(low, high, has_counted_level, open_share)
        likely = [motion.probability_within(*part) for part in parts]
        probability = sum(likely, 0.0)
        is_at_rest = motion.speed == 0.0 or self.is_reversed
        outside_min = OUTSIDE_MIN_LEVEL_AT_REST if is_at_rest else OUTSIDE_MIN_LEVEL
        if probability > 1.0 - outside_min:
            return
        if probability < STRETCH_PROBABILITY_MIN:
            if motion.is_near(low, AT_EDGE_SDS) or motion.is_near(high, AT_EDGE_SDS):
                motion.log_likelihood += log(STRETCH_PROBABILITY_MIN)
                return
            part = min(parts, key=lambda part: max(part[0] - motion.z, motion.z - part[1]))
        else:
            part = parts[likely.index(max(likely))]
            if max(likely) < STRETCH_PROBABILITY * probability:
                motion.log_likelihood += log(probability)
                return
        motion.update_bounds(*part)

    def _may_be_missed(self, probability: float) -> bool:
        return (
            not self.is_reversed
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
        twin = self.copy()
        twin.motion.log_likelihood += log_prior
        twin.edge_slot += direction
        twin.unseen_edges += 1
        twin.faults = self.faults.added(0, 1)
        if not twin.motion.priors.has_edge_times:
            twin.motion.update_bounds(low + direction, high + direction)
        return twin

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
            self.edge_slot = 0

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
        counts = (
            self._timed_counts(direction, steps)
            if self.is_timed
            else self._untimed_counts(direction, steps)
        )
        before, slot = self.faults, self.edge_slot
        if self.motion.edge_variance(direction > 0) > RESOLVED_SD_MAX * RESOLVED_SD_MAX:
            before = before.added_unresolved(steps, self.motion.is_suspect)
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

    @property
    def _may_be_additional(self) -> bool:
        """An edge bounces while it passes: a wheel that stands gives no additional ones."""
        return self.motion.is_rolling(ROLLING_CREEP_RATIO)

    def _timed_counts(self, direction: int, steps: int) -> Sequence[_Count]:
        """Candidates for the edges passed until the edge time, where the motion stands."""
        motion = self.motion
        place = _edge_place(self.edge_slot + direction * steps, direction)
        beyond = direction * (motion.z - place)
        variance = motion.edge_variance(direction > 0)
        if (
            -EXPECTED_MAX < beyond < EXPECTED_MAX
            or variance > PREDICTED_SD_MAX**2
            or not motion.finds_faults
        ):
            return EXPECTED_COUNT
        counts, cost = [], motion.priors.change_cost
        extra_max = min(steps, EXTRA_MAX) if self._may_be_additional else 0
        for missed in sorted({0, floor(beyond), ceil(beyond)}):
            if not -extra_max <= missed <= MISSED_MAX:
                continue
            log_prior = self.faults.log_prior(missed)
            fit = robust_log_likelihood(beyond - missed, variance, cost)
            # The time may be that of an additional edge, which comes at any place in the pitch.
            early = (
                EXTRA_LOG_DENSITY
                if beyond - floor(beyond) < EXTRA_PITCHES
                else LATE_EXTRA_LOG_DENSITY
            )
            is_timed = steps + missed > 0 and (missed >= 0 or fit > early)
            fit = fit if is_timed else early
            counts.append(_Count(fit + log_prior, log_prior, missed, is_timed))
        return counts or EXPECTED_COUNT

    def _untimed_counts(self, direction: int, steps: int) -> Sequence[_Count]:
        """Candidates for the edges passed until the time of the frame, where the motion stands."""
        counts: list[_Count] = []
        if not self.motion.finds_faults:
            return [_Count(0.0, 0.0, 0, False)]
        others = (-1, 1) if self._may_be_additional else (1,)
        for missed in (0, *others):
            log_prior = self.faults.log_prior(missed)
            place = _edge_place(self.edge_slot + direction * (steps + missed), direction)
            fit = self.motion.bounds_log_likelihood(*bounds(place, direction, False))
            counts.append(_Count(fit + log_prior, log_prior, missed, False))
            if missed == 0 and fit > log(CERTAIN_PROBABILITY):
                break
        return counts

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
                error = motion.z - _edge_place(slot, direction) - 0.5 * direction * window
                prior = log_prior
                if direction != self.edge_direction:
                    prior += self._level_log_prior(is_first_edge_behind=passed == steps)
                fit = prior - 0.5 * error * error / variance
                branches.append(_Branch(fit, prior, direction, slot))
        return branches

    def _level_log_prior(self, is_first_edge_behind: bool) -> float:
        """Log probability, by the level of the pin before it reversed, of the first edge after.

        Beyond the open share after the last edge, the pin has not the counted level, and the wheel
        first comes back past the place where that share ends; else past the one behind the edge.
        A wheel that had the counted level may have rolled on, unless it was at rest.
        """
        if self.turning_level is None or is_first_edge_behind == self.turning_level:
            return 0.0
        return LOG_WRONG_LEVEL if not self.turning_level or self.was_at_rest else 0.0

    def _set_edge(self, direction: int, slot: int) -> None:
        """Record that the edge of `slot` was passed in `direction`."""
        self.edge_direction, self.edge_slot = direction, slot
        self.turning_level = None
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
    branches = []
    for hypothesis in hypotheses:
        branches += hypothesis.update(frame)
    for branch in branches:
        branch.remember()
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
