"""Distance sensors that a robot file can name, with the figures of their data sheets.

Sharp sensors have an analog output. Their voltage falls with the distance, and falls again closer
than a few centimetres, where the light misses the detector. The curves are those of white paper:
GP2Y0A41SK0F ED-05G101, GP2Y0A21YK0F E4-A00201EN, GP2Y0A02YK0F E4-A00101EN. Ends and supply of the
latter two are the tables' typical values; the points between were read by eye, within 0.05 V, and
not compared again with the sheets.

An HC-SR04 answers a trigger with a pulse as long as the sound was on its way.
"""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Mapping
from math import inf
from typing import Literal, NamedTuple

SPEED_OF_SOUND = 343.2  # m/s, in air of 20 C; 0.6 m/s more for each degree
TURN = 0.051  # s, that the firmware gives each of the sensors that it measures in turn
SENSORS_MAX = 4
RESIDUAL_VOLTS = 0.06  # a Sharp's amplifier does not reach ground when nothing reflects

Points = tuple[tuple[float, float], ...]


class SensorFold(NamedTuple):
    """Where the curve of a Sharp sensor is ambiguous. Ratios are those of the voltage at `near`."""

    peak_ratio: float
    """above it the object is about at the peak"""
    peak_width: float
    """m; the voltage is above that ratio over so much"""
    contact_ratio: float
    """below it an object in front of the peak touches the sensor"""
    width: float
    """m; from where the ambiguous part begins to the contact"""


class SharpFacts(NamedTuple):
    """Figures of a Sharp sensor."""

    title: str
    near: float
    """m; closer is ambiguous"""
    reach: float
    """m; the voltage hardly changes beyond"""
    period: float
    """s, typical, from one measurement to the next"""
    period_max: float
    """s, at most, with the 5 ms until the output is valid"""
    current: float
    """A, average"""
    curve: tuple[float, float, float]
    """a (V m), b (m), c (V) of volts = a / (distance + b) + c between `near` and `reach`"""
    tail: tuple[float, float, float]
    """the same beyond the last point"""
    points: Points
    """(m, V), from contact on"""
    fold: SensorFold
    size: tuple[float, float, float]
    """m: depth, width, height"""
    mass: float
    """kg"""


class EchoFacts(NamedTuple):
    """Figures of an ultrasonic sensor."""

    title: str
    near: float
    """m; closer echoes are lost in the burst"""
    reach: float
    """m"""
    current: float
    """A"""
    size: tuple[float, float, float]
    mass: float


_A41 = (
    *((0.000, 0.03), (0.005, 1.38), (0.010, 1.85), (0.020, 2.22), (0.025, 2.73), (0.030, 3.03)),
    *((0.035, 2.99), (0.040, 2.72), (0.050, 2.34), (0.060, 2.02), (0.070, 1.765), (0.080, 1.56)),
    *((0.090, 1.395), (0.100, 1.265), (0.120, 1.06), (0.140, 0.928), (0.160, 0.813)),
    *((0.180, 0.735), (0.200, 0.656), (0.250, 0.525), (0.300, 0.430), (0.350, 0.370)),
    (0.400, 0.312),
)
_A21 = (
    *((0.00, 0.05), (0.01, 1.30), (0.02, 1.75), (0.03, 2.20), (0.04, 2.65), (0.05, 3.00)),
    *((0.06, 3.15), (0.07, 2.98), (0.08, 2.74), (0.10, 2.31), (0.12, 1.99), (0.14, 1.75)),
    *((0.16, 1.57), (0.18, 1.41), (0.20, 1.29), (0.25, 1.07), (0.30, 0.91), (0.40, 0.72)),
    *((0.50, 0.60), (0.60, 0.51), (0.70, 0.45), (0.80, 0.40)),
)
_A02 = (
    *((0.00, 0.05), (0.02, 0.90), (0.05, 1.60), (0.08, 2.10), (0.10, 2.40), (0.12, 2.60)),
    *((0.15, 2.80), (0.17, 2.73), (0.20, 2.51), (0.25, 2.23), (0.30, 1.95), (0.40, 1.52)),
    *((0.50, 1.24), (0.60, 1.05), (0.70, 0.91), (0.80, 0.81), (0.90, 0.72), (1.00, 0.65)),
    *((1.10, 0.59), (1.20, 0.54), (1.30, 0.49), (1.40, 0.45), (1.50, 0.42)),
)
# The peak of a GP2Y0A41, 3.03 V, is 1.14 times the voltage at 4.2 cm; over 9 mm (3.7 to 2.8 cm) it
# is above 1.09 times. An object at 5 mm gives 1.38 V, half of it; 2.5 cm give as much as 4.2 cm.
_A41_FOLD = SensorFold(1.09, 0.009, 0.5, 0.020)
SHARPS: dict[str, SharpFacts] = {
    "sharp_gp2y0a41sk0f": SharpFacts(
        "Sharp GP2Y0A41",
        *(0.042, 0.30, 0.0165, 0.0252, 0.012),  # measures from 4 cm; the curve is good to 2 mm
        (0.1498, 0.0134, -0.047),
        (0.1502, 0.0135, -0.048),
        _A41,
        _A41_FOLD,
        (0.0135, 0.0295, 0.0130),
        0.0036,
    ),
    "sharp_gp2y0a21yk0f": SharpFacts(
        "Sharp GP2Y0A21",
        *(0.10, 0.80, 0.0383, 0.0529, 0.030),
        (0.2708, 0.0214, 0.0736),  # within 1.4 % of the points
        (0.2708, 0.0214, 0.0736),
        _A21,
        SensorFold(1.25, 0.028, 0.5, 0.023),  # 1.25 x 2.30 V: 7.4 to 4.7 cm
        (0.0135, 0.0295, 0.0130),
        0.0035,
    ),
    "sharp_gp2y0a02yk0f": SharpFacts(
        "Sharp GP2Y0A02",
        *(0.20, 1.50, 0.0383, 0.0529, 0.033),
        (0.8118, 0.1067, -0.0861),  # within 3 %
        (0.8118, 0.1067, -0.0861),
        _A02,
        SensorFold(1.05, 0.042, 0.5, 0.080),  # 1.05 x 2.56 V: 17.6 to 13.3 cm
        (0.0216, 0.0295, 0.0130),
        0.0048,
    ),
}
ECHOES: dict[str, EchoFacts] = {
    "hc_sr04": EchoFacts("HC-SR04", 0.02, 4.0, 0.015, (0.015, 0.045, 0.020), 0.0085)
}
CUSTOM = "sharp_custom"
"""a Sharp sensor of another type: its reach and curve are in the robot file"""
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

    period: float
    """s, between two readings"""
    measuring: float
    """s, at most, from a change in front of the sensor to a reading that shows it"""


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
