"""What our firmware must know of a robot, in SI units, and its form on the wire."""

from __future__ import annotations

from dataclasses import dataclass
from math import isfinite

from diffbotctl.links import diffbot_frames as frames
from diffbotctl.links.diffbot_codec import checksum, pack
from diffbotctl.time import MICROSECOND, MILLISECOND

BAUDS = {int(code.meaning): code for code in frames.BaudCode}
FIRST_BAUD = 9600  # of UART1, before any settings
REFERENCE = 5.0  # V; what an analog reading of full scale means on a Mega 2560


@dataclass(frozen=True)
class WheelSettings:
    """One wheel's motor and encoder; pins are the board's numbers (A0 is 54 on a Mega 2560)."""

    enable: int
    in1: int
    in2: int
    encoder: int
    """pin of the encoder's (first) channel"""
    encoder_b: int | None = None
    """pin of the second channel of a quadrature encoder"""
    reversed: bool = False
    """true when in1 high and in2 low turns the wheel backwards"""
    encoder_reversed: bool = False
    """true when a quadrature encoder counts down going forward"""
    start: float = 0.10
    """duty that just moves the wheel: kS of the speed loop"""
    gain: float = 0.086
    """duty per rad/s above that: kV of the speed loop"""


@dataclass(frozen=True)
class BoardSettings:
    """All settings of one robot. Times are ns."""

    left: WheelSettings
    right: WheelSettings
    slots: int = 20
    """counts in a turn of the wheel"""
    edge: str = "rising"
    """which flanks count: `rising`, `falling` or `both`"""
    glitch: int = 2_000_000
    """ns that a level must have lasted for the edge that ends it to count"""
    deadman: int = 300_000_000
    """ns without a valid command after which the board stops by itself"""
    telemetry: int = 40
    """state frames a second"""
    edge_times: bool = True
    """whether frames tell the ages of the last edges"""
    proportional: float = 0.0
    """kP, duty per rad/s of error"""
    integral: float = 0.02
    """kI, duty per rad of error"""
    brake: bool = False
    """brake at rest rather than coast"""
    enable_inverted: bool = False
    """true when the driver is enabled by a low level"""
    range_channel: int | None = None
    """analog channel of the distance sensor"""
    range_name: str = "range"
    """output port on which its voltage appears"""
    battery_channel: int | None = None
    """analog channel of the battery's divider"""
    battery_divider: float = 1.0
    """battery volts per volt at the pin"""
    battery_low: float = 0.0
    """V below which the battery counts as low"""
    button: int | None = None
    """pin of the stop button"""
    button_high: bool = False
    """true when pressing gives a high level"""
    uart: int = 1
    """the board's UART that the host talks to: 0 is USB, 1 the radio module"""
    baud: int = FIRST_BAUD
    """baud rate of UART1"""

    def frame(self) -> frames.SettingsFrame:
        """The settings as they are sent and stored.

        Raises ValueError for a value that has no form on the wire; whether the board can use it,
        the board says.
        """
        left, right = self.left, self.right
        return frames.SettingsFrame(
            edge=frames.EdgeCode[self.edge.upper()],
            edge_times=int(self.edge_times),
            brake=int(self.brake),
            left_reversed=int(left.reversed),
            right_reversed=int(right.reversed),
            left_encoder_reversed=int(left.encoder_reversed),
            right_encoder_reversed=int(right.encoder_reversed),
            enable_inverted=int(self.enable_inverted),
            button_high=int(self.button_high),
            reserved=0,
            baud=BAUDS[self.baud],
            left_enable=left.enable,
            left_in1=left.in1,
            left_in2=left.in2,
            left_encoder=left.encoder,
            left_encoder_b=_pin(left.encoder_b),
            right_enable=right.enable,
            right_in1=right.in1,
            right_in2=right.in2,
            right_encoder=right.encoder,
            right_encoder_b=_pin(right.encoder_b),
            button=_pin(self.button),
            range=_pin(self.range_channel),
            battery=_pin(self.battery_channel),
            telemetry=_whole("telemetry", self.telemetry),
            slots=_whole("slots", self.slots),
            glitch=_whole("glitch", round(self.glitch / MICROSECOND)),
            deadman=_whole("dead-man", round(self.deadman / MILLISECOND)),
            left_start=_gain("start", left.start),
            left_gain=_gain("gain", left.gain),
            right_start=_gain("start", right.start),
            right_gain=_gain("gain", right.gain),
            proportional=_gain("proportional", self.proportional),
            integral=_gain("integral", self.integral, frames.INTEGRAL_ONE),
        )

    def mark(self) -> int:
        """Checksum of the settings, which a board that uses them shows at the handshake."""
        return checksum(pack(self.frame()))


def settings_name(mark: int) -> str:
    """Four hex digits by which people may compare settings."""
    return f"{mark:06X}"[:4]


def _pin(pin: int | None) -> int:
    return frames.PIN_NONE if pin is None else pin


def _whole(name: str, value: int, most: int = 0xFFFF) -> int:
    if not 0 <= value <= most:
        raise ValueError(f"{name} of {value} does not fit the board's settings (0 to {most})")
    return value


def _gain(name: str, value: float, one: int = frames.GAIN_ONE) -> int:
    if not isfinite(value):
        raise ValueError(f"{name} is not a number ({value})")
    return _whole(name, round(value * one))
