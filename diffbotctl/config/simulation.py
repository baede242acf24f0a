"""The `simulation` section of a robot file: the actual properties of the simulated robot.

Values are drawn from these spreads by a seeded generator when the plant is built. No block can read
them, so what a block estimates can be compared with them.
"""

from __future__ import annotations

from typing import Any, Literal

from diffbotctl.config.faults import FaultEntry
from diffbotctl.links.diffbot_frames import SLOTS_MAXIMUM
from diffbotctl.params import Choice, Param, Section
from diffbotctl.units import POSE_MAX

# No gear motor of such a robot starts within less; a shorter one makes steps of no length.
LAG_MIN_S = 0.001
SLIP_MAX_M = 0.1

Equations = Literal["exponential", "torque"]
Coasting = Literal["linear", "coulomb"]
SlotPhase = Literal["random", "zero"]
MotorWiring = Literal["plain", "reversed", "swapped", "dead", "floating"]
EncoderPlugs = Literal["plain", "swapped"]
ImuAxis = Literal["x", "-x", "y", "-y", "z", "-z"]
EncoderWiring = Literal["plain", "dead", "floating", "exchanged"]


class MotorTruth(Section):
    """Random spreads of the two gear motors."""

    lag = Param(
        tuple[float, float],
        default=(0.060, 0.150),
        unit="s",
        minimum=LAG_MIN_S,
        maximum=5.0,
        help="Range of the time constant from duty to speed; one value for both motors.",
    )
    lag_spread = Param(
        float,
        default=0.05,
        unit="1",
        minimum=0.0,
        maximum=0.5,
        help="Largest relative deviation of each motor's lag from that value.",
    )
    gain_spread = Param(
        float,
        default=0.10,
        unit="1",
        minimum=0.0,
        maximum=0.5,
        help="Largest relative deviation of each motor's speed at full duty.",
    )
    backlash = Param(
        float,
        default=0.0,
        unit="rad",
        minimum=0.0,
        maximum=0.5,
        help="Play between encoder and wheel, which each reversal crosses.",
    )
    start_duty = Param(
        tuple[float, float],
        default=(0.08, 0.16),
        unit="1",
        minimum=0.0,
        maximum=0.9,
        help="Range of the breakaway duty of a wheel at rest; one value for each motor.",
    )
    keep_share = Param(
        float,
        default=0.8,
        unit="1",
        above=0.0,
        maximum=1.0,
        help="Duty that keeps a wheel turning, as a share of the breakaway duty.",
    )
    ripple = Param(
        float,
        default=0.02,
        unit="1",
        minimum=0.0,
        maximum=0.5,
        help="Amplitude of the torque ripple.",
    )
    coasting: Coasting = Choice(
        Coasting,
        default="linear",
        help="Without drive: exponential decay, or a stop in finite time by dry friction, which "
        "the equations `torque` always have.",
    )


class EncoderTruth(Section):
    """Random spreads of the two slotted discs and their light barriers."""

    phase: SlotPhase = Choice(
        SlotPhase, default="random", help="Position of the wheels within a slot at the start."
    )
    slot_spread = Param(
        float,
        default=0.03,
        unit="1",
        minimum=0.0,
        maximum=0.15,
        help="Standard deviation of a slot's position, in pitches.",
    )
    duty_spread = Param(
        float,
        default=0.05,
        unit="1",
        minimum=0.0,
        maximum=0.15,
        help="Standard deviation of each disc's open share, about one half.",
    )
    jitter = Param(
        float,
        default=50e-6,
        unit="s",
        minimum=0.0,
        maximum=2e-3,
        help="Standard deviation of an edge's delay.",
    )
    slots: int | None = Param(
        int,
        none=True,
        default=None,
        minimum=1,
        maximum=SLOTS_MAXIMUM,
        help="Actual slots of the discs; none: as the robot file states.",
    )
    bounce = Param(
        float,
        default=0.0,
        unit="s",
        minimum=0.0,
        maximum=0.01,
        help="Longest bounce of an edge; 0: none.",
    )
    covered = Param(
        int,
        default=0,
        minimum=0,
        maximum=1000,
        help="Slots of each one-channel disc that are covered by dirt: they give no pulse.",
    )
    bounce_share = Param(
        float,
        default=1.0,
        unit="1",
        minimum=0.0,
        maximum=1.0,
        help="Share of the edges that bounce.",
    )
    missed = Param(
        float,
        default=0.0,
        unit="1",
        minimum=0.0,
        maximum=0.5,
        help="Share of the slots whose pulse does not reach the board.",
    )
    doubled = Param(
        float,
        default=0.0,
        unit="1",
        minimum=0.0,
        maximum=0.5,
        help="Share of the counted edges that are followed by a second one.",
    )


class GeometryTruth(Section):
    """Errors of the geometry stated in the robot file."""

    track_spread = Param(
        float,
        default=0.0,
        unit="1",
        minimum=0.0,
        maximum=0.2,
        help="Largest relative error of the track.",
    )
    diameter_spread = Param(
        float,
        default=0.0,
        unit="1",
        minimum=0.0,
        maximum=0.2,
        help="Largest relative error of each wheel's diameter.",
    )


class SensorTruth(Section):
    """Errors of one distance sensor."""

    noise = Param(
        float,
        default=0.010,
        unit="V",
        minimum=0.0,
        maximum=5.0,
        help="Standard deviation of a reading.",
    )
    offset = Param(
        float,
        default=0.0,
        unit="V",
        minimum=-5.0,
        maximum=5.0,
        help="Constant error of the voltage.",
    )
    spread = Param(
        float,
        default=0.010,
        unit="m",
        minimum=0.0,
        maximum=1.0,
        help="Standard deviation of a laser scanner's distance.",
    )
    echo_spread = Param(
        float,
        default=0.003,
        unit="m",
        minimum=0.0,
        maximum=1.0,
        help="Standard deviation of an HC-SR04's distance.",
    )


class GyroTruth(Section):
    """Errors of the gyro."""

    scale_spread = Param(
        float,
        default=0.03,
        unit="1",
        minimum=0.0,
        maximum=0.1,
        help="Largest relative error of its scale.",
    )
    noise = Param(
        float,
        default=8.7e-5,
        unit="rad/s",
        minimum=0.0,
        maximum=0.01,
        help="Noise of the rate in a bandwidth of 1 Hz.",
    )
    bias = Param(
        float,
        default=0.02,
        unit="rad/s",
        minimum=0.0,
        maximum=0.3,
        help="Largest rate that it measures at rest.",
    )
    drift = Param(
        float,
        default=0.0035,
        unit="rad/s",
        minimum=0.0,
        maximum=0.1,
        help="Change of that rate while it warms up, with a time constant of 60 s.",
    )
    tilt = Param(
        float,
        default=0.087,
        unit="rad",
        minimum=0.0,
        maximum=0.5,
        help="Angle of its axis from the vertical.",
    )
    axes: ImuAxis | None = Choice(
        ImuAxis,
        none=True,
        default=None,
        help="Its axis that points up, or down with a minus sign; none: the one that the robot "
        "file states.",
    )
    acceleration_effect = Param(
        float,
        default=2e-4,
        unit="rad/s",
        minimum=0.0,
        maximum=0.01,
        help="Rate that an acceleration of 1 m/s2 adds, forward and to the side.",
    )


class Start(Section):
    """Pose of the robot in the simulated world at the start: the origin of the frame odom."""

    x = Param(
        float,
        unit="m",
        default=0.0,
        minimum=-POSE_MAX["m"],
        maximum=POSE_MAX["m"],
        help="Position along the world's x axis.",
    )
    y = Param(
        float,
        unit="m",
        default=0.0,
        minimum=-POSE_MAX["m"],
        maximum=POSE_MAX["m"],
        help="Position along the world's y axis.",
    )
    heading = Param(float, unit="rad", default=0.0, help="Heading; counter-clockwise from x.")


class WiringTruth(Section):
    """Wiring faults of the simulated robot."""

    left: MotorWiring = Choice(
        MotorWiring,
        default="plain",
        help="Left motor: leads reversed, motors swapped, dead, or encoder pin floating.",
    )
    right: MotorWiring = Choice(
        MotorWiring,
        default="plain",
        help="Right motor: leads reversed, motors swapped, dead, or encoder pin floating.",
    )
    encoders: EncoderPlugs = Choice(
        EncoderPlugs, default="plain", help="Whether the plugs of the two encoders are swapped."
    )
    left_encoder: EncoderWiring = Choice(
        EncoderWiring,
        default="plain",
        help="Left encoder: light barrier dead, wire off, or its two channels exchanged.",
    )
    right_encoder: EncoderWiring = Choice(
        EncoderWiring,
        default="plain",
        help="Right encoder: light barrier dead, wire off, or its two channels exchanged.",
    )


class BatteryTruth(Section):
    """The motor supply of the simulated robot."""

    volts: float | None = Param(
        float,
        none=True,
        default=None,
        unit="V",
        above=0.0,
        maximum=60.0,
        help="Voltage of the battery at rest: the motors' speed is in proportion to it; none: as "
        "`battery.full` of the robot states, else 7.6 V.",
    )
    divider_error = Param(
        float,
        default=0.0,
        unit="1",
        minimum=-0.3,
        maximum=0.3,
        help="Relative error of the voltage divider at the board's pin.",
    )
    sag = Param(
        float,
        default=0.04,
        unit="1",
        minimum=0.0,
        maximum=0.5,
        help="Share of the voltage lost while both motors run at full duty.",
    )


class Simulation(Section):
    """Actual properties of the simulated robot: random spreads and fixed errors."""

    equations: Equations = Choice(
        Equations,
        default="exponential",
        help="Motion of the wheels: speeds that follow the duty exponentially, computed exactly; "
        "or, slower, torques, static friction, caster and inertia in steps of a millisecond.",
    )
    plant: Any = Param(
        str,
        none=True,
        default=None,
        help="Physics of your own in place of these equations: ./my_plant.py:MyPlant, or the name "
        "of an installed one.",
    )
    motor = Param(MotorTruth, default=MotorTruth(), help="The gear motors.")
    encoder = Param(EncoderTruth, default=EncoderTruth(), help="The slotted discs.")
    geometry = Param(GeometryTruth, default=GeometryTruth(), help="Errors of the geometry.")
    slip = Param(
        float,
        default=0.0005,
        unit="m",
        minimum=0.0,
        maximum=SLIP_MAX_M,
        help="Slip of each wheel: standard deviation after 1 m, growing with the square root.",
    )
    battery = Param(BatteryTruth, default=BatteryTruth(), help="The motor supply.")
    sensors = Param(dict[str, SensorTruth], default={}, help="Errors of the sensors by name.")
    gyro = Param(GyroTruth, default=GyroTruth(), help="Errors of the gyro.")
    start = Param(Start, default=Start(), help="Pose in the world at the start.")
    wiring = Param(WiringTruth, default=WiringTruth(), help="Wiring faults.")
    faults = Param(list[FaultEntry], default=[], help="What goes wrong while it runs.")
