"""What the simulated robot truly is: the `simulation` section of a robot file.

Values are drawn from these spreads by a seeded generator when the plant is built. No block can read
them; that is what makes a simulated figure worth something.
"""

from __future__ import annotations

from typing import Literal

from diffbotctl.params import Choice, Param, Section

Coasting = Literal["linear", "coulomb"]
SlotPhase = Literal["random", "zero"]
MotorWiring = Literal["plain", "reversed", "swapped", "dead", "floating"]
EncoderPlugs = Literal["plain", "swapped"]
EncoderWiring = Literal["plain", "dead", "floating"]


class MotorTruth(Section):
    """Spreads of the two gear motors."""

    lag = Param(
        tuple[float, float],
        default=(0.060, 0.150),
        unit="s",
        help="Range of the time constant from duty to speed; one is drawn for both motors.",
    )
    lag_spread = Param(
        float,
        default=0.05,
        unit="1",
        minimum=0.0,
        maximum=0.5,
        help="Largest difference of each motor's lag from the drawn one.",
    )
    gain_spread = Param(
        float,
        default=0.10,
        unit="1",
        minimum=0.0,
        maximum=0.5,
        help="Largest difference of each motor's speed from the rated one at full duty.",
    )
    start_duty = Param(
        tuple[float, float],
        default=(0.08, 0.16),
        unit="1",
        help="Range of the duty at which a resting wheel breaks loose; drawn for each motor.",
    )
    keep_share = Param(
        float,
        default=0.8,
        unit="1",
        above=0.0,
        maximum=1.0,
        help="Share of the starting duty that keeps a turning wheel turning.",
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
        help="Without drive the speed dies exponentially, or dry friction stops it in finite time.",
    )


class EncoderTruth(Section):
    """Spreads of the two slotted discs and their light barriers."""

    phase: SlotPhase = Choice(
        SlotPhase, default="random", help="Where in a slot the wheels stand at the start."
    )
    slot_spread = Param(
        float,
        default=0.03,
        unit="1",
        minimum=0.0,
        maximum=0.15,
        help="Standard deviation of a slot's place, as a share of the pitch.",
    )
    duty_spread = Param(
        float,
        default=0.05,
        unit="1",
        minimum=0.0,
        maximum=0.15,
        help="Standard deviation of the open share of the pitch, about one half, per disc.",
    )
    jitter = Param(
        float,
        default=50e-6,
        unit="s",
        minimum=0.0,
        maximum=2e-3,
        help="Standard deviation of the delay of an edge.",
    )
    slots = Param(
        int,
        none=True,
        default=None,
        minimum=1,
        maximum=4096,
        help="Slots that the discs truly have; none: as many as the robot file states.",
    )
    bounce = Param(
        float,
        default=0.0,
        unit="s",
        minimum=0.0,
        maximum=0.01,
        help="How long a flank chatters before it settles, at most; 0: not at all.",
    )


class GeometryTruth(Section):
    """How far the true geometry is from the robot file's."""

    track_spread = Param(
        float, default=0.0, unit="1", minimum=0.0, maximum=0.2, help="Largest error of the track."
    )
    diameter_spread = Param(
        float,
        default=0.0,
        unit="1",
        minimum=0.0,
        maximum=0.2,
        help="Largest error of each wheel's diameter.",
    )


class SensorTruth(Section):
    """Errors of one distance sensor."""

    noise = Param(
        float, default=0.010, unit="V", minimum=0.0, help="Standard deviation of each reading."
    )
    offset = Param(float, default=0.0, unit="V", help="Constant error of the voltage.")
    spread = Param(
        float,
        default=0.010,
        unit="m",
        minimum=0.0,
        help="Standard deviation of each distance that a laser scanner tells.",
    )


class Start(Section):
    """Where in the simulated world the robot stands at first: there the frame odom begins."""

    x = Param(float, unit="m", default=0.0, help="Along the world's x axis.")
    y = Param(float, unit="m", default=0.0, help="Along the world's y axis.")
    heading = Param(float, unit="rad", default=0.0, help="Where it looks; counter-clockwise.")


class WiringTruth(Section):
    """How the simulated robot was soldered together."""

    left: MotorWiring = Choice(
        MotorWiring,
        default="plain",
        help="Left side: motor leads, motors exchanged, motor dead, encoder pin floating.",
    )
    right: MotorWiring = Choice(
        MotorWiring,
        default="plain",
        help="Right side: motor leads, motors exchanged, motor dead, encoder pin floating.",
    )
    encoders: EncoderPlugs = Choice(
        EncoderPlugs, default="plain", help="Whether the plugs of the two encoders were exchanged."
    )
    left_encoder: EncoderWiring = Choice(
        EncoderWiring,
        default="plain",
        help="The encoder at the left wheel: its light barrier dead, or its wire off.",
    )
    right_encoder: EncoderWiring = Choice(
        EncoderWiring,
        default="plain",
        help="The encoder at the right wheel: its light barrier dead, or its wire off.",
    )


class BatteryTruth(Section):
    """The motor supply of the simulated robot."""

    volts = Param(float, default=7.6, unit="V", above=0.0, help="Voltage of the battery at rest.")
    divider_error = Param(
        float,
        default=0.0,
        unit="1",
        minimum=-0.3,
        maximum=0.3,
        help="How far the divider before the board's pin is from the stated one.",
    )
    sag = Param(
        float,
        default=0.04,
        unit="1",
        minimum=0.0,
        maximum=0.5,
        help="Share of the voltage that is lost while both motors take full duty.",
    )


class Simulation(Section):
    """The plant's truth: spreads to draw from, and errors to add."""

    motor = Param(MotorTruth, default=MotorTruth(), help="The gear motors.")
    encoder = Param(EncoderTruth, default=EncoderTruth(), help="The slotted discs.")
    geometry = Param(GeometryTruth, default=GeometryTruth(), help="The true geometry.")
    slip = Param(
        float,
        default=0.0005,
        unit="m",
        minimum=0.0,
        help="Slip of each wheel, standard deviation per square root of a metre of its travel.",
    )
    battery = Param(BatteryTruth, default=BatteryTruth(), help="The motor supply.")
    sensors = Param(
        dict[str, SensorTruth], default={}, help="Errors of the sensors, by the sensor's name."
    )
    start = Param(Start, default=Start(), help="Where in the world it stands at first.")
    wiring = Param(WiringTruth, default=WiringTruth(), help="How it was soldered together.")
