"""From a checked configuration to a graph with its drivers' wires: what the builder adds.

Added to every pipeline with a robot: the last gate behind the wheels' wire; behind it, for a board
that takes only PWM, `wheel_speed`; the echo of what holds the robot, to blocks that ask for it.
"""

from __future__ import annotations

from typing import Any, NamedTuple, TypeVar

from diffbotctl.block import Block, In, inputs, outputs, robot_fields
from diffbotctl.config import node_ports as ends
from diffbotctl.config import registry
from diffbotctl.config.configuration import BlockUse, Configuration
from diffbotctl.config.robot import Robot
from diffbotctl.drivers.robot_link import is_duty_board
from diffbotctl.engine.safety_gate import Gate
from diffbotctl.graph import Graph, Node
from diffbotctl.log import Logbook
from diffbotctl.messages import Range, Resume, Stop
from diffbotctl.recording.foxglove import SensorMount

UNPROVEN_SPEED = 0.1  # m/s; slow enough to catch a robot whose motor turns the wrong way
Made = TypeVar("Made", bound=Block)
GATE, WHEEL_SPEED = "gate", "wheel_speed"


class Assembly(NamedTuple):
    """A graph, and where it meets its drivers. `command` is the wire that leaves for the robot."""

    graph: Graph
    command: str | None
    unproven: bool


def assemble(configuration: Configuration, real: bool) -> Assembly:
    """Build the graph. `real`: a real robot moves, so that unproven wiring slows it down."""
    robot = configuration.robot
    unproven = real and robot is not None and robot.drive.polarity == "unproven"
    nodes = [_node(use, robot, unproven) for use in configuration.blocks]
    command = None
    if robot is not None and "wheels" in configuration.robot_wires:
        nodes.append(gate_node(robot, configuration.robot_wires["wheels"]))
        command = f"{GATE}.wheels"
        if is_duty_board(robot):
            nodes.append(wheel_speed_node(robot))
            command = f"{WHEEL_SPEED}.duty"
    return Assembly(Graph(nodes, sources(robot), Logbook()), command, unproven)


def sources(robot: Robot | None) -> dict[str, type]:
    """Every wire that a driver delivers on, with its message class."""
    found = {f"operator.{port}": kind for port, kind in ends.OPERATOR.items()}
    if robot is not None:
        found.update({f"robot.{port}": kind for port, kind in ends.robot(robot).outputs.items()})
    return found


def _node(use: BlockUse, robot: Robot | None, unproven: bool) -> Node:
    values = dict(use.values)
    if unproven:
        for attribute, field in robot_fields(use.cls).items():
            if field == "limits.speed":
                values[attribute] = min(values[attribute], UNPROVEN_SPEED)
    wires = dict(use.wires)
    for port, wanted in inputs(use.cls).items():
        if isinstance(wanted, In) and wanted.optional and port not in wires:
            echo = ECHOES.get(wanted.kind)
            if echo is not None:
                wires[port] = echo
    return Node(use.name, use.cls(**values), wires)


# Optional inputs of these kinds hear the operator unless the pipeline says otherwise.
ECHOES: dict[type, str] = {Stop: "operator.stop", Resume: "operator.resume"}


def gate_node(robot: Robot, command: str) -> Node:
    """The last gate behind the wire `command`."""
    period = 1.0 / robot.board.telemetry
    block = build_block(Gate, robot, telemetry_timeout=min(0.5, max(0.25, FRAMES_MISSED * period)))
    wires = {
        "command": command,
        "encoders": "robot.encoders",
        "link": "robot.link",
        "board": "robot.stop",
        "operator": "operator.halt",
        "resume": "operator.resume",
    }
    return Node(GATE, block, wires)


FRAMES_MISSED = 4  # telemetry frames that noise may swallow before the robot is stopped


def wheel_speed_node(robot: Robot) -> Node:
    """The speed loops on the host, behind the gate."""
    kind = registry.block(WHEEL_SPEED)
    wires = {"wheels": f"{GATE}.wheels", "encoders": "robot.encoders"}
    return Node(WHEEL_SPEED, build_block(kind, robot), wires)


def build_block(kind: type[Made], robot: Robot, **values: Any) -> Made:
    """A block with the robot's fields that it asks for; `values` go before them."""
    fields = {name: _field(robot, path) for name, path in robot_fields(kind).items()}
    return kind(**{**fields, **values})


def _field(robot: Robot, path: str) -> Any:
    value: Any = robot
    for step in path.split("."):
        value = value[step] if isinstance(value, dict) else getattr(value, step)
    return value


def wires_of(assembly: Assembly, kind: type) -> list[str]:
    """The block outputs that carry messages of class `kind`."""
    return [
        f"{node.name}.{port}"
        for node in assembly.graph.nodes
        for port, out in outputs(type(node.block)).items()
        if out.kind is kind
    ]


def mounts(configuration: Configuration) -> dict[str, SensorMount]:
    """Where the sensor behind each range sits, by the wire of the range."""
    robot = configuration.robot
    found: dict[str, SensorMount] = {}
    for use in configuration.blocks:
        name = use.values.get("sensor")
        if robot is None or name not in robot.sensors:
            continue
        at = robot.sensors[name].at
        for port, out in outputs(use.cls).items():
            if out.kind is Range:
                found[f"{use.name}.{port}"] = SensorMount(name, at.x, at.y, at.heading)
    return found
