"""Checks of the distance sensors: their keys, their number, and how often a guard gets readings."""

from __future__ import annotations

from collections.abc import Mapping
from math import ceil, degrees, pi, remainder

from diffbotctl.blocks.obstacle_stop import ObstacleStop, guard_sensor
from diffbotctl.blocks.range_sensor import RangeSensor
from diffbotctl.config.board_pins import SIMULATED
from diffbotctl.config.checks.context import CheckContext, check
from diffbotctl.config.checks.graph import nodes_with_inputs
from diffbotctl.config.node_ports import SENSOR_MESSAGES
from diffbotctl.config.robot import SensorSection, board_sensors
from diffbotctl.config.yaml_tree import Value
from diffbotctl.errors import Place, join_words
from diffbotctl.geometry.distance_sensors import (
    CUSTOM,
    ECHOES,
    SENSORS_MAX,
    further_sensors,
    is_analog,
    sensor_timing,
)
from diffbotctl.geometry.lidars import LIDARS

# rad from straight ahead; a sensor that looks farther aside does not see what is in the way
GUARD_ASIDE_MAX = pi / 4
# m that a sensor may stand beyond the stated outline: a ruler, and a sensor's own thickness
BEYOND_OUTLINE_MAX = 0.05
# s; radio, line and the frame before, besides the way of the sound
TRANSPORT_TIME = 0.06


@check()
def check_sensors(context: CheckContext) -> None:
    """Check each distance sensor's keys, and what the board makes of several."""
    if context.robot is None:
        return
    for name, sensor in (context.robot.sensors or {}).items():
        if sensor is not None and sensor.type is not None:
            _check_keys(context, name, sensor)
    _check_views(context)
    if context.values("board.type") in (None, (SIMULATED,)):
        return
    sensors = board_sensors(context.robot)
    _check_pinless(context, sensors)
    if context.values("link.protocol") == ("rosserial",):
        _check_stock(context, sensors)
        return
    for name in list(sensors)[SENSORS_MAX:]:
        cause = f"a board reads {SENSORS_MAX} distance sensors, and '{name}' is one more"
        context.error("E-BOARD-SENSOR", _place(context, name), cause, "remove one of them")
    _check_guards(context, sensors)


def _place(context: CheckContext, name: str, key: str = "") -> Place | str:
    sensor = context.robot_value("sensors", name)
    if sensor is None:
        return context.robot_place("sensors")
    value = context.robot_value("sensors", name, key) if key else None
    return value.place if value is not None else sensor.name_place


def _check_keys(context: CheckContext, name: str, sensor: SensorSection) -> None:
    """Refuse keys of another type of sensor."""
    keys = _pin_keys(sensor)
    for key in ("pin", "trigger", "echo"):
        if key not in keys and getattr(sensor, key, None) is not None:
            cause = f"'{name}' has the type {sensor.type}, which has no {key}"
            pins = f"the pins {': and '.join(keys)}:" if keys else "read it with a source"
            fix = f"write {key}: none, and {pins}"
            context.error("E-SENSOR-KEY", _place(context, name, key), cause, fix)
    for key in ("device", "upside_down"):
        if sensor.type not in LIDARS and getattr(sensor, key):
            cause = f"'{name}' has the type {sensor.type}; only a lidar has {key}"
            context.error("E-SENSOR-KEY", _place(context, name, key), cause, f"remove {key}")
    _check_curve(context, name, sensor)


def _check_curve(context: CheckContext, name: str, sensor: SensorSection) -> None:
    """Refuse the figures of another Sharp sensor where they do not belong, or are missing."""
    for key in ("near", "reach"):
        value = getattr(sensor, key, None)
        if sensor.type == CUSTOM and value is None:
            _refuse_missing(context, name, key)
        elif sensor.type != CUSTOM and value is not None:
            cause = f"{key} of a {sensor.type} is known from its data sheet"
            fix = f"remove {key}, or write type: {CUSTOM}"
            context.error("E-SENSOR-KEY", _place(context, name, key), cause, fix)
    if sensor.type != CUSTOM:
        return
    for key in "abc":
        if getattr(sensor.curve, key, None) is None:
            _refuse_missing(context, name, f"curve.{key}")
    if sensor.near is not None and sensor.reach is not None and sensor.near >= sensor.reach:
        cause = f"near of {sensor.near * 100:g} cm is not below reach of {sensor.reach * 100:g} cm"
        fix = "near is the smallest distance that it measures, reach the largest"
        context.error("E-SENSOR-KEY", _place(context, name, "near"), cause, fix)


def _pin_keys(sensor: SensorSection) -> tuple[str, ...]:
    """The keys of the pins at which a board reads a sensor of this type; none: no board does."""
    if sensor.type in ECHOES:
        return ("trigger", "echo")
    return ("pin",) if is_analog(sensor.type) else ()


def _check_pinless(context: CheckContext, read: Mapping[str, SensorSection]) -> None:
    """Refuse a sensor with one pin of two, and wires from sensors that the board does not read."""
    for name, sensor in ((context.robot.sensors or {}) if context.robot else {}).items():
        if sensor is None or sensor.type is None:
            continue
        if name in read:
            for key in _pin_keys(sensor):
                if getattr(sensor, key) is None:
                    cause = f"the board reads '{name}' at two pins, and its {key} has none"
                    fix = "set both pins; or neither, if a source of the pipeline reads it"
                    context.error("E-BOARD-PIN", _place(context, name, key), cause, fix)
            continue
        if sensor.device and sensor.type in LIDARS:
            continue
        for node, source in _wires_from(context, name).items():
            kind = SENSOR_MESSAGES[sensor.type]
            given = [wire for wire, use in context.inputs.items() if use.kind is kind]
            cause = f"the board does not read '{name}', which has no pin"
            fix = f"wire '{node}' to {join_words(given)}"
            if not given:
                fix = f"add a source that reads it, such as `sources: {{{name}: {{driver: ...}}}}`"
                fix += f", and wire '{node}' to it; `diffbotctl blocks` lists the drivers"
                fix += "; or set its pin" if _pin_keys(sensor) else ""
            if sensor.type in LIDARS:
                fix = f"state its serial port: `{name}: {{device: /dev/ttyUSB1}}`"
                fix += f"; or wire '{node}' to {join_words(given)}" if given else ""
            if context.real:
                cause += f": '{node}' would have no data"
                context.error("E-BOARD-SENSOR", source.place, cause, fix)
            else:
                cause += f": '{node}' has its data in the simulator only"
                context.warn("W-BOARD-SENSOR", source.place, cause, fix)


def _refuse_missing(context: CheckContext, name: str, key: str) -> None:
    cause = (
        f"'{name}' has the type {CUSTOM}, of which near, reach and curve must be stated; {key} is "
        "not"
    )
    fix = "add it: volts = a / (distance + b) + c, in V m, m and V"
    context.error("E-SENSOR-KEY", _place(context, name), cause, fix)


def _check_stock(context: CheckContext, sensors: Mapping[str, SensorSection]) -> None:
    """The book's firmware sends one voltage."""
    kinds = {name: sensor.type for name, sensor in sensors.items()}
    for name in further_sensors(kinds):
        wires = _wires_from(context, name)
        reads = "the book's firmware reads one Sharp sensor"
        if context.real and wires:
            for node, source in wires.items():
                cause = f"'{node}' uses the sensor '{name}', but {reads}: it would have no data"
                fix = "remove the block, or flash our firmware: link: {protocol: diffbot}"
                context.error("E-BOARD-SENSOR", source.place, cause, fix)
            continue
        cause = f"{reads}; '{name}' has data in the simulator only"
        fix = "remove it, or flash our firmware: link: {protocol: diffbot}"
        context.warn("W-BOARD-SENSOR", _place(context, name), cause, fix)


def _wires_from(context: CheckContext, sensor: str) -> dict[str, Value]:
    """The wires from this sensor, by the node that they lead to."""
    return {
        node: source
        for node, value in nodes_with_inputs(context).items()
        if (inputs := value.at("in"))
        for source in inputs.entries.values()
        if source.data == f"robot.{sensor}"
    }


def _check_views(context: CheckContext) -> None:
    """Refuse a block that takes one sensor for another, and a guard that sees aside or too late."""
    sensors = {
        name: sensor
        for name, sensor in ((context.robot.sensors or {}) if context.robot else {}).items()
        if sensor is not None
    }
    for node, block in context.block_classes.items():
        parameters = context.parameters.get(node)
        if parameters is None or "sensor" not in parameters:
            continue
        is_guard = issubclass(block, ObstacleStop)
        name = parameters["sensor"]
        name = guard_sensor(sensors, name) if is_guard else name
        measuring = _measuring_sensor(context, node)
        if measuring != name and {measuring, name} <= sensors.keys():
            cause = (
                f"'{node}' takes its distances for those of '{name}', but they are measured by "
                f"'{measuring}', which stands elsewhere on the robot"
            )
            value = context.parameter_value(node, "sensor")
            fix = f"write with: {{sensor: {measuring}}}"
            context.error("E-SENSOR-PLACE", value.place if value else node, cause, fix)
            continue
        if not is_guard:
            continue
        mounted = context.values(
            *(f"sensors.{name}.at.{key}" for key in ("x", "y", "heading")),
            "body.front",
            "body.width",
        )
        if mounted is None:
            continue
        x, y, heading, front, width = mounted
        aside = remainder(heading, 2 * pi)
        if abs(aside) > GUARD_ASIDE_MAX:
            cause = (
                f"'{node}' keeps the way ahead free, but '{name}' looks {abs(degrees(aside)):.0f} "
                f"deg to the {'left' if aside > 0.0 else 'right'}"
            )
            ahead = "correct at.heading, or name the sensor that looks ahead: with: {sensor: ...}"
            place = context.error_place(
                f"sensors.{name}.at.heading", also=[context.parameter_value(node, "sensor")]
            )
            context.error("E-SENSOR-PLACE", place, cause, ahead)
        elif x > front + BEYOND_OUTLINE_MAX:
            cause = (
                f"'{name}' stands {x * 1000:.0f} mm in front of the axle, but the robot ends at "
                f"{front * 1000:.0f} mm: '{node}' would take an obstacle for farther away"
            )
            place = context.error_place(f"sensors.{name}.at.x", "body.front")
            context.error("E-SENSOR-PLACE", place, cause, "correct at.x of it, or body.front")
        elif abs(y) > 0.5 * width + BEYOND_OUTLINE_MAX:
            side = "left" if y > 0.0 else "right"
            cause = (
                f"'{name}' stands {abs(y) * 1000:.0f} mm to the {side} of the middle, but the "
                f"robot ends at {500 * width:.0f} mm: '{node}' would not see what is in the way"
            )
            place = context.error_place(f"sensors.{name}.at.y", "body.width")
            context.error("E-SENSOR-PLACE", place, cause, "correct at.y of it, or body.width")


def _measuring_sensor(context: CheckContext, node: str) -> str | None:
    """The sensor whose distances a block gets, from the robot or from a block `range_sensor`.

    None: not known.
    """
    scan = context.pipeline_value("blocks", node, "in", "scan")
    if scan is not None:
        return str(scan.data).removeprefix("robot.")
    source = context.pipeline_value("blocks", node, "in", "range")
    block = str(source.data).partition(".")[0] if source is not None else ""
    if not issubclass(context.block_classes.get(block, ObstacleStop), RangeSensor):
        return None
    return context.parameters.get(block, {}).get("sensor")


def _check_guards(context: CheckContext, sensors: Mapping[str, SensorSection]) -> None:
    """Compare the age of a reading when the next one arrives with what a guard accepts."""
    telemetry = context.values("board.telemetry")
    if telemetry is None or any(sensor.type is None for sensor in sensors.values()):
        return
    kinds = {name: sensor.type for name, sensor in sensors.items()}
    for node, block in context.block_classes.items():
        parameters = context.parameters.get(node)
        if parameters is None or not issubclass(block, ObstacleStop):
            continue
        sensor, limit = guard_sensor(sensors, parameters["sensor"]), parameters["stale_after"]
        if sensor not in further_sensors(kinds) or limit is None:
            continue
        timing = sensor_timing(kinds, sensor, telemetry[0])
        oldest = timing.period + timing.measuring + TRANSPORT_TIME
        if oldest <= limit:
            continue
        cause = (
            f"'{sensor}' is measured every {timing.period * 1000:.0f} ms, in turn with the others, "
            f"so its readings get {oldest * 1000:.0f} ms old; '{node}' stops the robot after "
            f"{limit * 1000:.0f} ms"
        )
        fix = f"set stale_after: {ceil(oldest * 20) / 20:g} s, or remove a sensor"
        value = context.parameter_value(node, "stale_after") or context.pipeline_value(
            "blocks", node
        )
        place = value.place if value is not None else node
        context.error("E-RANGE-RATE", place, cause, fix)
