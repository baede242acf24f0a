"""Blocks that need a sensor which this robot does not have: they are left out, their wires joined.

A guard with `needs: Volts` on a robot without any distance sensor is taken out of the pipeline:
whoever listened to its `twist` then listens to what the guard itself was given. So one pipeline
serves robots with different sensors. That nothing guards the robot any more is said.
"""

from __future__ import annotations

from diffbotctl.block import In, inputs, outputs
from diffbotctl.config.check_context import CheckContext
from diffbotctl.config.node_ports import SENSOR_MESSAGES
from diffbotctl.config.yaml_tree import Value
from diffbotctl.errors import join_words

GUARDS = ("obstacle_stop", "scan_stop")


def drop_unusable_blocks(case: CheckContext) -> None:
    """Take every block that needs what the robot lacks out of the pipeline under examination."""
    pipeline = case.pipeline
    if case.robot is None or pipeline is None or not pipeline.blocks or case.tree is None:
        return
    has = {
        SENSOR_MESSAGES[sensor.type].__name__
        for sensor in (case.robot.sensors or {}).values()
        if sensor is not None and sensor.type in SENSOR_MESSAGES
    }
    left_out = [
        name
        for name, entry in pipeline.blocks.items()
        if entry is not None and entry.needs is not None and entry.needs not in has
    ]
    if not left_out:
        return
    _warn(case, left_out)
    for name in left_out:
        _remove(case, name)


def _warn(case: CheckContext, left_out: list[str]) -> None:
    """Say so when of the guards that the pipeline has none is left."""
    assert case.pipeline is not None
    guards = [
        name
        for name, entry in case.pipeline.blocks.items()
        if entry is not None and entry.block in GUARDS
    ]
    place = case.robot_at("sensors") or case.robot_at("kind")
    if guards and set(guards) <= set(left_out) and place is not None:
        cause = f"no sensor of this robot sees obstacles: {join_words(left_out, 'and')} left out"
        fix = "mind where it drives, or give it a sensor under `sensors:`"
        case.warn("W-UNGUARDED", place.spot, cause, fix)


def _remove(case: CheckContext, name: str) -> None:
    pipeline, tree = case.pipeline, case.tree
    assert pipeline is not None
    assert tree is not None
    gone = pipeline.blocks.pop(name)
    tree.entries["blocks"].entries.pop(name)
    case.values.pop(name, None)
    kind = case.kinds.pop(name, None)
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
