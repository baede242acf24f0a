"""Settings that our firmware needs of a robot, in SI units, and the frame that carries them."""

from __future__ import annotations

from dataclasses import dataclass
from math import isfinite
from typing import NamedTuple

from diffbotctl.links import diffbot_frames as frames
from diffbotctl.links.diffbot_codec import checksum, pack
from diffbotctl.time import MICROSECOND, MILLISECOND, SECOND

UINT16_MAX = 0xFFFF
BAUDS = {int(code.meaning): code for code in frames.BaudCode}
FIRST_BAUD = 9600  # of UART1, before the board has settings
REFERENCE_V = 5.0  # full scale of an analog input
LAG_UNIT, LAG_MAX = 10 * MILLISECOND, 255


class RangeInput(NamedTuple):
    """A distance sensor whose measurements come in frames of their own."""

    name: str  # output port on which they appear
    pin: int  # pin of its echo, or its analog channel
    trigger: int | None = None  # pin of its trigger; None: an analog sensor


class GyroInput(NamedTuple):
    """A gyro on the board's I2C bus."""

    address: int
    axis: int = 2  # its axis that is vertical: 0 x, 1 y, 2 z
    is_reversed: bool = False  # true when that axis points down
    is_lsm6: bool = False  # an LSM6DS3 or LSM6DSO; else one of the MPU6050's family
    is_upward_checked: bool = False
    """whether the board compares the direction of that axis with gravity"""

    @property
    def true_turn(self) -> float:
        """The turn of the robot divided by that of frames, which is in units of an MPU6050."""
        unit = frames.TURN_LSM6_NANODEGREES if self.is_lsm6 else frames.TURN_NANODEGREES
        return (-1.0 if self.is_reversed else 1.0) * unit / frames.TURN_NANODEGREES

    def axis_code(self) -> int:
        """The field gyro_axis of the settings."""
        return self.axis + (frames.GYRO_LSM6 if self.is_lsm6 else 0)

    @property
    def upward(self) -> frames.UpwardCode:
        """The field gyro_upward of the settings."""
        if not self.is_upward_checked:
            return frames.UpwardCode.UNCHECKED
        return frames.UpwardCode.DOWN if self.is_reversed else frames.UpwardCode.UP


@dataclass(frozen=True)
class WheelSettings:
    """One wheel's motor and encoder; pins are the board's numbers (A0 of a Mega 2560 is 54)."""

    enable: int | None
    in1: int
    in2: int | None
    encoder: int | None  # pin of the encoder's (first) channel
    encoder_b: int | None = None  # pin of the second channel of a quadrature encoder
    reversed: bool = False  # true when in1 high and in2 low turns the wheel backwards
    encoder_reversed: bool = False  # true when a quadrature encoder counts down going forward
    start: float = 0.10  # duty that just moves the wheel, kS of the speed loop
    gain: float = 0.086  # duty per rad/s above that, kV of the speed loop
    proportional: float = 0.086  # kP, duty per rad/s of error
    integral: float = 0.86  # kI, duty per rad of error
    slots: int = 20  # counts per turn of the wheel

    def fields(self) -> dict[str, int]:
        """Fields of the settings frame, without the prefix `left_` or `right_`."""
        return {
            "reversed": int(self.reversed),
            "encoder_reversed": int(self.encoder_reversed),
            "enable": _pin(self.enable),
            "in1": self.in1,
            "in2": _pin(self.in2),
            "encoder": _pin(self.encoder),
            "encoder_b": _pin(self.encoder_b),
            "start": _gain("start", self.start),
            "gain": _gain("gain", self.gain),
            "proportional": _gain("proportional", self.proportional),
            "integral": _gain("integral", self.integral, frames.INTEGRAL_ONE),
            "slots": _uint16("slots", self.slots),
        }


@dataclass(frozen=True)
class BoardSettings:
    """All settings of one robot. Times are ns."""

    left: WheelSettings
    right: WheelSettings
    board: frames.BoardCode = frames.BoardCode.MEGA2560  # the board that the pins are those of
    edge: str = "rising"  # edges that count: `rising`, `falling` or `both`
    every_edge: bool = False
    """true when all four edges of a slot of two channels count, and so the `slots` of the wheels"""
    glitch: int = 2_000_000  # minimum duration (ns) of a level for the edge at its end to count
    deadman: int = 300_000_000  # ns without a valid command after which the board stops the motors
    telemetry: int = 38  # state frames a second
    lag: float | None = None  # time constant (s) of the slower motor; None: unknown
    edge_times: bool = True  # whether frames carry the ages of the last edges
    driver: frames.DriverCode = frames.DriverCode.ENABLE_IN1_IN2  # inputs of the motor driver
    standby: int | None = None  # pin of its standby input
    brake: bool = False  # brake at rest rather than coast
    enable_inverted: bool = False  # true when the driver is enabled by a low level
    range_channel: int | None = None  # analog channel of the distance sensor
    range_name: str = "range"  # output port on which its voltage appears
    further_ranges: tuple[RangeInput, ...] = ()
    """HC-SR04 sensors, and analog sensors besides the first one"""
    gyro: GyroInput | None = None  # the gyro whose turn the board sums
    battery_channel: int | None = None  # analog channel of the battery's voltage divider
    battery_divider: float = 1.0  # battery volts per volt at the pin
    battery_low: float = 0.0  # battery voltage (V) below which a low battery is reported
    button: int | None = None  # pin of the stop button
    button_high: bool = False  # true when pressing gives a high level
    uart: int = 1  # the board's UART that the host is connected to: 0 is USB, 1 the radio module
    baud: int = FIRST_BAUD  # baud rate of UART1, or of the only UART
    shares_usb: bool = False
    """true when USB cable and radio module share the only UART, whose rate is `baud` then"""

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
            every_edge=int(self.every_edge),
            reserved=0,
            baud=BAUDS[self.baud],
            button=_pin(self.button),
            range=_pin(self.range_channel),
            battery=_pin(self.battery_channel),
            telemetry=_uint16("telemetry", self.telemetry),
            glitch=_uint16("glitch", round(self.glitch / MICROSECOND)),
            deadman=_uint16("dead-man", round(self.deadman / MILLISECOND)),
            battery_low=self._battery_low_reading(),
            driver=self.driver,
            standby=_from_one(self.standby),
            gyro_address=self.gyro.address if self.gyro else 0,
            gyro_axis=self.gyro.axis_code() if self.gyro else 0,
            gyro_upward=self.gyro.upward if self.gyro else 0,
            lag=min(round((self.lag or 0.0) * SECOND / LAG_UNIT), LAG_MAX),
            **wheels,
            **self._range_pins(),
        )

    def _range_pins(self) -> dict[str, int]:
        sensors = self.further_ranges
        if len(sensors) > frames.RANGE_SENSORS:
            raise ValueError(
                f"a board reads {frames.RANGE_SENSORS} further distance sensors, not {len(sensors)}"
            )
        fields = {}
        for index in range(frames.RANGE_SENSORS):
            sensor = sensors[index] if index < len(sensors) else None
            fields[f"trigger_{index + 1}"] = _from_one(sensor.trigger if sensor else None)
            fields[f"input_{index + 1}"] = _from_one(sensor.pin if sensor else None)
        return fields

    def _battery_low_reading(self) -> int:
        """The board's reading at `battery_low`; 0 when it is not measured."""
        if self.battery_channel is None:
            return 0
        reading = self.battery_low / self.battery_divider / REFERENCE_V * frames.ANALOG_ONE
        return min(round(reading), frames.ANALOG_ONE)

    def mark(self, size: int = 0) -> int:
        """Checksum of the settings; a board that uses them sends it in its hello.

        `size`: bytes of the settings frame that the board knows, 0 for those of this version.
        Fields that only one of both knows are zero.
        """
        payload = pack(self.frame())
        return checksum(payload.ljust(size, b"\0")[:size] if size else payload)


def settings_name(mark: int) -> str:
    """Four hex digits of a checksum, for a person to compare settings."""
    return f"{mark:06X}"[:4]


def _pin(pin: int | None) -> int:
    return frames.PIN_NONE if pin is None else pin


def _from_one(pin: int | None) -> int:
    return 0 if pin is None else pin + 1


def _uint16(name: str, value: int) -> int:
    if not 0 <= value <= UINT16_MAX:
        raise ValueError(f"{name} of {value} does not fit the board's settings (0 to {UINT16_MAX})")
    return value


def _gain(name: str, value: float, one: int = frames.GAIN_ONE) -> int:
    if not isfinite(value):
        raise ValueError(f"{name} is not a number ({value})")
    return _uint16(name, round(value * one))
