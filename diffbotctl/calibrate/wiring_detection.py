"""Who is wired to what: told from short pulses, from what encoders counted, and from the eye.

A driver channel is named by the side for which the robot file states its pins, an encoder's socket
likewise. A pulse goes to one channel at a time; the eye says which wheel turned, and which way; the
counts say which sockets heard it.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

from diffbotctl.calibrate.result import Finding
from diffbotctl.calibrate.session import NOISE_COUNTS_MIN
from diffbotctl.config.robot import SIDES, Robot

MOTOR_PINS = ("enable", "in1", "in2")
OTHER_SIDE = {"left": "right", "right": "left"}


@dataclass(frozen=True, slots=True)
class MotorPulse:
    """What came of a pulse that was meant to turn one wheel forward."""

    channel: str
    seen: str
    """what the eye saw: `none`, `left forward`, ..., `both backward`, `opposite ways`"""
    counts: Mapping[str, int]
    """by socket, without sign"""


@dataclass(slots=True)
class DetectedWiring:
    """What is wired to what; None where nothing is known."""

    wheel: dict[str, str | None] = field(default_factory=dict)
    """which wheel each channel turns"""
    backward: dict[str, bool] = field(default_factory=dict)
    """which channels turn their wheel the wrong way"""
    socket: dict[str, str | None] = field(default_factory=dict)
    """at which socket the encoder of each wheel answers"""
    faults: list[str] = field(default_factory=list)
    """what settings cannot mend"""
    mended: list[str] = field(default_factory=list)
    """what settings can mend"""

    @property
    def proven(self) -> bool:
        """Whether each channel turns a wheel of its own, in a way that is known."""
        return sorted(filter(None, self.wheel.values())) == ["left", "right"]


PULSE_COUNTS_MIN = 2  # counts that a turning wheel gives in a pulse, and noise does not


def detect_wiring(pulses: Mapping[str, MotorPulse], resting: Mapping[str, int]) -> DetectedWiring:
    """What two pulses show, by channel; `resting`: counts of each socket in a second at rest."""
    found = DetectedWiring()
    noisy = {side for side in SIDES if resting[side] >= NOISE_COUNTS_MIN}
    for channel in SIDES:
        _check_motor(found, pulses[channel], pulses[OTHER_SIDE[channel]])
    for wheel in SIDES:
        _check_encoder(found, wheel, pulses, noisy)
    _report_swaps(found)
    return found


def _check_motor(found: DetectedWiring, pulse: MotorPulse, other: MotorPulse) -> None:
    channel = pulse.channel
    which, _, way = pulse.seen.partition(" ")
    found.wheel[channel] = which if which in SIDES else None
    found.backward[channel] = way == "backward"
    if pulse.seen == "none" and other.seen.partition(" ")[0] in (*SIDES, "none"):
        found.faults.append(
            f"{channel} motor dead: nothing turned when the pins stated for the {channel} motor "
            "were driven: look at its two wires at motor and driver, the jumper on the driver's "
            "enable pin, and the wires from the board to enable, in1 and in2"
        )
    elif which in ("both", "opposite"):
        found.faults.append(
            f"both motors hang on the {channel} output of the driver: give each its own"
        )


def _check_encoder(
    found: DetectedWiring, wheel: str, pulses: Mapping[str, MotorPulse], noisy: set[str]
) -> None:
    """At which socket the encoder of `wheel` answers."""
    found.socket[wheel] = None
    turned = [pulse for pulse in pulses.values() if found.wheel[pulse.channel] == wheel]
    if not turned:
        return
    heard = [s for s in SIDES if s not in noisy and turned[0].counts[s] >= PULSE_COUNTS_MIN]
    if len(heard) == 1:
        found.socket[wheel] = heard[0]
        return
    if len(heard) == 2:
        found.faults.append(
            f"both encoders answer when only the {wheel} wheel turns: their wires touch"
        )
    elif noisy:
        socket = wheel if wheel in noisy else noisy.copy().pop()
        found.faults.append(
            f"{wheel} encoder floating: its input ({socket}) counts while nothing turns: the "
            "signal wire is off or broken, or the sensor has no ground"
        )
    else:
        found.faults.append(
            f"{wheel} encoder dead: the wheel turns and nothing is counted: look at the sensor's "
            "supply and signal wire, and whether the disc runs in its slot"
        )


def _report_swaps(found: DetectedWiring) -> None:
    wheels, sockets = found.wheel, found.socket
    if wheels["left"] == "right" and wheels["right"] == "left":
        found.mended.append("motors swapped: the left output turns the right wheel")
    elif (
        "right" == wheels["left"] == wheels["right"] or "left" == wheels["left"] == wheels["right"]
    ):
        found.faults.append(
            f"both outputs turn the {wheels['left']} wheel: look at the motor wires"
        )
    if any(sockets[wheel] == OTHER_SIDE[wheel] for wheel in SIDES):
        found.mended.append("encoders swapped: each is plugged in where the other one is stated")
    for channel in SIDES:
        wheel = wheels[channel]
        if wheel and found.backward[channel]:
            found.mended.append(f"{wheel} motor reversed: it turned backward when told forward")


def wiring_findings(found: DetectedWiring, robot: Robot) -> list[Finding]:
    """The pins and directions that make each side of the board drive and hear its own wheel."""
    return [*_motor_findings(found, robot), *_encoder_findings(found, robot)]


def _motor_findings(found: DetectedWiring, robot: Robot) -> list[Finding]:
    made: list[Finding] = []
    if not found.proven:
        return made
    drive = {"left": robot.drive.left, "right": robot.drive.right}
    for channel in SIDES:
        wheel = found.wheel[channel]
        assert wheel is not None
        motor = drive[channel].motor
        if wheel != channel:
            made += [
                Finding(f"drive.{wheel}.motor.{pin}", str(getattr(motor, pin)))
                for pin in MOTOR_PINS
            ]
        wanted = motor.reversed != found.backward[channel]
        if wanted != drive[wheel].motor.reversed:
            made.append(Finding(f"drive.{wheel}.motor.reversed", wanted))
    return made


def _encoder_findings(found: DetectedWiring, robot: Robot) -> list[Finding]:
    if not any(found.socket[wheel] == OTHER_SIDE[wheel] for wheel in SIDES):
        return []
    pins = {"left": robot.drive.left.encoder.pin, "right": robot.drive.right.encoder.pin}
    return [Finding(f"drive.{wheel}.encoder.pin", str(pins[OTHER_SIDE[wheel]])) for wheel in SIDES]
