"""Travel of one wheel in metres, from the counts and commands of the board."""

from __future__ import annotations

from math import copysign, pi, sqrt

from diffbotctl.control.speed_loop import SpeedLoopMirror, speed_gains
from diffbotctl.estimation.edge_intervals import EdgeIntervals
from diffbotctl.estimation.fine_wheel import (
    PUSHED_EDGES_MIN,
    FineWheelOdometer,
    pushed_variance,
)
from diffbotctl.estimation.lost_edges import LostEdges, MotorGain
from diffbotctl.estimation.predicted_wheel import Response, no_load_speed
from diffbotctl.estimation.priors import Priors
from diffbotctl.estimation.slot_errors import EdgeErrors, SlotEstimate
from diffbotctl.estimation.wheel_filter import LOG_RATIO_MAX, WheelFilter
from diffbotctl.estimation.wheel_frame import DriveChange, WheelFrame
from diffbotctl.estimation.wheel_side import EncoderConfig, LinkTiming, SideConfig, settled_speed

GAP_SDS = 3.0  # by which the model and the counts may differ
DRY = Response(is_free_wheeling=False, is_dry=True)
DRY_LOG_COST = 1.0  # natural log of the ratio of motors that coast with their lag to such
# Pitches, for each reversal: how a motor that free-wheels between the pulses breaks loose depends
# on load and battery more than its model knows, and decides which of two edges was the first one.
FREE_WHEELING_REVERSAL_SD = 0.15
# The same where the level of the pin tells on which side of an edge the wheel has stopped; and of a
# motor of an unusual kind.
LEVEL_REVERSAL_SD, UNUSUAL_LEVEL_REVERSAL_SD = 0.1, 0.2
COMPARED_EDGES_MIN = 12.0  # from the start on, of both wheels whose gains are compared
ONE_EDGE_SD = 0.5  # pitches, of a wheel at rest that gives one edge
MEASURED_OPEN_SHARE_SD = 0.01  # pitches; it differs a little with the speed


class WheelOdometer:
    """A wheel whose travel is estimated with the model of its motor."""

    def __init__(self, side: SideConfig, time: int, count: int, timing: LinkTiming) -> None:
        """Start at `time` (ns) with the board's `count`."""
        motor, slots = side.motor, side.encoder.slots
        self.pitch = pi * side.wheel.diameter / slots
        self.pitches_per_rad = 0.5 * slots / pi
        self.rated = motor.rated
        self.static = motor.loop.static if motor.friction is None else motor.friction
        self.count = self.first_count = count
        friction = self.static / (1.0 - self.static) * motor.rated
        brakes = motor.idle == "brake"
        priors = Priors(
            lag=motor.lag,
            friction=friction,
            dead_band=self.static,
            breakaway=motor.breakaway if timing.has_duties else None,
            brakes=brakes,
            shorted_speed=motor.bridge_share * no_load_speed(motor.rated + friction)
            if brakes
            else 0.0,
            decay=motor.decay,
            frame_time=timing.frame_time,
            command_time=timing.command_time,
            has_edge_times=timing.has_edge_times,
        )
        if side.encoder.open_share is not None:
            priors = priors._replace(
                open_share=MEASURED_OPEN_SHARE_SD,
                open_share_error=side.encoder.open_share - 0.5,
            )
        edges = known_edges(side.encoder, priors)
        self.filter = WheelFilter(priors, time, count, slots, edges)
        self.mirror = SpeedLoopMirror(speed_gains(motor), slots, time)
        # Without edge times the filter estimates them, as nobody else does.
        self.shares_mirror = timing.has_edge_times and slots == side.encoder.counts
        self.mirrored_duty: float | None = None
        """at the end of the last frame, where it follows from the frames alone"""
        self.counting = FineWheelOdometer(side, time, count, timing, finds_steps=False)
        self.intervals = EdgeIntervals()
        self.skipped: tuple[int, float] | None = None  # command in the next frame: ns, value
        self.has_levels = False  # whether the board tells those of the pin
        self.has_counted_level: bool | None = None  # in the next frame
        self.travel = 0.0  # m, since the last report
        # Variances in m2: of that travel; of all travel, if the best hypothesis is right; of the
        # present position in the slot, which the model of a usual motor includes; and between the
        # hypotheses.
        self.added_variance = self.variance = self.end_variance = self.disagreement = 0.0
        self.fault_share = 0.0
        """share of the edges that were missed or counted twice, and are no hypotheses"""
        self.lost_share, self.lost_text = 0.0, ""  # the same of every second edge
        self.start_correction = 0.0  # m, added by a better estimate of the initial phase
        # m, added by another hypothesis in each of the last frames
        self.late_corrections: list[float] = []
        self.disagreement_frames = 0
        self.reported_pushed = self.reported_reversals = 0  # edges; reversals
        self.reported_travel = 0.0  # pitches
        self.reported_start = self.filter.motion.start
        self.reported_hypothesis = self.filter.hypotheses[0]

    @property
    def speed(self) -> float:
        """m/s"""
        return self.filter.hypotheses[0].motion.speed * self.pitch

    @property
    def coasting_travel(self) -> float:
        """m, without sign, that it travels until it rests when it is released now."""
        return self.filter.motion.coasting_travel * self.pitch

    @property
    def fault(self) -> str:
        """Why its travel is known less well than usual, or an empty text."""
        pushed, faults = self.counting.pushed_text, self.filter.hypotheses[0].faults
        gaps = self.counting.gaps.text
        if not pushed and not self.lost_text and not gaps:
            return faults.text or (self.intervals.text if self.filter.is_unusual else "")
        # The edges of a push look like edges in excess to the model of a motor without power.
        if pushed and faults.missed <= faults.extra <= self.counting.pushed_in_all:
            return pushed
        return "; ".join(filter(None, (pushed, self.lost_text, gaps, faults.text)))

    @property
    def pushed_travel(self) -> float:
        """Standard deviation (m) of what somebody has turned it since the pose was set."""
        return self.counting.pushed_travel

    def set_other_driven(self, is_driven: bool) -> None:
        """Whether the other wheel, which may drag this one, has a command in the next frame."""
        self.counting.is_other_driven = is_driven

    def pose_is_set(self) -> None:
        """What happened before does not matter any more."""
        self.counting.pose_is_set()

    def skipped_command(self, command: float, is_duty: bool, since: int) -> None:
        """Take a command that was replaced in the next frame; in effect since `since` (ns)."""
        self.skipped = since, command

    def take_level(self, has_counted_level: bool) -> None:
        """Take whether the pin has the level to which a counted edge leads, in the next frame."""
        self.has_levels = True
        self.has_counted_level = has_counted_level

    def update(
        self,
        time: int,
        count: int,
        edge_time: int | None,
        command: float,
        is_duty: bool,
        command_since: int,
    ) -> None:
        """Apply one frame. `command`, in effect since `command_since` (ns), is a duty or rad/s."""
        before = self.counting.time
        self.counting.update(time, count, edge_time, command, is_duty, command_since)
        is_mixed = self.counting.is_mixed and edge_time is None
        if is_mixed:
            self.intervals.restart()
        elif count != self.count:
            if edge_time is None:
                self.intervals.add(time, count - self.count, time - before)
            else:
                self.intervals.add(edge_time, count - self.count)
        changes = [(command_since, command)]
        if self.skipped is not None:
            changes.insert(0, self.skipped)
        if is_duty:
            duties = [value for _, value in changes]
        else:
            steps = count - self.count
            edge = edge_time
            if edge is None:
                edge = self.filter.hypotheses[0].estimated_edge_time(time, steps)
            duties = self.mirror.update(time, steps, edge, changes)
        self.count = count
        skipped = None
        if self.skipped is not None:
            skipped = DriveChange(self.skipped[0], self._drive(duties[0]), duties[0])
            self.skipped = None
        drive, duty = self._drive(duties[-1]), duties[-1]
        if self.shares_mirror:
            self.mirrored_duty = duty
        level, self.has_counted_level = self.has_counted_level, None
        self.filter.update(
            WheelFrame(time, count, edge_time, drive, command_since, duty, skipped, is_mixed, level)
        )

    def _drive(self, duty: float) -> float:
        """Pitches/s at which the motor settles."""
        return settled_speed(duty, self.static, self.rated) * self.pitches_per_rad

    def _variance(self, is_unusual: bool) -> float:
        """Variance of the travel, pitches2, if the best hypothesis is right.

        The model of a motor that is not of the usual kind is not trusted beyond the counts, and no
        model where it contradicts them.
        """
        best, counting = self.filter.hypotheses[0], self.counting
        variance = self.filter.variance
        if is_unusual:
            # At rest the level halves the part of the slot in which it may be.
            variance += (0.5 if self.has_levels else 1.0) * counting.pitches_variance
        elif best.motion.response.is_free_wheeling:
            sd = LEVEL_REVERSAL_SD if self.has_levels else FREE_WHEELING_REVERSAL_SD
            variance += counting.reversals * sd * sd
        faults = best.faults
        gap = abs(best.motion.travel - counting.position) - (faults.missed + faults.extra)
        if gap > 1.0:
            counted = counting.pitches_variance + counting.reversal_variance
            unexplained = max(gap - GAP_SDS * sqrt(counted), 0.0)
            variance += unexplained * unexplained
        return variance

    def _pushed_variance(self) -> float:
        """Variance (pitches2) of what somebody, or the other wheel, has turned the wheel since the
        last report: one channel does not measure the direction. The last edges of a wheel that
        comes to rest are none."""
        pushed = self.counting.pushed
        if pushed < PUSHED_EDGES_MIN and not self.counting.is_other_driven:
            self.reported_pushed = min(self.reported_pushed, pushed)
            return 0.0
        before, self.reported_pushed = self.reported_pushed, pushed
        if pushed <= before:
            return 0.0
        if pushed == 1:  # which may be that of a small motion
            return ONE_EDGE_SD * ONE_EDGE_SD
        return pushed_variance(before, pushed)

    def unobserved_travel(self, count: int) -> float:
        """Metres to `count` after a gap in the telemetry, to the middle of the slot.

        The sign of the board's count is used here: only the board knows its commands in the gap.
        """
        steps = count - self.count
        if not steps:
            return 0.0
        last, direction = self.filter.hypotheses[0], copysign(1.0, steps)
        in_slot = direction * (
            last.motion.z - last.edge_place
        )  # pitches into the slot at the start of the gap
        return (steps + direction * (0.5 - in_slot)) * self.pitch

    def report(self) -> None:
        """Set `travel` and the corrections to their values since the last call."""
        counting = self.counting
        counting.report()
        is_unusual = self.filter.is_unusual
        square = self.pitch * self.pitch
        if is_unusual:
            self.added_variance, self.end_variance = counting.added_variance, counting.end_variance
            if self.has_levels:
                self.end_variance *= 0.25
                reversals = counting.reversals - self.reported_reversals
                reversed_variance = reversals * UNUSUAL_LEVEL_REVERSAL_SD**2
                added = reversed_variance + self._pushed_variance() + counting.lost_variance
                self.added_variance = added * square
            # The model of an unusual motor explains missing edges by the motor.
            by_counts, intervals = counting.faults.shown_share, self.intervals
            is_exact = counting.has_edge_times and intervals.shows_faults
            if is_exact and not counting.faults.is_certain:
                by_counts = 0.0  # what is uneven then is the motor
            self.fault_share = max(by_counts, self.lost_share, intervals.share)
        else:  # of a few slots the filter's hypotheses include what the counts do not show
            self.added_variance = (self._pushed_variance() + counting.lost_variance) * square
            self.end_variance, self.fault_share = 0.0, self.lost_share
        self.reported_reversals = counting.reversals
        self.variance = self._variance(is_unusual) * square
        disagreement, self.disagreement_frames = self.filter.disagreement()
        self.disagreement = disagreement * square
        hypothesis, before = self.filter.hypotheses[0], self.reported_hypothesis
        motion = hypothesis.motion
        start_shift = self.reported_start - motion.start
        travel = motion.travel
        self.late_corrections = []
        late = 0.0
        if motion is not before.motion:
            corrections = before.corrections(hypothesis)
            late = sum(corrections, 0.0)
            self.late_corrections = [each * self.pitch for each in corrections]
            self.reported_hypothesis = hypothesis
        self.start_correction = start_shift * self.pitch
        self.travel = (travel - self.reported_travel - start_shift - late) * self.pitch
        self.reported_travel, self.reported_start = travel, motion.start


class CountWheelOdometer(WheelOdometer):
    """A wheel whose travel is its count times the pitch; the filter gives only the speed."""

    def report(self) -> None:
        """Set `travel` and its variances to their values since the last call."""
        counting, before = self.counting, self.reported_travel
        counting.report()
        self.variance, self.end_variance = counting.variance, counting.end_variance
        self.added_variance, self.fault_share = counting.added_variance, counting.faults.shown_share
        self.reported_travel = float(self.count - self.first_count)
        self.travel = (self.reported_travel - before) * self.pitch


def share_response(left: WheelOdometer, right: WheelOdometer) -> None:
    """Decide for both wheels together how their motors respond: they are of the same type."""
    hypotheses = left.filter.hypotheses + right.filter.hypotheses
    if len(hypotheses) == 2 or len({one.motion.response for one in hypotheses}) == 1:
        return
    likely = left.filter.response_log_likelihoods(), right.filter.response_log_likelihoods()
    best = max(
        {**likely[0], **likely[1]},
        key=lambda response: (
            likely[0].get(response, -LOG_RATIO_MAX)
            + likely[1].get(response, -LOG_RATIO_MAX)
            - (DRY_LOG_COST if response == DRY else 0.0)
        ),
    )
    left.filter.select_response(best)
    right.filter.select_response(best)


def compare_gains(
    lost_edges: LostEdges, left: WheelOdometer, right: WheelOdometer, are_even: bool
) -> None:
    """Decide by the gains of both motors whether an encoder loses every second edge; see
    `LostEdges.compare`.

    The gain of a wheel that has hardly turned is the calibrated one, without the robot's load that
    the other wheel has shown: in a first turn about a wheel they are not alike.
    """
    if min(abs(left.counting.position), abs(right.counting.position)) < COMPARED_EDGES_MIN:
        return
    lost_edges.compare(_motor_gain(left), _motor_gain(right), are_even)


def _motor_gain(wheel: WheelOdometer) -> MotorGain:
    motion = wheel.filter.motion
    return MotorGain(motion.gain, motion.gain_variance)


def known_edges(encoder: EncoderConfig, priors: Priors) -> EdgeErrors | None:
    """Measured errors of the disc, or None."""
    if len(encoder.slot_errors) != encoder.slots:
        return None
    open_share = SlotEstimate(priors.open_share_error, priors.open_share * priors.open_share)
    return EdgeErrors(encoder.slot_errors, encoder.back_errors, open_share, priors.slot)
