"""One wheel as odometry sees it: from the board's counts and commands to metres rolled."""

from __future__ import annotations

from collections.abc import Sequence
from math import copysign, pi
from typing import Protocol

from diffbotctl.control.speed_loop_mirror import SpeedLoopMirror, SpeedLoopState
from diffbotctl.estimation.known_slot_errors import EdgeErrors
from diffbotctl.estimation.slot_errors import SlotEstimate
from diffbotctl.estimation.wheel_filter import WheelFilter
from diffbotctl.estimation.wheel_kalman import Priors

SHARE = 0.01  # pitches; sd of a measured open share, at another speed of the wheel


class MotorConfig(Protocol):
    """What a side's motor must tell; times in s, speeds in rad/s."""

    lag: float
    rated: float
    loop: SpeedLoopState


class WheelConfig(Protocol):
    """The wheel of a side; metres."""

    diameter: float


class EncoderConfig(Protocol):
    """The encoder of a side; pitches."""

    slots: int
    slot_errors: Sequence[float]
    back_errors: Sequence[float]
    open_share: float | None


class SideConfig(Protocol):
    """One side of the drive, as the robot file has it."""

    motor: MotorConfig
    wheel: WheelConfig
    encoder: EncoderConfig


class WheelOdometer:
    """A wheel followed by a filter that is driven by the model of its motor."""

    __slots__ = (
        "begun",
        "count",
        "filter",
        "first",
        "gone",
        "mirror",
        "pitch",
        "rated",
        "rolled",
        "started",
        "static",
        "to_pitches",
    )

    def __init__(
        self,
        side: SideConfig,
        time: int,
        count: int,
        stamp: float,
        hold: float,
        timed: bool = False,
    ) -> None:
        """First heard of at `time` (ns) with `count`; frames' times scatter by `stamp` (s), those
        when commands take hold by `hold` (s). `timed`: the board tells when edges came."""
        motor, slots = side.motor, side.encoder.slots
        self.pitch = pi * side.wheel.diameter / slots
        self.to_pitches = 0.5 * slots / pi
        self.rated = motor.rated
        self.static = motor.loop.static
        self.count = self.first = count
        static = motor.loop.static
        friction = static / (1.0 - static) * motor.rated
        spread = Priors(lag=motor.lag, stamp=stamp, hold=hold, friction=friction, timed=timed)
        if side.encoder.open_share is not None:
            spread = spread._replace(open=SHARE, share=side.encoder.open_share - 0.5)
        self.filter = WheelFilter(spread, time, count, slots, known_edges(side.encoder, spread))
        self.mirror = SpeedLoopMirror(motor.loop, motor.rated, slots, time)
        self.rolled = self.begun = 0.0
        self.gone = 0.0
        self.started = self.filter.motion.start

    @property
    def speed(self) -> float:
        """m/s"""
        return self.filter.motion.speed * self.pitch

    @property
    def variance(self) -> float:
        """Variance of the travel, m2."""
        return self.filter.motion.variance * self.pitch * self.pitch

    def frame(
        self, time: int, count: int, edge: int | None, command: float, duty: bool, since: int
    ) -> None:
        """Take one frame; the `command` in force `since` is a `duty`, or rad/s."""
        if not duty:
            steps = count - self.count
            passed = self.filter.likely_edge(time, steps) if edge is None else edge
            command = self.mirror.frame(time, steps, passed, command, since)
        self.count = count
        drive = driven_speed(command, self.static, self.rated) * self.to_pitches
        self.filter.frame(time, count, edge, drive, since)

    def counted(self, count: int) -> float:
        """Metres to `count`, unseen: in the direction in which the board has counted, which alone
        knew its commands then; to the middle of the slot that was reached."""
        steps = count - self.count
        if not steps:
            return 0.0
        track, way = self.filter.tracks[0], copysign(1.0, steps)
        begun = way * (track.motion.z - track.place)  # of the slot in which it was
        return (steps + way * (0.5 - begun)) * self.pitch

    def tell(self) -> None:
        """Say how far the wheel has `rolled` and `begun` since this was last asked."""
        motion = self.filter.motion
        learnt = self.started - motion.start
        gone = motion.travel
        self.begun = learnt * self.pitch
        self.rolled = (gone - self.gone - learnt) * self.pitch
        self.gone, self.started = gone, motion.start


class CountWheelOdometer(WheelOdometer):
    """A wheel that takes a count for a pitch; its filter tells only the speed."""

    __slots__ = ()

    def tell(self) -> None:
        """Say how far the wheel has `rolled` since this was last asked."""
        told = self.gone
        self.gone = float(self.count - self.first)
        self.rolled = (self.gone - told) * self.pitch


def known_edges(encoder: EncoderConfig, spread: Priors) -> EdgeErrors | None:
    """The disc as it was measured, or None."""
    if len(encoder.slot_errors) != encoder.slots:
        return None
    share = SlotEstimate(spread.share, spread.open * spread.open)
    return EdgeErrors(encoder.slot_errors, encoder.back_errors, share, spread.slot)


def driven_speed(duty: float, static: float, rated: float) -> float:
    """Wheel speed (rad/s) at which a usual motor settles with `duty`: a dead band, then a line."""
    beyond = abs(duty) - static
    return copysign(beyond / (1.0 - static) * rated, duty) if beyond > 0.0 else 0.0
