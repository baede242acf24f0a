"""Distance sensors that a robot file can name, with the figures of their data sheets.

Sharp sensors have an analog output. Their voltage falls with the distance, and falls again closer
than a few centimetres, where the light misses the detector. The rows are in
parts/distance_sensors.yaml.

An HC-SR04 answers a trigger with a pulse as long as the sound was on its way.
"""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Mapping
from math import inf
from typing import Literal, NamedTuple

from diffbotctl import parts

SPEED_OF_SOUND = 343.2  # m/s, in air of 20 C; 0.6 m/s more for each degree
TURN = 0.051  # s, that the firmware gives each of the sensors that it measures in turn
SENSORS_MAX = 4
RESIDUAL_VOLTS = 0.06  # a Sharp's amplifier does not reach ground when nothing reflects

Points = tuple[tuple[float, float], ...]


class SensorFold(NamedTuple):
    """Where the curve of a Sharp sensor is ambiguous. Ratios are those of the voltage at `near`."""

    peak_ratio: float  # above it the object is about at the peak
    peak_width: float  # m; the voltage is above that ratio over so much
    contact_ratio: float  # below it an object in front of the peak touches the sensor
    width: float  # m; from where the ambiguous part begins to the contact


class SharpFacts(NamedTuple):
    """Figures of a Sharp sensor."""

    title: str
    near: float  # m; closer is ambiguous
    reach: float  # m; the voltage hardly changes beyond
    period: float  # s, typical, from one measurement to the next
    period_max: float  # s, at most, with the 5 ms until the output is valid
    current: float  # A, average
    curve: tuple[float, float, float]
    """a (V m), b (m), c (V) of volts = a / (distance + b) + c between `near` and `reach`"""
    tail: tuple[float, float, float]  # the same beyond the last point
    points: Points  # (m, V), from contact on
    fold: SensorFold
    size: tuple[float, float, float]  # m: depth, width, height
    mass: float  # kg


class EchoFacts(NamedTuple):
    """Figures of an ultrasonic sensor."""

    title: str
    near: float  # m; closer echoes are lost in the burst
    reach: float  # m
    current: float  # A
    size: tuple[float, float, float]
    mass: float


_ROWS = parts.rows("distance_sensors")
SHARPS = {
    name: SharpFacts(**row | {"fold": SensorFold(**row["fold"])})
    for name, row in _ROWS.items()
    if "points" in row
}
ECHOES = {name: EchoFacts(**row) for name, row in _ROWS.items() if name not in SHARPS}
CUSTOM = "sharp_custom"  # a Sharp sensor of another type: its reach and curve are in the robot file
FACTS: dict[str, SharpFacts | EchoFacts] = {**SHARPS, **ECHOES}
TYPES = (*FACTS, CUSTOM)


def sensor_facts(
    kind: str, near: float | None = None, reach: float | None = None
) -> SharpFacts | EchoFacts:
    """The figures of a sensor; `near` and `reach` (m) are those of a `sharp_custom`.

    Its fold is that of a GP2Y0A41 with all lengths in proportion, its period the longest known.
    """
    if kind in FACTS:
        return FACTS[kind]
    known = SHARPS["sharp_gp2y0a41sk0f"]
    near, reach = near or known.near, reach or known.reach
    scale = near / known.near
    fold = known.fold._replace(
        peak_width=scale * known.fold.peak_width, width=scale * known.fold.width
    )
    slow = SHARPS["sharp_gp2y0a02yk0f"]
    return slow._replace(title="Sharp sensor", near=near, reach=reach, fold=fold)


def volts_at(distance: float, a: float, b: float, c: float) -> float:
    """Voltage of the curve at `distance` (m); a in V m, b in m, c in V."""
    return a / (distance + b) + c


def paper_volts(facts: SharpFacts, distance: float) -> float:
    """Voltage at `distance` (m) of white paper; RESIDUAL_VOLTS where nothing reflects."""
    points = facts.points
    if distance >= points[-1][0]:
        if distance == inf:
            return RESIDUAL_VOLTS
        return max(RESIDUAL_VOLTS, volts_at(distance, *facts.tail))
    distance = max(distance, 0.0)
    after = bisect_right(points, distance, key=lambda point: point[0])
    (near, high), (far, low) = points[after - 1], points[after]
    return high + (low - high) * (distance - near) / (far - near)


EchoState = Literal["clear", "measured", "too_close"]


def echo_distance(seconds: float, facts: EchoFacts) -> tuple[float, EchoState]:
    """Distance (m) and state of an echo of this length; infinite without an echo."""
    distance = 0.5 * SPEED_OF_SOUND * seconds
    if distance >= facts.reach:
        return facts.reach, "clear"
    if distance < facts.near:
        return 0.0, "too_close"
    return distance, "measured"


class SensorTiming(NamedTuple):
    """How often and how late a board reports a sensor."""

    period: float  # s, between two readings
    measuring: float  # s, at most, from a change in front of the sensor to a reading that shows it


def is_analog(kind: str) -> bool:
    """Whether a sensor of this type has an analog output."""
    return kind in SHARPS or kind == CUSTOM


def further_sensors(kinds: Mapping[str, str]) -> list[str]:
    """Names of the sensors that are measured in turn: all but the first analog one.

    `kinds`: types by name, in the order of the robot file.
    """
    read = [name for name, kind in kinds.items() if is_analog(kind) or kind in ECHOES]
    first = next((name for name in read if is_analog(kinds[name])), None)
    return [name for name in read if name != first]


def sensor_timing(kinds: Mapping[str, str], name: str, telemetry: float) -> SensorTiming:
    """Timing of the sensor `name`; `telemetry` frames are sent in a second."""
    kind = kinds.get(name, "")
    facts = sensor_facts(kind)
    if isinstance(facts, SharpFacts):
        measuring = facts.period_max
    else:
        measuring = 2 * facts.reach / SPEED_OF_SOUND
    further = further_sensors(kinds)
    period = len(further) * TURN if name in further else 1.0 / telemetry
    return SensorTiming(period, measuring)
