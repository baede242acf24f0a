"""What odometry knows of one wheel before it moves: its side of the robot file, and the link."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple, Protocol

from diffbotctl.control.speed_loop import MotorSettings


class MotorConfig(MotorSettings, Protocol):
    """The motor section of a side; `lag` in s, `idle` coast or brake, `decay` slow, fast or None,
    `friction` and `breakaway` duties or None, `bridge_share` a share of the full battery's
    voltage, `is_shorted` whether the driver shorts the windings between two pulses."""

    lag: float
    idle: str
    decay: str | None
    friction: float | None
    breakaway: float | None
    bridge_share: float
    is_shorted: bool


class WheelConfig(Protocol):
    """The wheel section of a side; metres."""

    diameter: float


class EncoderConfig(Protocol):
    """The encoder section of a side; `edge` that is counted, rising, falling or both; `slots`
    and `counts` per turn, errors in pitches."""

    channels: int
    edge: str
    slots: int
    counts: int
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
