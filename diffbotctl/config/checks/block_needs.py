"""Checks the robot fields and sensors that blocks need; drops blocks that the robot cannot serve.

A guard with `needs: Volts` is dropped from the pipeline of a robot without a distance sensor; the
inputs connected to its `twist` are connected to the guard's own input instead. So one pipeline
works for robots with different sensors. A warning reports when no guard remains.
"""

from __future__ import annotations

from collections.abc import Container
from typing import get_args

from diffbotctl.block import Block, In, inputs, outputs, robot_fields
from diffbotctl.config import node_ports
from diffbotctl.config.checks.context import CheckContext, check
from diffbotctl.config.checks.graph import nodes_with_inputs
from diffbotctl.config.configuration import BlockEntry, Omission, Pipeline, SensorMessage
from diffbotctl.config.node_ports import SENSOR_MESSAGES
from diffbotctl.config.robot import field_value
from diffbotctl.errors import Place, closest_match, join_words

FIELDS_SHOWN_MAX = 2  # fields listed in a message
GUARDS = ("obstacle_stop", "scan_stop")
DISTANCES = {"Volts", "Range"}


@check()
def check_fields(context: CheckContext) -> None:
    """Check the robot fields that each block reads, and the sensors named in parameters."""
    for name, block in context.block_classes.items():
        paths = list(robot_fields(block).values())
        value = context.pipeline_value("blocks", name)
        if not paths or value is None:
            continue
        if context.robot is not None:
            _check_paths(context, name, paths, value.place)
            sensor = context.parameters.get(name, {}).get("sensor")
            place = context.parameter_value(name, "sensor") or value
            if isinstance(sensor, str):
                _check_sensor(context, sensor, place.place)
        elif context.pipeline_value("robot") is None:
            more = len(paths) - FIELDS_SHOWN_MAX
            shown = [*paths[:FIELDS_SHOWN_MAX], *([f"{more} more"] if more > 0 else [])]
            fields = join_words(shown, "and")
            cause = f"'{name}' needs the robot's {fields}, but the pipeline has no robot"
            fix = "add `robot: {in: {wheels: ...}}` to the pipeline"
            context.error("E-ROBOT-MISSING", value.place, cause, fix)
    simulated = context.robot_value("simulation", "sensors")
    for name, value in simulated.entries.items() if simulated else ():
        _check_sensor(context, name, value.name_place)


def _is_unread(context: CheckContext, path: str) -> bool:
    """True when a section on the way to `path` could not be read from the robot file."""
    value = context.robot
    for step in path.split("."):
        if value is None:
            return True
        value = value.get(step) if isinstance(value, dict) else getattr(value, step, value)
    return False


def _check_paths(context: CheckContext, name: str, paths: list[str], place: Place) -> None:
    for path in paths:
        try:
            field_value(context.robot, path)
        except (AttributeError, KeyError):
            if _is_unread(context, path):
                continue  # that is reported where it is written
            cause = f"'{name}' reads {path}, which is not a field of robot files"
            fix = "correct FromRobot in the code of the block"
            context.error("E-ROBOT-FIELD", place, cause, fix)


def _check_sensor(context: CheckContext, sensor: str, place: Place) -> None:
    sensors = context.robot.sensors if context.robot else None
    if sensors is None or sensor in sensors:
        return
    near = closest_match(sensor, sensors)
    fix = (
        f"did you mean {near}?" if near else f"its sensors: {join_words(sensors, 'and') or 'none'}"
    )
    given = {use.kind for use in context.inputs.values()}
    types = [kind for kind, message in SENSOR_MESSAGES.items() if message in given]
    if types:
        fix += (
            "; for one that a source reads, add type and place to the robot file: "
            f"`sensors: {{{sensor}: {{type: {types[0]}, at: {{x: ...}}}}}}`"
        )
    context.error("E-SENSOR-UNKNOWN", place, f"the robot has no sensor '{sensor}'", fix)


def omit_unusable_blocks(context: CheckContext) -> None:
    """Leave out every block whose `needs` is met neither by a sensor of the robot nor by a source.

    One whose wires all come from something that exists stays: what is wrong with such a wire is
    reported where it is written.
    """
    pipeline = context.pipeline
    if context.robot is None or pipeline is None:
        return
    _bypass_converters(context, pipeline)
    entries = {name: entry for name, entry in (pipeline.blocks or {}).items() if entry is not None}
    unmet = [name for name, entry in entries.items() if _is_unmet(context, name, entry)]
    omitted: list[str] = []
    outputs = node_ports.robot(context.robot).outputs
    while more := [
        name
        for name in unmet
        if name not in omitted
        and not _is_fed(context.block_classes[name], entries[name], outputs, omitted)
    ]:
        omitted += more
    guards = {name for name, entry in entries.items() if entry.block in GUARDS}
    place = context.robot_value("sensors") or context.robot_value("kind")
    if guards and guards <= set(omitted) and place is not None:
        left_out = join_words([name for name in entries if name in omitted], "and")
        cause = f"no sensor of this robot detects obstacles; left out: {left_out}"
        fix = "supervise the robot, or add a sensor under `sensors:`"
        context.warn("W-UNGUARDED", place.place, cause, fix)
    for name in entries:
        if name in omitted:
            context.omissions.append(Omission(name, str(entries[name].needs)))
            _drop_block(context, pipeline, name)


def _is_unmet(context: CheckContext, name: str, entry: BlockEntry) -> bool:
    """Whether no sensor of the robot and no source gives what a block needs."""
    block = context.block_classes.get(name)
    if entry.needs is None or block is None or context.robot is None:
        return False
    sensors = [sensor for sensor in (context.robot.sensors or {}).values() if sensor is not None]
    measured = {
        SENSOR_MESSAGES[sensor.type].__name__ for sensor in sensors if sensor.type is not None
    }
    if DISTANCES & measured:  # a voltage becomes a distance in the block range_sensor
        measured |= DISTANCES
    taken = {entry.needs} | {
        port.kind.__name__ for port in node_ports.of_block(block).inputs.values()
    }
    given = {use.kind.__name__ for use in context.inputs.values()}
    return entry.needs not in measured and not taken & given & set(get_args(SensorMessage))


def _is_fed(
    block: type[Block], entry: BlockEntry, outputs: Container[str], omitted: Container[str]
) -> bool:
    """Whether every wire of a block comes from an output of the robot or a node that stays.

    What it only passes on, such as a Twist, does not count.
    """
    ports = node_ports.of_block(block)
    for port, wire in (entry.wires or {}).items():
        taken = ports.inputs.get(port)
        if taken is None or taken.kind in ports.outputs.values():
            continue
        node, _, output = str(wire).partition(".")
        if node in omitted or (node == "robot" and output not in outputs):
            return False
    return True


def _bypass_converters(context: CheckContext, pipeline: Pipeline) -> None:
    """Drop each block with a need that converts the voltage of a sensor that measures a distance.

    What follows it is connected to the sensor: an HC-SR04 needs no `range_sensor`.
    """
    sensors = {
        f"robot.{name}": SENSOR_MESSAGES.get(getattr(sensor, "type", ""))
        for name, sensor in ((context.robot.sensors if context.robot else None) or {}).items()
    }
    for name, block in list(context.block_classes.items()):
        entry = (pipeline.blocks or {}).get(name)
        if entry is None or entry.needs is None:
            continue
        for port, declared in inputs(block).items():
            source = (entry.wires or {}).get(port, "")
            kind = sensors.get(source)
            if kind is None or not isinstance(declared, In) or declared.kind is kind:
                continue
            same = [output for output, out in outputs(block).items() if out.kind is kind]
            if same:
                _remove_block(context, pipeline, name)
                context.block_classes.pop(name)
                _rewire(context, pipeline, {f"{name}.{output}": source for output in same})
                break


def _remove_block(context: CheckContext, pipeline: Pipeline, name: str) -> BlockEntry:
    """Take one block out of the pipeline; its wires stay."""
    assert context.pipeline_tree is not None
    removed = pipeline.blocks.pop(name)
    context.pipeline_tree.entries["blocks"].entries.pop(name)
    context.parameters.pop(name, None)
    return removed


def _drop_block(context: CheckContext, pipeline: Pipeline, name: str) -> None:
    """Drop one block; connect inputs on its outputs to its own input of the same message."""
    dropped = _remove_block(context, pipeline, name)
    block = context.block_classes.pop(name, None)
    if block is None:
        return
    replacement: dict[str, str] = {}
    for output, out in outputs(block).items():
        for port, declared in inputs(block).items():
            if isinstance(declared, In) and declared.kind is out.kind and port in dropped.wires:
                replacement[f"{name}.{output}"] = dropped.wires[port]
    _rewire(context, pipeline, replacement)


def _rewire(context: CheckContext, pipeline: Pipeline, replacement: dict[str, str]) -> None:
    """Connect every input on one of these outputs to the replacement."""
    for node, value in nodes_with_inputs(context).items():
        entry = pipeline.robot if node == "robot" else pipeline.blocks[node]
        wires = (entry.wires if entry else None) or {}
        for port, source in wires.items():
            if source in replacement:
                wires[port] = replacement[source]
                value.entries["in"].entries[port].data = replacement[source]
