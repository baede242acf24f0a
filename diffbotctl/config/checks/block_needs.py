"""Blocks need fields and sensors of the robot: the robot must have them, or the block is left out.

A guard with `needs: Volts` on a robot without any distance sensor is taken out of the pipeline:
the inputs that took its `twist` then take what the guard itself took. So one pipeline serves robots
with different sensors. A warning says when no guard is left.
"""

from __future__ import annotations

from diffbotctl.block import In, inputs, outputs, robot_fields
from diffbotctl.config.checks.context import CheckContext
from diffbotctl.config.node_ports import SENSOR_MESSAGES
from diffbotctl.config.robot import field_value
from diffbotctl.config.yaml_tree import Value
from diffbotctl.errors import Place, closest_match, join_words

SHOWN = 2  # fields that a message names before it says how many there are


def check_fields(context: CheckContext) -> None:
    """Check what each block asks of the robot file, and the sensors that parameters name."""
    for name, kind in context.block_classes.items():
        wanted = robot_fields(kind)
        place = context.pipeline_value("blocks", name)
        if not wanted or place is None:
            continue
        if context.robot is None:
            if context.pipeline_value("robot") is None:
                paths = list(wanted.values())
                more = [f"{len(paths) - SHOWN} more"] if len(paths) > SHOWN else []
                fields = join_words([*paths[:SHOWN], *more], "and")
                cause = f"'{name}' needs the robot's {fields}, but the pipeline has no robot"
                fix = "add `robot: {in: {wheels: ...}}` to the pipeline"
                context.error("E-ROBOT-MISSING", place.place, cause, fix)
            continue
        _check_fields(context, name, wanted)
        _check_sensor(context, name)
    _check_simulated(context)


def _check_fields(context: CheckContext, name: str, wanted: dict[str, str]) -> None:
    for path in wanted.values():
        try:
            field_value(context.robot, path)
        except (AttributeError, KeyError):
            place = context.pipeline_value("blocks", name)
            assert place is not None
            cause = f"'{name}' asks for {path}, which robot files do not have"
            fix = "this is a mistake in the block's own code: mend its FromRobot"
            context.error("E-ROBOT-FIELD", place.place, cause, fix)


def _check_sensor(context: CheckContext, name: str) -> None:
    sensor = context.parameters.get(name, {}).get("sensor")
    value = context.pipeline_value("blocks", name, "with", "sensor") or context.pipeline_value(
        "blocks", name
    )
    if isinstance(sensor, str) and value is not None:
        _check_known(context, sensor, value.place)


def _check_simulated(context: CheckContext) -> None:
    simulated = context.robot_value("simulation", "sensors")
    for name, value in simulated.entries.items() if simulated else ():
        _check_known(context, name, value.key_place or value.place)


def _check_known(context: CheckContext, sensor: str, place: Place) -> None:
    sensors = context.robot.sensors if context.robot else None
    if sensors is None or sensor in sensors:
        return
    near = closest_match(sensor, sensors)
    fix = f"did you mean {near}?" if near else f"it has {join_words(sensors, 'and') or 'none'}"
    context.error("E-SENSOR-UNKNOWN", place, f"the robot has no sensor '{sensor}'", fix)


GUARDS = ("obstacle_stop", "scan_stop")


def drop_unusable_blocks(context: CheckContext) -> None:
    """Take every block that needs what the robot lacks out of the pipeline under examination."""
    pipeline = context.pipeline
    if (
        context.robot is None
        or pipeline is None
        or not pipeline.blocks
        or context.pipeline_tree is None
    ):
        return
    has = {
        SENSOR_MESSAGES[sensor.type].__name__
        for sensor in (context.robot.sensors or {}).values()
        if sensor is not None and sensor.type in SENSOR_MESSAGES
    }
    left_out = [
        name
        for name, entry in pipeline.blocks.items()
        if entry is not None and entry.needs is not None and entry.needs not in has
    ]
    if not left_out:
        return
    _warn(context, left_out)
    for name in left_out:
        _remove(context, name)


def _warn(context: CheckContext, left_out: list[str]) -> None:
    """Say so when of the guards that the pipeline has none is left."""
    assert context.pipeline is not None
    guards = [
        name
        for name, entry in context.pipeline.blocks.items()
        if entry is not None and entry.block in GUARDS
    ]
    place = context.robot_value("sensors") or context.robot_value("kind")
    if guards and set(guards) <= set(left_out) and place is not None:
        cause = f"no sensor of this robot sees obstacles: {join_words(left_out, 'and')} left out"
        fix = "mind where it drives, or give it a sensor under `sensors:`"
        context.warn("W-UNGUARDED", place.place, cause, fix)


def _remove(context: CheckContext, name: str) -> None:
    pipeline, tree = context.pipeline, context.pipeline_tree
    assert pipeline is not None
    assert tree is not None
    gone = pipeline.blocks.pop(name)
    tree.entries["blocks"].entries.pop(name)
    context.parameters.pop(name, None)
    kind = context.block_classes.pop(name, None)
    if kind is None:
        return
    instead: dict[str, str] = {}
    for port, out in outputs(kind).items():
        for given, wanted in inputs(kind).items():
            if isinstance(wanted, In) and wanted.kind is out.kind and given in gone.wires:
                instead[f"{name}.{port}"] = gone.wires[given]
    for each, entry in pipeline.blocks.items():
        if entry is not None and entry.wires:
            _join(entry.wires, tree.at("blocks", each, "in"), instead)
    if pipeline.robot is not None and pipeline.robot.wires:
        _join(pipeline.robot.wires, tree.at("robot", "in"), instead)


def _join(wires: dict[str, str], written: Value | None, instead: dict[str, str]) -> None:
    """Lead every wire that came from what is gone to where that had its own from."""
    for port, source in wires.items():
        if source in instead:
            wires[port] = instead[source]
            if written is not None and port in written.entries:
                written.entries[port].data = instead[source]
