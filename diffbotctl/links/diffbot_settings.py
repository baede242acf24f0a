"""Settings that our firmware needs of a robot, in SI units, and the frame that carries them."""

from __future__ import annotations

from dataclasses import dataclass
from math import isfinite

from diffbotctl.links import diffbot_frames as frames
from diffbotctl.links.diffbot_codec import checksum, pack
from diffbotctl.time import MICROSECOND, MILLISECOND

UINT16_MAX = 0xFFFF
BAUDS = {int(code.meaning): code for code in frames.BaudCode}
FIRST_BAUD = 9600  # of UART1, before the board has settings
REFERENCE_V = 5.0  # full scale of an analog input of a Mega 2560


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
    """duty that just moves the wheel, kS of the speed loop"""
    gain: float = 0.086
    """duty per rad/s above that, kV of the speed loop"""

    def fields(self) -> dict[str, int]:
        """Fields of the settings frame, without the prefix `left_` or `right_`."""
        return {
            "reversed": int(self.reversed),
            "encoder_reversed": int(self.encoder_reversed),
            "enable": self.enable,
            "in1": self.in1,
            "in2": self.in2,
            "encoder": self.encoder,
            "encoder_b": _pin(self.encoder_b),
            "start": _gain("start", self.start),
            "gain": _gain("gain", self.gain),
        }


@dataclass(frozen=True)
class BoardSettings:
    """All settings of one robot. Times are ns."""

    left: WheelSettings
    right: WheelSettings
    slots: int = 20
    """counts per turn of the wheel"""
    edge: str = "rising"
    """edges that count: `rising`, `falling` or `both`"""
    glitch: int = 2_000_000
    """minimum duration (ns) of a level for the edge at its end to count"""
    deadman: int = 300_000_000
    """ns without a valid command after which the board stops the motors"""
    telemetry: int = 40
    """state frames a second"""
    edge_times: bool = True
    """whether frames carry the ages of the last edges"""
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
    """analog channel of the battery's voltage divider"""
    battery_divider: float = 1.0
    """battery volts per volt at the pin"""
    battery_low: float = 0.0
    """battery voltage (V) below which a low battery is reported"""
    button: int | None = None
    """pin of the stop button"""
    button_high: bool = False
    """true when pressing gives a high level"""
    uart: int = 1
    """the board's UART that the host is connected to: 0 is USB, 1 the radio module"""
    baud: int = FIRST_BAUD
    """baud rate of UART1"""

    def frame(self) -> frames.SettingsFrame:
        """Settings frame, as it is sent and as the board stores it.

        Raises ValueError for a value that does not fit its field. The board checks whether it can
        use the values.
        """
        sides = {"left": self.left, "right": self.right}
        wheels = {
            f"{side}_{field}": value
            for side, wheel in sides.items()
            for field, value in wheel.fields().items()
        }
        return frames.SettingsFrame(
            edge=frames.EdgeCode[self.edge.upper()],
            edge_times=int(self.edge_times),
            brake=int(self.brake),
            enable_inverted=int(self.enable_inverted),
            button_high=int(self.button_high),
            reserved=0,
            baud=BAUDS[self.baud],
            button=_pin(self.button),
            range=_pin(self.range_channel),
            battery=_pin(self.battery_channel),
            telemetry=_uint16("telemetry", self.telemetry),
            slots=_uint16("slots", self.slots),
            glitch=_uint16("glitch", round(self.glitch / MICROSECOND)),
            deadman=_uint16("dead-man", round(self.deadman / MILLISECOND)),
            proportional=_gain("proportional", self.proportional),
            integral=_gain("integral", self.integral, frames.INTEGRAL_ONE),
            **wheels,
        )

    def mark(self) -> int:
        """Checksum of the settings; a board that uses them sends it in its hello."""
        return checksum(pack(self.frame()))


def settings_name(mark: int) -> str:
    """Four hex digits of a checksum, for a person to compare settings."""
    return f"{mark:06X}"[:4]


def _pin(pin: int | None) -> int:
    return frames.PIN_NONE if pin is None else pin


def _uint16(name: str, value: int) -> int:
    if not 0 <= value <= UINT16_MAX:
        raise ValueError(f"{name} of {value} does not fit the board's settings (0 to {UINT16_MAX})")
    return value


def _gain(name: str, value: float, one: int = frames.GAIN_ONE) -> int:
    if not isfinite(value):
        raise ValueError(f"{name} is not a number ({value})")
    return _uint16(name, round(value * one))
