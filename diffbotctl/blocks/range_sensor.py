"""Range sensor: distance from the voltage of a Sharp infrared sensor."""

from __future__ import annotations

from collections.abc import Mapping
from math import hypot, isfinite, radians
from typing import Protocol

from diffbotctl.block import Block, FromRobot, In, Out
from diffbotctl.geometry.distance_sensors import (
    SHARPS,
    SensorFold,
    SharpFacts,
    sensor_facts,
    volts_at,
)
from diffbotctl.messages import Odometry, Range, Resume, Volts
from diffbotctl.params import Param

REACH = SHARPS["sharp_gp2y0a41sk0f"].reach
# A turn that brings the beam off an object at the sensor, and a way (m) longer than any fold.
LEFT_TURN = radians(45.0)
LEFT_DISTANCE = 0.3
ZERO_READINGS_MAX = 3  # consecutive readings of zero volts; a single one is noise


class Curve(Protocol):
    """volts = a / (distance + b) + c: a in V m, b in m, c in V; None: the data sheet's."""

    a: float | None
    b: float | None
    c: float | None


class DistanceSensor(Protocol):
    """A distance sensor of the robot file; `near` and `reach` (m) of one of another type."""

    type: str
    near: float | None
    reach: float | None


class CurvedSensor(DistanceSensor, Protocol):
    """One with a voltage."""

    curve: Curve


class RangeSensor(Block):
    """Convert the voltage of a Sharp sensor into a distance, with its ambiguity at close range.

    The curve is volts = a / (distance + b) + c, for a GP2Y0A41 from 4 to 30 cm. Closer than 3 cm
    its voltage falls again: 2 cm reads as 5.3 cm. An object that came too close therefore stays
    `too_close` until the voltage has passed the peak again, until the robot has turned or driven
    away from it, as `odometry` shows, or until `resume`. `fault`: no voltage, zero volts, or a
    constant voltage, as the voltage of a working sensor has noise.

    blocks:
      range: {block: range_sensor, in: {volts: robot.front}, with: {sensor: front}}
    """

    sensor = Param(str, default="front", help="Name of the sensor in the robot file.")
    frozen_for: float | None = Param(
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
    odometry = In(Odometry, optional=True, help="The robot's pose.")
    range = Out(Range, help="Distance along the axis of the sensor.")

    def reset(self) -> None:
        sensor = self.sensors[self.sensor]
        facts = sharp_facts(sensor)
        stated = (sensor.curve.a, sensor.curve.b, sensor.curve.c)
        a, b, c = (
            own if value is None else value for own, value in zip(facts.curve, stated, strict=True)
        )
        self.curve = (a, b, c)
        self.reach = facts.reach
        near = volts_at(facts.near, *self.curve)
        self.foldback = FoldbackDetector(near, self.speed, facts.fold)
        self.near_pose: Odometry | None = None  # where something was near, for the last time
        self.last_volts = float("nan")
        self.volts_since = 0
        self.zero_readings = 0
        self.last_resume: Resume | None = None
        self.last_state = ""

    def react(
        self, now: int, volts: Volts | None, resume: Resume | None, odometry: Odometry | None
    ) -> Range | None:
        if resume is not None and resume is not self.last_resume:
            self.last_resume = resume
            self.foldback.reset()
        if volts is None:
            return None
        reading = self._reading(volts, odometry)
        if reading.state != self.last_state:
            self._log_change(reading, volts.volts)
        return reading

    def _log_change(self, reading: Range, volts: float) -> None:
        if reading.state == "fault":
            self.log.warning(f"{self.sensor}: {volts:.2f} V is not a voltage of a working sensor")
        elif self.last_state == "fault":
            self.log.info(f"{self.sensor}: works again, {volts:.2f} V")
        elif self.log.debugs:
            self.log.debug(f"{self.sensor}: {reading.state}, {reading.distance:.3f} m")
        self.last_state = reading.state

    def _reading(self, volts: Volts, odometry: Odometry | None) -> Range:
        if self._is_faulty(volts):
            return Range(volts.time, 0.0, "fault")
        is_too_close = self.foldback.is_too_close(
            volts.time, volts.volts, has_left(self.near_pose, odometry)
        )
        if self.foldback.is_inside:
            self.near_pose = odometry
        if is_too_close:
            return Range(volts.time, 0.0, "too_close")
        distance = distance_at(volts.volts, *self.curve)
        if distance >= self.reach:
            return Range(volts.time, self.reach, "clear")
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


def has_left(place: Odometry | None, odometry: Odometry | None) -> bool:
    """Whether the robot has turned or driven away from `place`: an object there is out of view."""
    if place is None or odometry is None:
        return False
    turn = abs(odometry.heading - place.heading)
    return turn >= LEFT_TURN or hypot(odometry.x - place.x, odometry.y - place.y) >= LEFT_DISTANCE


class FoldbackDetector:
    """Detects objects closer than the peak of the curve, where the voltage is ambiguous.

    A voltage above `near_volts`, that of the nearest unambiguous distance, is too close on either
    side of the peak. When it falls below again, the history decides. The object may have passed the
    peak if the peak was seen, or if the robot at `speed` (m/s) could cross it between two readings.
    It is back on the unambiguous side when the peak was seen again. It is away when the voltage is
    that of nothing, or of a contact, and either has dropped faster than the robot can drive: the
    object has moved away sideways; or the robot has left the place.
    """

    def __init__(
        self,
        near_volts: float,
        speed: float,
        fold: SensorFold = SHARPS["sharp_gp2y0a41sk0f"].fold,
    ) -> None:
        self.near_volts = near_volts
        self.fold = fold
        # Readings less than the width of the peak apart cannot miss it.
        self.peak_time = int(fold.peak_width / speed * 1e9)  # ns
        self.contact_time = int(fold.width / speed * 1e9)  # ns
        self.reset()

    def reset(self) -> None:
        self.is_folded = False
        self.was_folded = False  # before the zone was entered
        self.is_inside = False  # of the zone above `near_volts`
        self.has_peaked = False  # since it was entered
        self.has_jumped = False  # as far as over the peak, since the reading before that
        self.last_time = 0  # time of the last reading, in ns
        self.last_inside = 0  # last time inside, in ns

    def is_too_close(self, now: int, volts: float, has_left: bool = False) -> bool:
        """Process a voltage at `now` (ns); True while an object is or may be too close.

        `has_left`: the robot has left the place where one was near.
        """
        is_jump, self.last_time = now - self.last_time >= self.peak_time, now
        if volts >= self.near_volts:
            self.is_inside, self.last_inside = True, now
            self.has_peaked = self.has_peaked or volts >= self.fold.peak_ratio * self.near_volts
            self.has_jumped = self.has_jumped or is_jump
            return True
        if self.is_inside:
            self._leave(is_jump)
        is_contact = volts < self.fold.contact_ratio * self.near_volts
        has_dropped = now - self.last_inside < self.contact_time and not self.was_folded
        if is_contact and (has_dropped or has_left):
            self.is_folded = False
        return self.is_folded

    def _leave(self, is_jump: bool) -> None:
        self.was_folded = self.is_folded
        if self.is_folded:
            self.is_folded = not self.has_peaked
        else:
            self.is_folded = self.has_peaked or self.has_jumped or is_jump
        self.is_inside = self.has_peaked = self.has_jumped = False


def sharp_facts(sensor: CurvedSensor) -> SharpFacts:
    """The figures of a Sharp sensor of the robot file."""
    facts = sensor_facts(sensor.type, sensor.near, sensor.reach)
    assert isinstance(facts, SharpFacts)  # other sensors are not wired to this block
    return facts


def sensor_reach(sensors: Mapping[str, DistanceSensor], name: str) -> float:
    """Distance (m) up to which a sensor of the robot file measures."""
    sensor = sensors.get(name)
    if sensor is None:
        return REACH
    return sensor_facts(sensor.type, sensor.near, sensor.reach).reach


def distance_at(volts: float, a: float, b: float, c: float) -> float:
    """Distance (m) at this voltage of the curve; infinity at or below its asymptote."""
    return a / (volts - c) - b if volts > c else float("inf")
