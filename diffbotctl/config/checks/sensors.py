"""Checks of the distance sensors: their keys, their number, and how often a guard gets readings."""

from __future__ import annotations

from math import ceil, degrees, pi, remainder

from diffbotctl.blocks.obstacle_stop import ObstacleStop
from diffbotctl.blocks.range_sensor import RangeSensor
from diffbotctl.config.board_pins import SIMULATED
from diffbotctl.config.checks.context import CheckContext
from diffbotctl.config.checks.graph import nodes_with_inputs
from diffbotctl.config.robot import SensorSection
from diffbotctl.config.yaml_tree import Value
from diffbotctl.errors import Place
from diffbotctl.geometry.distance_sensors import (
    CUSTOM,
    ECHOES,
    FACTS,
    SENSORS_MAX,
    further_sensors,
    sensor_timing,
)

# rad from straight ahead; a sensor that looks farther aside does not see what is in the way
GUARD_ASIDE_MAX = pi / 4
# m that a sensor may stand beyond the stated outline: a ruler, and a sensor's own thickness
BEYOND_OUTLINE_MAX = 0.05
# s; radio, line and the frame before, besides the way of the sound
TRANSPORT_TIME = 0.06


def check_sensors(context: CheckContext) -> None:
    """Check each distance sensor's keys, and what the board makes of several."""
    if context.robot is None:
        return
    sensors = {
        name: sensor
        for name, sensor in (context.robot.sensors or {}).items()
        if sensor is not None and getattr(sensor, "type", "") in (*FACTS, CUSTOM)
    }
    for name, sensor in sensors.items():
        _check_keys(context, name, sensor)
    _check_views(context)
    if context.values("board.type") in (None, (SIMULATED,)):
        return
    if context.values("link.protocol") == ("rosserial",):
        _check_stock(context, list(sensors), sensors)
        return
    for name in list(sensors)[SENSORS_MAX:]:
        cause = f"a board reads {SENSORS_MAX} distance sensors, and '{name}' is one more"
        context.error("E-BOARD-SENSOR", _place(context, name), cause, "remove one of them")
    _check_guards(context)


def _place(context: CheckContext, name: str, key: str = "") -> Place | str:
    sensor = context.robot_value("sensors", name)
    if sensor is None:
        return context.robot_place("sensors")
    value = context.robot_value("sensors", name, key) if key else None
    return value.place if value is not None else sensor.name_place


def _check_keys(context: CheckContext, name: str, sensor: SensorSection) -> None:
    """Refuse keys of another type of sensor."""
    is_echo = sensor.type in ECHOES
    for key in ("pin",) if is_echo else ("trigger", "echo"):
        if getattr(sensor, key, None) is not None:
            cause = f"'{name}' has the type {sensor.type}, which has no {key}"
            fix = f"write {key}: none, and the pins " + (
                "trigger: and echo:" if is_echo else "pin:"
            )
            context.error("E-SENSOR-KEY", _place(context, name, key), cause, fix)
    own = ("near", "reach")
    for key in own:
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


def _refuse_missing(context: CheckContext, name: str, key: str) -> None:
    cause = (
        f"'{name}' has the type {CUSTOM}, of which near, reach and curve must be stated; {key} is "
        "not"
    )
    fix = "add it: volts = a / (distance + b) + c, in V m, m and V"
    context.error("E-SENSOR-KEY", _place(context, name), cause, fix)


def _check_stock(
    context: CheckContext, names: list[str], sensors: dict[str, SensorSection]
) -> None:
    """The book's firmware sends one voltage."""
    kinds = {name: sensors[name].type for name in names}
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
    """Refuse a guard whose sensor looks aside, or stands so far in front that it sees too late."""
    names = list((context.robot.sensors or {}) if context.robot else {})
    for node, block in context.block_classes.items():
        parameters = context.parameters.get(node)
        if parameters is None or not issubclass(block, ObstacleStop):
            continue
        name = parameters["sensor"] or next(iter(names), "")
        measuring = _measuring_sensor(context, node)
        if measuring != name and {measuring, name} <= set(names):
            cause = (
                f"'{node}' takes its distances for those of '{name}', but they are measured by "
                f"'{measuring}', which stands elsewhere on the robot"
            )
            value = context.parameter_value(node, "sensor")
            fix = f"write with: {{sensor: {measuring}}}"
            context.error("E-SENSOR-PLACE", value.place if value else node, cause, fix)
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


def _measuring_sensor(context: CheckContext, guard: str) -> str | None:
    """The sensor whose distances a guard gets from a block `range_sensor`; None: not known."""
    source = context.pipeline_value("blocks", guard, "in", "range")
    block = str(source.data).partition(".")[0] if source is not None else ""
    if not issubclass(context.block_classes.get(block, ObstacleStop), RangeSensor):
        return None
    return context.parameters.get(block, {}).get("sensor")


def _check_guards(context: CheckContext) -> None:
    """Compare the age of a reading when the next one arrives with what a guard accepts."""
    telemetry = context.values("board.telemetry")
    sensors = (context.robot.sensors or {}) if context.robot else {}
    if telemetry is None or any(sensor is None for sensor in sensors.values()):
        return
    kinds = {name: sensor.type for name, sensor in sensors.items()}
    for node, block in context.block_classes.items():
        parameters = context.parameters.get(node)
        if parameters is None or not issubclass(block, ObstacleStop):
            continue
        sensor, limit = parameters["sensor"] or next(iter(sensors), ""), parameters["stale_after"]
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
