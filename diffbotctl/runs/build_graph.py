"""Builds the graph of a checked configuration, and connects it to its drivers.

Added to every pipeline with a robot: the safety gate behind the wire of the wheels; for a board
that takes only a duty, `wheel_speed` behind the gate; and for blocks with an optional input of Stop
or Resume, the wires `operator.stop` and `operator.resume`.
"""

from __future__ import annotations

import sys
from contextlib import redirect_stdout
from typing import Any, NamedTuple, TypeVar

from diffbotctl.block import Block, In, inputs, outputs, robot_fields
from diffbotctl.config import node_ports, registry
from diffbotctl.config.configuration import BlockUse, Configuration
from diffbotctl.config.robot import Robot, field_value
from diffbotctl.drivers.robot_ports import is_duty_board
from diffbotctl.engine.loop import block_problem
from diffbotctl.engine.output_check import OWN_PACKAGE
from diffbotctl.engine.safety_gate import Gate
from diffbotctl.errors import RunError
from diffbotctl.graph import Graph, Node, join_graphs
from diffbotctl.log import Logbook
from diffbotctl.messages import Encoders, Resume, Stop
from diffbotctl.runs.signals import signals_as_interrupts
from diffbotctl.time import SECOND

GATE, WHEEL_SPEED = "gate", "wheel_speed"
UNPROVEN_SPEED_MAX = 0.1  # m/s; slow enough to catch a robot whose motor turns the wrong way
MISSED_FRAMES_MAX = 4  # telemetry frames that noise may swallow before the robot is stopped
DEFAULT_WIRES: dict[type, str] = {
    Stop: "operator.stop",
    Resume: "operator.resume",
    Encoders: "robot.encoders",
}
"""Source of an optional input of this message class that the pipeline leaves open."""

AnyBlock = TypeVar("AnyBlock", bound=Block)


class Assembly(NamedTuple):
    """A graph, and the wire of its commands to the robot; `unproven`: its speed is limited.

    `parts` are those of several robots, joined in `graph`; none for a pipeline of one robot.
    """

    graph: Graph
    command: str | None
    unproven: bool
    parts: tuple[RobotAssembly, ...] = ()

    def of_robots(self, configuration: Configuration) -> tuple[RobotAssembly, ...]:
        """The parts, or the whole as the only one, without a name."""
        return self.parts or (RobotAssembly("", configuration, self),)


class RobotAssembly(NamedTuple):
    """The part of one robot of several: its name, its pipeline, and its graph without the name."""

    name: str
    configuration: Configuration
    assembly: Assembly

    @property
    def prefix(self) -> str:
        """How the names of its nodes and wires begin in the graph of all."""
        return f"{self.name}." if self.name else ""


def assemble(configuration: Configuration, real: bool) -> Assembly:
    """Build the graph. `real`: a real robot moves, so unproven wiring limits its speed."""
    if configuration.robots:
        parts = tuple(
            RobotAssembly(name, part, assemble(part, real))
            for name, part in configuration.robots.items()
        )
        graph = join_graphs({part.name: part.assembly.graph for part in parts}, Logbook())
        return Assembly(graph, None, any(part.assembly.unproven for part in parts), parts)
    robot = configuration.robot
    unproven = real and robot is not None and robot.drive.polarity == "unproven"
    nodes = [_node(use, unproven) for use in configuration.blocks]
    command = None
    if robot is not None and "wheels" in configuration.robot_wires:
        nodes.append(gate_node(robot, configuration.robot_wires["wheels"]))
        command = f"{GATE}.wheels"
        if is_duty_board(robot):
            nodes.append(wheel_speed_node(robot))
            command = f"{WHEEL_SPEED}.duty"
    wires = sources(robot) | {use.wire: use.kind for use in configuration.inputs}
    # A neutral message holds until another one comes.
    lifetimes = {
        use.wire: round(use.timeout * SECOND) for use in configuration.inputs if use.neutral is None
    }
    commands = [] if command is None else [command]
    return Assembly(Graph(nodes, wires, Logbook(), lifetimes, commands), command, unproven)


def sources(robot: Robot | None) -> dict[str, type]:
    """Every wire that a driver of this package delivers on, with its message class."""
    wires = {f"operator.{port}": kind for port, kind in node_ports.OPERATOR.items()}
    if robot is not None:
        ports = node_ports.robot(robot).outputs
        wires.update({f"robot.{port}": kind for port, kind in ports.items()})
    return wires


def _node(use: BlockUse, unproven: bool) -> Node:
    values = dict(use.values)
    if unproven:
        for attribute, field in robot_fields(use.cls).items():
            if field == "limits.speed":
                values[attribute] = min(values[attribute], UNPROVEN_SPEED_MAX)
    wires = dict(use.wires)
    for port, declaration in inputs(use.cls).items():
        if isinstance(declaration, In) and declaration.optional and port not in wires:
            source = DEFAULT_WIRES.get(declaration.kind)
            if source is not None:
                wires[port] = source
    try:
        block = _made(use.cls, values)
    except (Exception, SystemExit) as error:
        raise RunError(block_problem(use.name, use.cls, error)) from error
    block.connected = frozenset(wires)
    return Node(use.name, block, wires)


def _made(kind: type[Block], values: dict[str, Any]) -> Block:
    """The block, whose `reset` may be code of the user: it may print, or never end."""
    if kind.__module__.startswith(OWN_PACKAGE):
        return kind(**values)
    with redirect_stdout(sys.stderr), signals_as_interrupts():
        return kind(**values)


def gate_node(robot: Robot, command: str) -> Node:
    """The safety gate behind the wire `command`."""
    silence = MISSED_FRAMES_MAX / robot.board.telemetry
    block = build_block(Gate, robot, telemetry_timeout=min(0.5, max(0.25, silence)))
    wires = {
        "command": command,
        "encoders": "robot.encoders",
        "link": "robot.link",
        "board": "robot.stop",
        "operator": "operator.halt",
        "waiting": "operator.wait",
        "resume": "operator.resume",
    }
    return Node(GATE, block, wires)


def wheel_speed_node(robot: Robot) -> Node:
    """The speed loops on the host, behind the gate."""
    wires = {"wheels": f"{GATE}.wheels", "encoders": "robot.encoders"}
    return Node(WHEEL_SPEED, build_block(registry.block(WHEEL_SPEED), robot), wires)


def build_block(kind: type[AnyBlock], robot: Robot, **values: Any) -> AnyBlock:
    """A block with the fields of the robot that it declares; `values` override them."""
    fields = {name: field_value(robot, path) for name, path in robot_fields(kind).items()}
    return kind(**{**fields, **values})


def wires_of(assembly: Assembly, kind: type) -> list[str]:
    """The block outputs that carry messages of class `kind`."""
    return [
        f"{node.name}.{port}"
        for node in assembly.graph.nodes
        for port, out in outputs(type(node.block)).items()
        if out.kind is kind
    ]
