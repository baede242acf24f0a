"""Range sensor: distance from the voltage of a Sharp infrared sensor."""

from __future__ import annotations

from collections.abc import Mapping
from math import isfinite
from typing import Protocol

from diffbotctl.block import Block, FromRobot, In, Out
from diffbotctl.messages import Range, Resume, Volts
from diffbotctl.params import Param

DISTANCE_MIN = (
    0.042  # m; the GP2Y0A41SK0F measures from 4 cm (data sheet); the curve is good to 2 mm
)
REACH = 0.30  # m; at larger distances the voltage hardly changes
# The peak, 3.03 V, is 1.14 times the voltage at 4.2 cm. Over 9 mm (typical part: 3.7 to 2.8 cm) the
# voltage exceeds 1.09 times that value, so readings less than 9 mm apart cannot miss the peak.
PEAK_RATIO = 1.09
PEAK_WIDTH = 0.009  # m
# An object at 5 mm gives 1.38 V, half the voltage at 4.2 cm; less means contact or far away.
CONTACT_RATIO = 0.5
FOLDED_WIDTH = 0.020  # m; from 2.5 cm, where the ambiguous part begins, to these 5 mm
ZERO_READINGS_MAX = 3  # consecutive readings of zero volts; a single one is noise


class Curve(Protocol):
    """volts = a / (distance + b) + c: a in V m, b in m, c in V."""

    a: float
    b: float
    c: float


class CurvedSensor(Protocol):
    """A distance sensor of the robot file."""

    curve: Curve


class RangeSensor(Block):
    """Convert the voltage of a Sharp sensor into a distance, with its ambiguity at close range.

    The curve is volts = a / (distance + b) + c from 4 to 30 cm. Closer than 3 cm the voltage falls
    again: 2 cm reads as 5.3 cm. An object that came too close therefore stays `too_close` until the
    voltage has passed the peak again, or until `resume`. `fault`: no voltage, zero volts, or a
    constant voltage, as the voltage of a working sensor has noise.

    blocks:
      range: {block: range_sensor, in: {volts: robot.front}, with: {sensor: front}}
    """

    sensor = Param(str, default="front", help="Name of the sensor in the robot file.")
    frozen_for = Param(
        float,
        unit="s",
        default=3.0,
        above=0.0,
        none=True,
        help="A voltage constant for this time is a fault; none: no check.",
    )
    sensors: Mapping[str, CurvedSensor] = FromRobot("sensors")
    speed = FromRobot("limits.speed")

    volts = In(Volts, help="Voltage of the sensor.")
    resume = In(Resume, optional=True, help="Confirms that nothing is too close.")
    range = Out(Range, help="Distance along the axis of the sensor.")

    def reset(self) -> None:
        curve = self.sensors[self.sensor].curve
        self.curve = (curve.a, curve.b, curve.c)
        near = volts_at(DISTANCE_MIN, *self.curve)
        self.foldback = FoldbackDetector(near, self.speed)
        self.last_volts = float("nan")
        self.volts_since = 0
        self.zero_readings = 0
        self.last_resume: Resume | None = None
        self.last_state = ""

    def react(self, now: int, volts: Volts | None, resume: Resume | None) -> Range | None:
        if resume is not None and resume is not self.last_resume:
            self.last_resume = resume
            self.foldback.reset()
        if volts is None:
            return None
        reading = self._reading(volts)
        if reading.state != self.last_state:
            self._log_change(reading, volts.volts)
        return reading

    def _log_change(self, reading: Range, volts: float) -> None:
        """Log a change of the state."""
        if reading.state == "fault":
            self.log.warning(f"{self.sensor}: {volts:.2f} V is not a voltage of a working sensor")
        elif self.last_state == "fault":
            self.log.info(f"{self.sensor}: works again, {volts:.2f} V")
        elif self.log.debugs:
            self.log.debug(f"{self.sensor}: {reading.state}, {reading.distance:.3f} m")
        self.last_state = reading.state

    def _reading(self, volts: Volts) -> Range:
        if self._is_faulty(volts):
            return Range(volts.time, 0.0, "fault")
        if self.foldback.is_too_close(volts.time, volts.volts):
            return Range(volts.time, 0.0, "too_close")
        distance = distance_at(volts.volts, *self.curve)
        if distance >= REACH:
            return Range(volts.time, REACH, "clear")
        return Range(volts.time, distance, "measured")

    def _is_faulty(self, volts: Volts) -> bool:
        self.zero_readings = self.zero_readings + 1 if volts.volts <= 0.0 else 0
        if not isfinite(volts.volts) or self.zero_readings >= ZERO_READINGS_MAX:
            self.last_volts = float("nan")
            return True
        if volts.volts != self.last_volts:
            self.last_volts, self.volts_since = volts.volts, volts.time
        if self.frozen_for is None:
            return False
        return volts.time - self.volts_since >= self.frozen_for * 1e9


class FoldbackDetector:
    """Detects objects closer than the peak of the curve at 3 cm, where the voltage is ambiguous.

    A voltage above `near_volts`, that of the nearest unambiguous distance, is too close on either
    side of the peak. When it falls below again, the history decides. The object may have passed the
    peak if the peak was seen, or if the robot at `speed` (m/s) could cross it between two readings.
    It is back on the unambiguous side when the peak was seen again, or when the voltage drops
    faster than the robot can drive: then the object has moved away sideways.
    """

    def __init__(self, near_volts: float, speed: float) -> None:
        self.near_volts = near_volts
        self.peak_time = int(PEAK_WIDTH / speed * 1e9)  # ns
        self.contact_time = int(FOLDED_WIDTH / speed * 1e9)  # ns
        self.reset()

    def reset(self) -> None:
        """Forget all readings."""
        self.is_folded = False
        self.was_folded = False  # before the zone was entered
        self.is_inside = False  # of the zone above `near_volts`
        self.has_peaked = False  # since it was entered
        self.has_jumped = False  # as far as over the peak, since the reading before that
        self.last_time = 0  # time of the last reading, in ns
        self.last_inside = 0  # last time inside, in ns

    def is_too_close(self, now: int, volts: float) -> bool:
        """Process a voltage at `now` (ns); True while an object is or may be closer than 4 cm."""
        is_jump, self.last_time = now - self.last_time >= self.peak_time, now
        if volts >= self.near_volts:
            self.is_inside, self.last_inside = True, now
            self.has_peaked = self.has_peaked or volts >= PEAK_RATIO * self.near_volts
            self.has_jumped = self.has_jumped or is_jump
            return True
        if self.is_inside:
            self._leave(is_jump)
        is_contact = volts < CONTACT_RATIO * self.near_volts
        has_dropped = is_contact and now - self.last_inside < self.contact_time
        if has_dropped and not self.was_folded:
            self.is_folded = False
        return self.is_folded

    def _leave(self, is_jump: bool) -> None:
        self.was_folded = self.is_folded
        if self.is_folded:
            self.is_folded = not self.has_peaked
        else:
            self.is_folded = self.has_peaked or self.has_jumped or is_jump
        self.is_inside = self.has_peaked = self.has_jumped = False


def volts_at(distance: float, a: float, b: float, c: float) -> float:
    """Voltage of the curve at `distance` (m); a in V m, b in m, c in V."""
    return a / (distance + b) + c


def distance_at(volts: float, a: float, b: float, c: float) -> float:
    """Distance (m) at this voltage of the curve; infinity at or below its asymptote."""
    return a / (volts - c) - b if volts > c else float("inf")
