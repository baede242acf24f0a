"""Measurements of the distance sensors that the board reads in turn, as messages."""

from __future__ import annotations

from diffbotctl.geometry.distance_sensors import ECHOES, echo_distance
from diffbotctl.links import diffbot_frames as frames
from diffbotctl.links.diffbot_settings import RangeInput
from diffbotctl.links.diffbot_telemetry import volts_of
from diffbotctl.messages import Range, Volts
from diffbotctl.time import SECOND

HC_SR04 = ECHOES["hc_sr04"]
FAULTS = {
    frames.RANGE_SILENT: "does not answer: check its supply and the wires of trigger and echo",
    frames.RANGE_ENDLESS: "holds its echo high for ever: check its GND and the wire of the echo",
}


def further_range(time: int, sensor: RangeInput, value: int) -> Range | Volts:
    """Message of a value that was measured at `time` (ns)."""
    if sensor.trigger is None:
        return Volts(time, volts_of(value - 1))
    if value in FAULTS:
        return Range(time, 0.0, "fault")
    if value == frames.RANGE_NOTHING:
        return Range(time, HC_SR04.reach, "clear")
    return Range(time, *echo_distance(value * frames.ECHO_NANOSECONDS / SECOND, HC_SR04))


def range_fault(sensor: RangeInput, value: int) -> str:
    """What is wrong with a sensor, or an empty text."""
    if sensor.trigger is None or value not in FAULTS:
        return ""
    return f"{sensor.name}: the HC-SR04 {FAULTS[value]}"
