"""What odometry knows of one wheel before it moves: its side of the robot file, and the link."""

from __future__ import annotations

from math import pi
from typing import NamedTuple, Protocol

from diffbotctl.control.speed_loop import MotorSettings

# Standard deviations of a motor that is not of the usual kind: the range of robots for which
# `check` accepts a robot file, not a measurement.
WIDE_LAG_RATIO = 0.6
WIDE_GAIN = 0.25
WIDE_OFFSET_RATIO = 1.0  # relative to the typical friction
WIDE_NOISE_RATIO = 5.0  # of the noise of speed, to begin with


class Priors(NamedTuple):
    """Prior knowledge of motor, disc and link: standard deviations (sources: docs/odometry.md).

    Speeds in rad/s until `in_pitches`.
    """

    lag: float = 0.10  # s; mean
    lag_ratio: float = 0.27  # of the logarithm of the lag
    gain: float = 0.065
    offset: float = 0.22  # rad/s
    friction: float = 1.16  # rad/s; value: speed lost to the dead band of a typical motor
    dead_band: float = 0.1  # duty; value: that which only overcomes the friction
    creep: float = 0.094  # rad/s; value: without drive, friction stops a slower wheel
    model_noise: float = 0.28  # rad/s per square root of a second; noise of the speed
    offset_drift: float = 0.016  # rad/s per square root of a second; random walk of the offset
    gain_drift: float = 0.04  # per square root of a second; random walk of the gain
    # Value: minus the log probability that the motion changes suddenly before an edge, one in 55.
    # Floors have seams and gears have teeth, so it is rather high; a low one would blame the
    # encoder instead. Infinite: the motion is known to be steady.
    change_cost: float = 4.0
    slot: float = 0.03  # pitches; position of an edge
    open_share: float = 0.05  # pitches; of the open share of a pitch
    open_share_error: float = 0.0  # pitches; value: open share minus 0.5
    frame_time: float = 0.0  # s; of a frame's time
    command_time: float = 0.0  # s; of the time at which a command takes effect
    has_edge_times: bool = False  # whether the board reports edge times
    brakes: bool = False  # whether the driver shorts the motor at duty 0
    # rad/s; value: above it the voltage of a shorted motor exceeds that of the driver's transistors
    shorted_speed: float = 0.0
    decay: str | None = None  # of the current between two pulses: slow, fast, or None: not known

    def widened(self) -> Priors:
        """The priors of a motor that is not of the usual kind, or geared or supplied otherwise."""
        return self._replace(
            lag_ratio=WIDE_LAG_RATIO,
            gain=WIDE_GAIN,
            offset=WIDE_OFFSET_RATIO * self.friction,
        )

    def in_pitches(self, slots: int) -> Priors:
        """A copy with all speeds in pitches/s of a disc with `slots` slots."""
        scale = slots / (2.0 * pi)
        return self._replace(
            offset=self.offset * scale,
            friction=self.friction * scale,
            creep=self.creep * scale,
            shorted_speed=self.shorted_speed * scale,
            model_noise=self.model_noise * scale,
            offset_drift=self.offset_drift * scale,
        )


class MotorConfig(MotorSettings, Protocol):
    """The motor section of a side; `lag` in s, `idle` coast or brake, `decay` slow, fast or None,
    `friction` a duty or None, `bridge_share` a share of the full battery's
    voltage, `is_shorted` whether the driver shorts the windings between two pulses."""

    lag: float
    idle: str
    decay: str | None
    friction: float | None
    bridge_share: float
    is_shorted: bool


class WheelConfig(Protocol):
    """The wheel section of a side; metres."""

    diameter: float


class EncoderConfig(Protocol):
    """The encoder section of a side; `edge` that is counted, rising, falling or both; `slots`
    and `counts` per turn."""

    channels: int
    edge: str
    slots: int
    counts: int
    open_share: float | None


class SideConfig(Protocol):
    """One side of the drive in the robot file."""

    motor: MotorConfig
    wheel: WheelConfig
    encoder: EncoderConfig


class LinkTiming(NamedTuple):
    """Accuracy of the times: standard deviations (s) of a frame's time and of the time at which a
    command takes effect, whether the board reports edge times, and whether it runs the published
    firmware, which takes duties and counts forward at a command of zero."""

    frame_time: float
    command_time: float
    has_edge_times: bool
    is_published_firmware: bool = False


def known_decay(motor: MotorConfig) -> str | None:
    """How the current decays between two pulses: as measured, or by what the driver does there;
    slow, fast, or None where neither is known."""
    return motor.decay or ("slow" if motor.is_shorted else None)
