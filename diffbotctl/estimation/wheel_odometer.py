"""Travel of one wheel in metres, from the counts and commands of the board."""

from __future__ import annotations

from math import copysign, pi

from diffbotctl.control.motor_curve import settled_speed
from diffbotctl.control.speed_loop import speed_gains
from diffbotctl.estimation.explained_edges import ExplainedEdges
from diffbotctl.estimation.predicted_wheel import no_load_speed
from diffbotctl.estimation.unexplained_edges import EdgeGaps, UndrivenEdges
from diffbotctl.estimation.wheel_filter import WheelFilter
from diffbotctl.estimation.wheel_frame import (
    BoardFrame,
    CountSign,
    DriveChange,
    MotorDuty,
    WheelFrame,
)
from diffbotctl.estimation.wheel_side import LinkTiming, Priors, SideConfig, known_decay

UNIFORM_VARIANCE = 1.0 / 12.0  # pitches2; of a place within a slot
# Pitches, for each reversal: how a motor that free-wheels between the pulses breaks loose depends
# on load and battery more than its model knows, and decides which of two edges was the first one.
FREE_WHEELING_REVERSAL_SD = 0.15
# The same where the level of the pin shows on which side of an edge the wheel has stopped; and of a
# motor of an unusual kind.
LEVEL_REVERSAL_SD, UNUSUAL_LEVEL_REVERSAL_SD = 0.1, 0.2
UNUSUAL_REVERSAL_SD = 0.5  # the next edge may be either edge of the slot
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
        self.time, self.count = time, count
        friction = self.static / (1.0 - self.static) * motor.rated
        brakes = motor.idle == "brake"
        priors = Priors(
            lag=motor.lag,
            friction=friction,
            dead_band=self.static,
            brakes=brakes,
            shorted_speed=motor.bridge_share * no_load_speed(motor.rated + friction)
            if brakes
            else 0.0,
            decay=known_decay(motor),
            frame_time=timing.frame_time,
            command_time=timing.command_time,
            has_edge_times=timing.has_edge_times,
        )
        if side.encoder.open_share is not None:
            priors = priors._replace(
                open_share=MEASURED_OPEN_SHARE_SD,
                open_share_error=side.encoder.open_share - 0.5,
            )
        self.filter = WheelFilter(priors, time, count, slots)
        self.duty = MotorDuty(speed_gains(motor))
        self.explained = ExplainedEdges(side)
        self.count_sign = CountSign(timing.command_time, timing.is_published_firmware)
        self.undriven = UndrivenEdges(self.pitches_per_rad)
        self.gaps = EdgeGaps(motor.rated * self.pitches_per_rad)
        self.lost_variance = 0.0  # pitches2, in gaps, since the last report
        self.drive_direction = 0
        self.reversals = self.reported_reversals = 0
        self.has_levels = False  # whether the board reports those of the pin
        self.travel = 0.0  # m, since the last report
        # Variances in m2: of that travel; of all travel, if the best hypothesis is right; of the
        # present position in the slot, which the model of a usual motor includes; and between the
        # hypotheses.
        self.added_variance = self.variance = self.end_variance = self.disagreement = 0.0
        self.lost_share, self.lost_text = 0.0, ""  # of every second edge
        self.start_correction = 0.0  # m, added by a better estimate of the initial phase
        self.reported_travel = 0.0  # pitches
        self.reported_start = self.filter.motion.start

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
        pushed, faults = self.undriven.text, self.filter.hypotheses[0].faults
        # The edges of a push look like edges in excess to the model of a motor without power.
        is_of_push = pushed and faults.missed <= faults.extra <= self.undriven.edges_in_all
        texts = pushed, self.lost_text, self.gaps.text, "" if is_of_push else faults.text
        return "; ".join(filter(None, texts))

    @property
    def fault_share(self) -> float:
        """Share of the edges that were missed or counted twice, and are no hypotheses."""
        return self.lost_share

    @property
    def pushed_travel(self) -> float:
        """Standard deviation (m) of what it was turned without a command since the pose was set, if
        that is reported."""
        return self.undriven.sd * self.pitch

    def pose_is_set(self) -> None:
        """What happened before does not matter any more."""
        self.undriven.pose_is_set()
        self.gaps.pose_is_set()

    def update(self, frame: BoardFrame) -> None:
        time, count, edge_time, command, since = frame[:5]
        steps, span = count - self.count, (time - self.time) * 1e-9
        is_mixed = self.count_sign.update(self.time, command, since, steps)
        duties = self.duty.update(frame.commands, frame.is_duty, frame.reported_duty)
        self.time, self.count = time, count
        skipped = None
        if frame.skipped is not None:
            skipped = DriveChange(frame.skipped[0], self._drive(duties[0]), duties[0])
        drive, duty = self._drive(duties[-1]), duties[-1]
        self.undriven.is_other_driven = frame.is_other_driven
        self._note_drive(span, abs(steps), drive, duty if command else 0.0)
        is_mixed = is_mixed and edge_time is None
        level = frame.has_counted_level
        self.has_levels |= level is not None
        self.filter.update(
            WheelFrame(time, count, edge_time, drive, since, duty, skipped, is_mixed, level)
        )

    def _note_drive(self, span: float, edges: int, drive: float, duty: float) -> None:
        """Compare the `edges` of a frame with its `drive` (pitches/s) and `duty`."""
        self.undriven.add(span, edges, is_driven=duty != 0.0)
        direction = (drive > 0.0) - (drive < 0.0)
        if direction and direction != self.drive_direction:
            self.reversals += self.drive_direction != 0
            self.drive_direction = direction
        self.lost_variance += self.gaps.update(span, edges, drive)
        if span > 0.0:
            self.explained.add(span, edges, duty)

    def _drive(self, duty: float) -> float:
        """Pitches/s at which the motor settles."""
        return settled_speed(duty, self.static, self.rated) * self.pitches_per_rad

    def _variance(self, is_unusual: bool) -> float:
        """Variance of the travel, pitches2, if the best hypothesis is right. The model of a motor
        that is not of the usual kind is not trusted beyond the counts."""
        variance = self.filter.variance
        if is_unusual:
            # At rest the level halves the part of the slot in which it may be.
            variance += (0.5 if self.has_levels else 1.0) * UNIFORM_VARIANCE
        elif self.filter.motion.is_free_wheeling:
            sd = LEVEL_REVERSAL_SD if self.has_levels else FREE_WHEELING_REVERSAL_SD
            variance += self.reversals * sd * sd
        return variance

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
        is_unusual = self.filter.is_unusual
        square = self.pitch * self.pitch
        added = self.undriven.take_variance() + self.lost_variance
        self.lost_variance = self.end_variance = 0.0
        if is_unusual:
            level_share = 0.25 if self.has_levels else 1.0
            self.end_variance = level_share * UNIFORM_VARIANCE * square
            sd = UNUSUAL_LEVEL_REVERSAL_SD if self.has_levels else UNUSUAL_REVERSAL_SD
            added += (self.reversals - self.reported_reversals) * sd * sd
        self.reported_reversals = self.reversals
        self.added_variance = added * square
        self.variance = self._variance(is_unusual) * square
        self.disagreement = self.filter.disagreement * square
        motion = self.filter.motion
        start_shift = self.reported_start - motion.start
        self.start_correction = start_shift * self.pitch
        self.travel = (motion.travel - self.reported_travel - start_shift) * self.pitch
        self.reported_travel, self.reported_start = motion.travel, motion.start
