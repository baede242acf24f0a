"""Travel of one wheel in metres, from the counts and commands of the board."""

from __future__ import annotations

from collections.abc import Sequence
from math import copysign, pi
from typing import NamedTuple, Protocol

from diffbotctl.control.speed_loop import MotorSettings, SpeedLoopMirror, speed_gains
from diffbotctl.estimation.edge_hypothesis import WheelFrame
from diffbotctl.estimation.priors import Priors
from diffbotctl.estimation.slot_errors import EdgeErrors, SlotEstimate
from diffbotctl.estimation.wheel_filter import WheelFilter

MEASURED_OPEN_SHARE_SD = 0.01  # pitches; it differs a little with the speed


class MotorConfig(MotorSettings, Protocol):
    """The motor section of a side; `lag` in s."""

    lag: float


class WheelConfig(Protocol):
    """The wheel section of a side; metres."""

    diameter: float


class EncoderConfig(Protocol):
    """The encoder section of a side; errors in pitches."""

    slots: int
    slot_errors: Sequence[float]
    back_errors: Sequence[float]
    open_share: float | None


class SideConfig(Protocol):
    """One side of the drive in the robot file."""

    motor: MotorConfig
    wheel: WheelConfig
    encoder: EncoderConfig


class LinkTiming(NamedTuple):
    """Accuracy of the times: standard deviations (s) of a frame's time and of the time at which a
    command takes effect, and whether the board reports edge times."""

    frame_time: float
    command_time: float
    has_edge_times: bool


class WheelOdometer:
    """A wheel whose travel is estimated with the model of its motor."""

    def __init__(self, side: SideConfig, time: int, count: int, timing: LinkTiming) -> None:
        """Start at `time` (ns) with the board's `count`."""
        motor, slots = side.motor, side.encoder.slots
        self.pitch = pi * side.wheel.diameter / slots
        self.pitches_per_rad = 0.5 * slots / pi
        self.rated = motor.rated
        self.static = motor.loop.static
        self.count = self.first_count = count
        friction = self.static / (1.0 - self.static) * motor.rated
        priors = Priors(lag=motor.lag, friction=friction, **timing._asdict())
        if side.encoder.open_share is not None:
            priors = priors._replace(
                open_share=MEASURED_OPEN_SHARE_SD,
                open_share_error=side.encoder.open_share - 0.5,
            )
        edges = known_edges(side.encoder, priors)
        self.filter = WheelFilter(priors, time, count, slots, edges)
        self.mirror = SpeedLoopMirror(speed_gains(motor), slots, time)
        self.travel = 0.0  # m, since the last report
        self.start_correction = 0.0  # m, added by a better estimate of the initial phase
        self.reported_travel = 0.0  # pitches
        self.reported_start = self.filter.motion.start

    @property
    def speed(self) -> float:
        """m/s"""
        return self.filter.motion.speed * self.pitch

    @property
    def variance(self) -> float:
        """Variance of the travel, m2."""
        return self.filter.motion.variance * self.pitch * self.pitch

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
        if not is_duty:
            steps = count - self.count
            edge = edge_time
            if edge is None:
                edge = self.filter.hypotheses[0].estimated_edge_time(time, steps)
            command = self.mirror.update(time, steps, edge, command, command_since)
        self.count = count
        drive = settled_speed(command, self.static, self.rated) * self.pitches_per_rad
        self.filter.update(WheelFrame(time, count, edge_time, drive, command_since))

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
        """Set `travel` and `start_correction` to their values since the last call."""
        motion = self.filter.motion
        start_shift = self.reported_start - motion.start
        travel = motion.travel
        self.start_correction = start_shift * self.pitch
        self.travel = (travel - self.reported_travel - start_shift) * self.pitch
        self.reported_travel, self.reported_start = travel, motion.start


class CountWheelOdometer(WheelOdometer):
    """A wheel whose travel is its count times the pitch; the filter gives only the speed."""

    def report(self) -> None:
        """Set `travel` to its value since the last call."""
        before = self.reported_travel
        self.reported_travel = float(self.count - self.first_count)
        self.travel = (self.reported_travel - before) * self.pitch


def known_edges(encoder: EncoderConfig, priors: Priors) -> EdgeErrors | None:
    """Measured errors of the disc, or None."""
    if len(encoder.slot_errors) != encoder.slots:
        return None
    open_share = SlotEstimate(priors.open_share_error, priors.open_share * priors.open_share)
    return EdgeErrors(encoder.slot_errors, encoder.back_errors, open_share, priors.slot)


def settled_speed(duty: float, static: float, rated: float) -> float:
    """Speed (rad/s) at which a typical motor settles with `duty`: dead band, then linear."""
    beyond = abs(duty) - static
    return copysign(beyond / (1.0 - static) * rated, duty) if beyond > 0.0 else 0.0
