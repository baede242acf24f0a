"""Ports of the nodes of a pipeline: blocks, and the drivers `operator` and `robot`."""

from __future__ import annotations

import re
from typing import NamedTuple

from diffbotctl import block, messages
from diffbotctl.config.robot import Robot
from diffbotctl.geometry.distance_sensors import CUSTOM, ECHOES, SHARPS
from diffbotctl.geometry.lidars import LIDARS

SENSOR_MESSAGES: dict[str, type] = {
    **dict.fromkeys((*SHARPS, CUSTOM), messages.Volts),
    **dict.fromkeys(ECHOES, messages.Range),
    **dict.fromkeys(LIDARS, messages.Scan),
    "overhead_camera": messages.Odometry,
}
OPERATOR: dict[str, type] = {
    "goal": messages.Goal,
    "path": messages.Path,
    "twist": messages.Twist,
    "resume": messages.Resume,
    "stop": messages.Stop,
    "halt": messages.Stop,
    "wait": messages.Stop,
    "setting": messages.Setting,
    "call": messages.Call,
    "log": messages.LogLine,
}
ROBOT: dict[str, type] = {
    "encoders": messages.Encoders,
    "link": messages.Link,
    "battery": messages.Battery,
    "text": messages.Text,
    "stop": messages.Stop,
}
NODE_NAME = "^[a-z][a-z0-9_]*$"  # of blocks and sensors
RESERVED = ("robot", "operator", "engine", "log", "gate", "wheel_speed", "input")


class NodePorts(NamedTuple):
    """The ports of one node: message class of each output, input port of each input."""

    outputs: dict[str, type]
    inputs: dict[str, block.In]


def is_name(name: str) -> bool:
    """True for a valid name of a block or a sensor."""
    return re.fullmatch(NODE_NAME.strip("^$"), name) is not None


def of_block(kind: type[block.Block]) -> NodePorts:
    """The ports of a block class; timers are no inputs for wires."""
    inputs = {name: port for name, port in block.inputs(kind).items() if isinstance(port, block.In)}
    return NodePorts({name: port.kind for name, port in block.outputs(kind).items()}, inputs)


def operator() -> NodePorts:
    """The ports of the operator: goals and commands from the command line, socket or screens."""
    return NodePorts(dict(OPERATOR), {})


def robot(which: Robot | None) -> NodePorts:
    """The ports of a robot: its telemetry, one output for each sensor, and its wheels."""
    outputs = dict(ROBOT)
    for name, sensor in (which.sensors or {}).items() if which else ():
        outputs[name] = SENSOR_MESSAGES.get(getattr(sensor, "type", ""), messages.Volts)
    return NodePorts(outputs, {"wheels": block.In(messages.Wheels, optional=True)})
