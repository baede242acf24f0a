"""The `simulation` section of a robot file: the actual properties of the simulated robot.

Values are drawn from these spreads by a seeded generator when the plant is built. No block can read
them, so what a block estimates can be compared with them.
"""

from __future__ import annotations

from typing import Any, Literal

from diffbotctl.config.faults import FaultEntry
from diffbotctl.links.diffbot_frames import SLOTS_MAXIMUM
from diffbotctl.params import Choice, Count, Number, Param, Section, Spread
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
        Spread,
        default=Spread(0.060, 0.150),
        unit="s",
        minimum=LAG_MIN_S,
        maximum=5.0,
        help="Range of the time constant from duty to speed; one value for both motors.",
    )
    lag_spread = Number(
        "1", "[0, 0.5]", 0.05, "Largest relative deviation of each motor's lag from that value."
    )
    gain_spread = Number(
        "1", "[0, 0.5]", 0.1, "Largest relative deviation of each motor's speed at full duty."
    )
    backlash = Number(
        "rad", "[0, 0.5]", 0.0, "Play between encoder and wheel, which each reversal crosses."
    )
    start_duty = Param(
        Spread,
        default=Spread(0.08, 0.16),
        unit="1",
        minimum=0.0,
        maximum=0.9,
        help="Range of the breakaway duty of a wheel at rest; one value for each motor.",
    )
    keep_share = Number(
        "1", "(0, 1]", 0.8, "Duty that keeps a wheel turning, as a share of the breakaway duty."
    )
    ripple = Number("1", "[0, 0.5]", 0.02, "Amplitude of the torque ripple.")
    coasting: Coasting = Choice(
        Coasting,
        "linear",
        "Without drive: exponential decay, or a stop in finite time by dry friction, which "
        "the equations `torque` always have.",
    )


class EncoderTruth(Section):
    """Random spreads of the two slotted discs and their light barriers."""

    phase: SlotPhase = Choice(
        SlotPhase, "random", "Position of the wheels within a slot at the start."
    )
    slot_spread = Number(
        "1", "[0, 0.15]", 0.03, "Standard deviation of a slot's position, in pitches."
    )
    duty_spread = Number(
        "1", "[0, 0.15]", 0.05, "Standard deviation of each disc's open share, about one half."
    )
    jitter = Number("s", "[0, 0.002]", 5e-05, "Standard deviation of an edge's delay.")
    slots = Count(
        f"[1, {SLOTS_MAXIMUM}]", None, "Actual slots of the discs; none: as the robot file states."
    )
    bounce = Number("s", "[0, 0.01]", 0.0, "Longest bounce of an edge; 0: none.")
    covered = Count(
        "[0, 1000]",
        0,
        "Slots of each one-channel disc that are covered by dirt: they give no pulse.",
    )
    bounce_share = Number("1", "[0, 1]", 1.0, "Share of the edges that bounce.")
    missed = Number(
        "1", "[0, 0.5]", 0.0, "Share of the slots whose pulse does not reach the board."
    )
    doubled = Number(
        "1", "[0, 0.5]", 0.0, "Share of the counted edges that are followed by a second one."
    )


class GeometryTruth(Section):
    """Errors of the geometry stated in the robot file."""

    track_spread = Number("1", "[0, 0.2]", 0.0, "Largest relative error of the track.")
    diameter_spread = Number(
        "1", "[0, 0.2]", 0.0, "Largest relative error of each wheel's diameter."
    )


class SensorTruth(Section):
    """Errors of one distance sensor."""

    noise = Number("V", "[0, 5]", 0.01, "Standard deviation of a reading.")
    offset = Number("V", "[-5, 5]", 0.0, "Constant error of the voltage.")
    spread = Number("m", "[0, 1]", 0.01, "Standard deviation of a laser scanner's distance.")
    echo_spread = Number("m", "[0, 1]", 0.003, "Standard deviation of an HC-SR04's distance.")


class GyroTruth(Section):
    """Errors of the gyro."""

    scale_spread = Number("1", "[0, 0.1]", 0.03, "Largest relative error of its scale.")
    noise = Number("rad/s", "[0, 0.01]", 8.7e-05, "Noise of the rate in a bandwidth of 1 Hz.")
    bias = Number("rad/s", "[0, 0.3]", 0.02, "Largest rate that it measures at rest.")
    drift = Number(
        "rad/s",
        "[0, 0.1]",
        0.0035,
        "Change of that rate while it warms up, with a time constant of 60 s.",
    )
    tilt = Number("rad", "[0, 0.5]", 0.087, "Angle of its axis from the vertical.")
    axes: ImuAxis | None = Choice(
        ImuAxis,
        None,
        "Its axis that points up, or down with a minus sign; none: the one that the robot "
        "file states.",
    )
    acceleration_effect = Number(
        "rad/s",
        "[0, 0.01]",
        0.0002,
        "Rate that an acceleration of 1 m/s2 adds, forward and to the side.",
    )


class Start(Section):
    """Pose of the robot in the simulated world at the start: the origin of the frame odom."""

    x = Number(
        "m", f"[{-POSE_MAX['m']}, {POSE_MAX['m']}]", 0.0, "Position along the world's x axis."
    )
    y = Number(
        "m", f"[{-POSE_MAX['m']}, {POSE_MAX['m']}]", 0.0, "Position along the world's y axis."
    )
    heading = Number("rad", "", 0.0, "Heading; counter-clockwise from x.")


class WiringTruth(Section):
    """Wiring faults of the simulated robot."""

    left: MotorWiring = Choice(
        MotorWiring,
        "plain",
        "Left motor: leads reversed, motors swapped, dead, or encoder pin floating.",
    )
    right: MotorWiring = Choice(
        MotorWiring,
        "plain",
        "Right motor: leads reversed, motors swapped, dead, or encoder pin floating.",
    )
    encoders: EncoderPlugs = Choice(
        EncoderPlugs, "plain", "Whether the plugs of the two encoders are swapped."
    )
    left_encoder: EncoderWiring = Choice(
        EncoderWiring,
        "plain",
        "Left encoder: light barrier dead, wire off, or its two channels exchanged.",
    )
    right_encoder: EncoderWiring = Choice(
        EncoderWiring,
        "plain",
        "Right encoder: light barrier dead, wire off, or its two channels exchanged.",
    )


class BatteryTruth(Section):
    """The motor supply of the simulated robot."""

    volts = Number(
        "V",
        "(0, 60]",
        None,
        "Voltage of the battery at rest: the motors' speed is in proportion to it; none: as "
        "`battery.full` of the robot states, else 7.6 V.",
    )
    divider_error = Number(
        "1", "[-0.3, 0.3]", 0.0, "Relative error of the voltage divider at the board's pin."
    )
    sag = Number(
        "1", "[0, 0.5]", 0.04, "Share of the voltage lost while both motors run at full duty."
    )


class Simulation(Section):
    """Actual properties of the simulated robot: random spreads and fixed errors."""

    equations: Equations = Choice(
        Equations,
        "exponential",
        "Motion of the wheels: speeds that follow the duty exponentially, computed exactly; "
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
    slip = Number(
        "m",
        f"[0, {SLIP_MAX_M}]",
        0.0005,
        "Slip of each wheel: standard deviation after 1 m, growing with the square root.",
    )
    battery = Param(BatteryTruth, default=BatteryTruth(), help="The motor supply.")
    sensors = Param(dict[str, SensorTruth], default={}, help="Errors of the sensors by name.")
    gyro = Param(GyroTruth, default=GyroTruth(), help="Errors of the gyro.")
    start = Param(Start, default=Start(), help="Pose in the world at the start.")
    wiring = Param(WiringTruth, default=WiringTruth(), help="Wiring faults.")
    faults = Param(list[FaultEntry], default=[], help="What goes wrong while it runs.")
