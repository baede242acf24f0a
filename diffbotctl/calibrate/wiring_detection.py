"""Which motor and which encoder is wired to which side, from short pulses of each motor.

An output of the motor driver has the name of the side for which the robot file states its pins; so
has an encoder input. One output at a time is pulsed. The person reports which wheel turned in which
direction; the counts show which inputs received edges.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from enum import StrEnum

from diffbotctl.calibrate.result import Finding
from diffbotctl.calibrate.session import NOISE_COUNTS_MIN, drive_sides
from diffbotctl.config.robot import SIDES, Robot

MOTOR_PINS = ("enable", "in1", "in2")
ENCODER_PINS = ("pin", "pin_b")
OTHER_SIDE = {"left": "right", "right": "left"}
PULSE_COUNTS_MIN = 2  # of a turning wheel; noise gives fewer


class WheelMotion(StrEnum):
    """What a person sees of both wheels during a pulse."""

    NONE = "none"
    LEFT_FORWARD = "left forward"
    LEFT_BACKWARD = "left backward"
    RIGHT_FORWARD = "right forward"
    RIGHT_BACKWARD = "right backward"
    BOTH_FORWARD = "both forward"
    BOTH_BACKWARD = "both backward"
    OPPOSITE_WAYS = "opposite ways"

    @property
    def wheel(self) -> str | None:
        """The side of the only wheel that turned; None if none or both did."""
        side = self.partition(" ")[0]
        return side if side in SIDES else None

    @property
    def is_backward(self) -> bool:
        return self.endswith(" backward")


@dataclass(frozen=True, slots=True)
class MotorPulse:
    """The result of a pulse that should turn one wheel forward."""

    output: str
    seen: WheelMotion
    counts: Mapping[str, int]  # by encoder input, without sign
    directions: Mapping[str, int] = field(default_factory=dict)
    """1 or -1 as two channels counted, by encoder input; empty with one channel"""


@dataclass(slots=True)
class DetectedWiring:
    """What is wired to what; None where it is not known."""

    wheel: dict[str, str | None] = field(default_factory=dict)  # the wheel that each output turns
    backward: dict[str, bool] = field(default_factory=dict)
    """whether an output turns its wheel backward"""
    input: dict[str, str | None] = field(default_factory=dict)
    """the input that counts the encoder of each wheel"""
    counts_down: dict[str, bool] = field(default_factory=dict)
    """whether the two channels of a wheel's encoder count down going forward, with its settings"""
    faults: list[str] = field(default_factory=list)  # what settings cannot correct
    corrections: list[str] = field(default_factory=list)  # what settings can correct

    @property
    def is_complete(self) -> bool:
        """Whether each output turns its own wheel, in a known direction."""
        return sorted(filter(None, self.wheel.values())) == sorted(SIDES)


def detect_wiring(pulses: Mapping[str, MotorPulse], noise: Mapping[str, int]) -> DetectedWiring:
    """The wiring shown by two pulses, by output; `noise`: counts of each input in 1 s at rest."""
    wiring = DetectedWiring()
    noisy = {side for side in SIDES if noise[side] >= NOISE_COUNTS_MIN}
    for output in SIDES:
        _check_motor(wiring, pulses[output], pulses[OTHER_SIDE[output]])
    for wheel in SIDES:
        _check_encoder(wiring, wheel, pulses, noisy)
        _check_direction(wiring, wheel, pulses)
    _report_swaps(wiring)
    return wiring


def _check_motor(wiring: DetectedWiring, pulse: MotorPulse, other: MotorPulse) -> None:
    output, seen = pulse.output, pulse.seen
    wiring.wheel[output] = seen.wheel
    wiring.backward[output] = seen.is_backward
    if seen is WheelMotion.NONE and (other.seen.wheel or other.seen is WheelMotion.NONE):
        wiring.faults.append(
            f"{output} motor dead: no wheel turned when the pins of the {output} motor were "
            "driven: check its two wires at motor and driver, the jumper on the enable pin of "
            "the driver, and the wires from the board to enable, in1 and in2"
        )
    elif seen is not WheelMotion.NONE and seen.wheel is None:
        wiring.faults.append(
            f"both motors are connected to the {output} output of the driver: connect each to "
            "its own"
        )


def _check_encoder(
    wiring: DetectedWiring, wheel: str, pulses: Mapping[str, MotorPulse], noisy: set[str]
) -> None:
    """Find the input that counts the encoder of `wheel`."""
    wiring.input[wheel] = None
    turned = [pulse for pulse in pulses.values() if wiring.wheel[pulse.output] == wheel]
    if not turned:
        return
    counts = turned[0].counts
    inputs = [side for side in SIDES if side not in noisy and counts[side] >= PULSE_COUNTS_MIN]
    if len(inputs) == 1:
        wiring.input[wheel] = inputs[0]
    elif len(inputs) == 2:
        wiring.faults.append(
            f"both encoders count when only the {wheel} wheel turns: their wires touch"
        )
    elif noisy:
        socket = wheel if wheel in noisy else OTHER_SIDE[wheel]
        wiring.faults.append(
            f"{wheel} encoder floating: its input ({socket}) counts while nothing turns: the "
            "signal wire is disconnected or broken, or the sensor has no ground"
        )
    else:
        wiring.faults.append(
            f"{wheel} encoder dead: the wheel turns and nothing is counted: check the supply "
            "and the signal wire of the sensor, and whether the disc runs in its slot"
        )


def _check_direction(wiring: DetectedWiring, wheel: str, pulses: Mapping[str, MotorPulse]) -> None:
    """Compare the direction that two channels counted with the one that was seen."""
    socket = wiring.input[wheel]
    for pulse in pulses.values():
        if socket is None or pulse.seen.wheel != wheel or socket not in pulse.directions:
            continue
        wiring.counts_down[wheel] = (pulse.directions[socket] < 0) != pulse.seen.is_backward
        if wiring.counts_down[wheel]:
            wiring.corrections.append(
                f"{wheel} encoder: channels A and B exchanged: it counted down going forward"
            )
        return


def _report_swaps(wiring: DetectedWiring) -> None:
    wheels = wiring.wheel
    if wheels == OTHER_SIDE:
        wiring.corrections.append("motors swapped: the left output turns the right wheel")
    elif wheels["left"] is not None and wheels["left"] == wheels["right"]:
        wiring.faults.append(f"both outputs turn the {wheels['left']} wheel: check the motor wires")
    if _has_swapped_encoders(wiring):
        wiring.corrections.append(
            "encoders swapped: each is connected to the pin stated for the other"
        )
    for output, wheel in wheels.items():
        if wheel and wiring.backward[output]:
            wiring.corrections.append(
                f"{wheel} motor reversed: it turned backward when driven forward"
            )


def _has_swapped_encoders(wiring: DetectedWiring) -> bool:
    return any(wiring.input[wheel] == OTHER_SIDE[wheel] for wheel in SIDES)


def wiring_findings(wiring: DetectedWiring, robot: Robot) -> list[Finding]:
    """The pins and directions with which each side of the board drives and counts its own wheel."""
    sides = drive_sides(robot)
    findings: list[Finding] = []
    if wiring.is_complete:
        for output, wheel in wiring.wheel.items():
            assert wheel is not None
            motor = sides[output].motor
            if wheel != output:
                findings += [
                    Finding(f"drive.{wheel}.motor.{pin}", str(getattr(motor, pin)))
                    for pin in MOTOR_PINS
                    if getattr(motor, pin) is not None  # an input that the driver lacks
                ]
            is_reversed = motor.reversed != wiring.backward[output]
            if is_reversed != sides[wheel].motor.reversed:
                findings.append(Finding(f"drive.{wheel}.motor.reversed", is_reversed))
    if _has_swapped_encoders(wiring):
        findings += [
            Finding(f"drive.{wheel}.encoder.{pin}", str(stated))
            for wheel in SIDES
            for pin in ENCODER_PINS
            if (stated := getattr(sides[OTHER_SIDE[wheel]].encoder, pin)) is not None
        ]
    for wheel, counts_down in wiring.counts_down.items():
        socket = wiring.input[wheel]
        assert socket is not None
        is_reversed = sides[socket].encoder.reversed != counts_down
        if is_reversed != sides[wheel].encoder.reversed:
            findings.append(Finding(f"drive.{wheel}.encoder.reversed", is_reversed))
    return findings
