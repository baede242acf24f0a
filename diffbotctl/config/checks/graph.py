"""Checks of the pipeline's graph: names of blocks and sensors, wires, loops.

Every input has a source; every source exists and has the input's message type. A block reacts once
in an instant, so it cannot depend on its own output.
"""

from __future__ import annotations

import re
from collections.abc import Iterable
from dataclasses import dataclass
from graphlib import CycleError, TopologicalSorter
from typing import get_args

from diffbotctl.block import In, inputs
from diffbotctl.config import node_ports
from diffbotctl.config.checks.context import CheckContext, check
from diffbotctl.config.configuration import SensorMessage
from diffbotctl.config.node_ports import RESERVED, ROBOT, NodePorts
from diffbotctl.config.yaml_tree import Value
from diffbotctl.errors import closest_match, join_words
from diffbotctl.message_types import full_name, type_name, type_problem
from diffbotctl.messages import BUILT_IN, fields


@check()
def check_names(context: CheckContext) -> None:
    """Refuse invalid names and reserved names."""
    blocks, sensors = context.pipeline_value("blocks"), context.robot_value("sensors")
    for name, value in blocks.entries.items() if blocks else ():
        _check_name(context, name, value, "block")
        if name in RESERVED:
            cause = f"'{name}' is reserved: every pipeline has a node of that name"
            place = value.name_place
            context.error("E-NAME", place, cause, "rename the block")
    for name, value in sensors.entries.items() if sensors else ():
        _check_name(context, name, value, "sensor")
        if name in ROBOT:
            cause = f"'{name}' is already an output of the robot"
            place = value.name_place
            context.error("E-NAME", place, cause, "rename the sensor")


def _check_name(context: CheckContext, name: str, value: Value, kind: str) -> None:
    if node_ports.is_name(name):
        return
    plain = re.sub(r"[^a-z0-9]+", "_", name.lower()).strip("_")
    if not plain[:1].isalpha():
        plain = f"{kind}_{plain}".rstrip("_")
    cause = f"'{name}' is not a valid {kind} name: use lower-case letters, digits and _"
    context.error("E-NAME", value.name_place, cause, f"rename it to {plain}")


@check()
def check_message_types(context: CheckContext) -> None:
    """Refuse message classes of other packages that cannot be recorded, and two of one name."""
    first: dict[str, type] = {}
    for name, block in context.block_classes.items():
        ports = node_ports.of_block(block)
        kinds = {port: declared.kind for port, declared in ports.inputs.items()} | ports.outputs
        for port, kind in kinds.items():
            if kind in BUILT_IN.values():
                continue
            problem = type_problem(kind)
            if problem is None and first.setdefault(type_name(kind), kind) is not kind:
                problem = f"{first[type_name(kind)].__module__} has one too", "rename one of them"
            value = context.pipeline_value("blocks", name)
            if problem is not None and value is not None:
                cause = f"{type_name(kind)}, at '{port}' of '{name}', is no message: {problem[0]}"
                context.error("E-MESSAGE-TYPE", value.name_place, cause, problem[1])


@check()
def check_wires(context: CheckContext) -> None:
    """Check both ends of every wire of the pipeline."""
    if context.pipeline_tree is None:
        return
    nodes = {name: node_ports.of_block(block) for name, block in context.block_classes.items()} | {
        "operator": node_ports.operator()
    }
    robot = context.pipeline_value("robot")
    if robot is not None:
        nodes["robot"] = node_ports.robot(context.robot)
    for wire, use in context.inputs.items():
        node, _, port = wire.partition(".")
        nodes.setdefault(node, NodePorts({}, {})).outputs[port] = use.kind
    nodes |= {name: part.ports() for name, part in context.parts.items()}
    wiring = _Wiring(context, nodes)
    for name, part in context.parts.items():
        wiring.check_inputs(name, part.value)
        if (same := context.pipeline_value("blocks", name)) is not None:
            cause, fix = f"an include is called '{name}'", "rename the block"
            context.error("E-NAME", same.name_place, cause, fix)
    wiring.check_programs()
    wiring.check_sources()
    for name, value in nodes_with_inputs(context).items():
        if name in nodes:
            wiring.check_inputs(name, value)
    if robot is not None and robot.at("in", "wheels") is None:
        cause = "no wire leads to the robot's wheels: it will not move"
        fix = "add robot: {in: {wheels: kinematics.wheels}}"
        context.warn("W-WIRE-WHEELS", robot.place, cause, fix)


@check()
def check_loops(context: CheckContext) -> None:
    """Refuse each loop once, naming its blocks in the order of the wires."""
    blocks = context.pipeline_value("blocks")
    sources = {name: _sources(value) for name, value in blocks.entries.items()} if blocks else {}
    for loop in loops({name: list(wires) for name, wires in sources.items()}):
        around = " -> ".join([*loop, loop[0]])
        place = sources[loop[-1]][loop[-2 % len(loop)]].place
        cause = f"these blocks form a loop: {around}"
        fix = (
            "remove one wire; feedback from the robot comes from robot.encoders, "
            "not from the end of the graph"
        )
        context.error("E-WIRE-LOOP", place, cause, fix)


def loops(sources: dict[str, list[str]]) -> list[list[str]]:
    """Loops of a graph given as node -> nodes it takes from; each in the order of its wires.

    No two have a node in common: of two loops through one node the first is found.
    """
    order = list(sources)
    remaining = dict(sources)
    cycles: list[list[str]] = []
    while True:
        graph = {
            node: [source for source in wires if source in remaining]
            for node, wires in remaining.items()
        }
        try:
            TopologicalSorter(graph).prepare()
        except CycleError as error:
            cycle = error.args[1][1:]
            last = cycle.index(min(cycle, key=order.index))
            cycles.append(cycle[last + 1 :] + cycle[: last + 1])
            for node in cycle:
                del remaining[node]
        else:
            return cycles


def _sources(value: Value) -> dict[str, Value]:
    """The blocks that a block takes from, with the wire's value."""
    wires = value.at("in")
    sources: dict[str, Value] = {}
    for source in wires.entries.values() if wires else ():
        node = source.data.partition(".")[0] if isinstance(source.data, str) else RESERVED[0]
        if node not in RESERVED:
            sources.setdefault(node, source)
    return sources


def nodes_with_inputs(context: CheckContext) -> dict[str, Value]:
    """Everything in the pipeline file that may have an `in`."""
    blocks, robot = context.pipeline_value("blocks"), context.pipeline_value("robot")
    return {**(blocks.entries if blocks else {}), **({"robot": robot} if robot else {})}


@dataclass(eq=False, repr=False)
class _Wiring:
    """Checks wires. `nodes` are the ports of every node whose ports could be found, by name."""

    context: CheckContext
    nodes: dict[str, NodePorts]

    def check_inputs(self, name: str, value: Value) -> None:
        """Check every wire into the node `name`, and that every required input is connected."""
        ports, wires = self.nodes[name].inputs, value.at("in")
        if wires is not None and not isinstance(wires.data, dict):
            return  # which is reported by itself
        sources = wires.entries if wires else {}
        unknown = [port for port in sources if port not in ports]
        for port in unknown:
            place = sources[port].name_place
            cause = f"'{name}' has no input '{port}'"
            self.context.error("E-WIRE-INPUT", place, cause, _did_you_mean(port, ports, "input"))
        free = [port for port in ports if port not in sources]
        misspelt = {closest_match(port, free) for port in unknown}
        for port, declared in ports.items():
            if port in sources:
                self._check_source(name, port, declared.kind, sources[port])
            elif not declared.optional and port not in misspelt:
                self._report_unconnected(name, port, declared, wires or value)

    def check_programs(self) -> None:
        """Check the source of everything that programs read; any message type will do."""
        for name, use in self.context.programs.items():
            for port, wire in use.wires.items():
                source = self.context.pipeline_value("programs", name, "in", port)
                node, _, output = wire.partition(".")
                outputs = self.nodes[node].outputs if node in self.nodes else {}
                if source is not None:
                    self._check_source(name, port, outputs.get(output, object), source)

    def check_sources(self) -> None:
        """Check the source of everything that is sent to devices."""
        for name, use in self.context.sources.items():
            ports = inputs(use.cls)
            declared = {port: each for port, each in ports.items() if isinstance(each, In)}
            value = self.context.pipeline_value("sources", name)
            if not use.cls.open_kinds:
                if value is not None:
                    self.nodes[name] = NodePorts(self.nodes[name].outputs, declared)
                    self.check_inputs(name, value)
                continue
            for port, wire in use.wires.items():
                node, _, output = wire.partition(".")
                kind = self.nodes[node].outputs.get(output) if node in self.nodes else None
                source = self.context.pipeline_value("sources", name, "in", port)
                if source is None:
                    continue
                self._check_source(name, port, kind or object, source)
                if kind is not None and kind not in use.cls.open_kinds:
                    cause = f"{wire} carries {type_name(kind)}, which '{name}' cannot be sent"
                    names = join_words(map(type_name, use.cls.open_kinds))
                    self.context.error("E-WIRE-TYPE", source.place, cause, f"send {names}")

    def _report_unconnected(self, name: str, port: str, declared: In, value: Value) -> None:
        kind = type_name(declared.kind)
        outputs = self._outputs_of(declared.kind, name)
        if not outputs:
            fix = f"add a block that outputs a {kind}"
        elif len(outputs) == 1:
            fix = f"add in: {{{port}: {outputs[0]}}}"
        else:
            fix = f"connect it to one of {join_words(outputs)}"
        cause = f"input '{port}' of '{name}' is not connected; it takes a {kind}"
        self.context.error("E-WIRE-MISSING", value.name_place, cause, fix)

    def _check_source(self, name: str, port: str, kind: type, source: Value) -> None:
        if not isinstance(source.data, str):
            return
        node, _, output = source.data.partition(".")
        outputs = self.nodes[node].outputs if node in self.nodes else {}
        fitting = [name for name, carried in outputs.items() if carried is kind]
        if not output:
            fix = f"write {node}.{fitting[0]}" if fitting else "write block.output"
            cause = f"'{source.data}' is not an output; a wire starts at block.output"
            self.context.error("E-WIRE-OUTPUT", source.place, cause, fix)
        elif node not in self.nodes:
            self._report_unknown_node(name, source, kind)
        elif node == "robot" and self.context.robot is None:
            return  # its file could not be read, so its sensors are not known
        elif output not in outputs:
            cause = f"'{node}' has no output '{output}'"
            near = closest_match(output, outputs) or (fitting[0] if len(fitting) == 1 else None)
            others = self._outputs_of(kind, name) if node == "robot" and not near else []
            fix = f"did you mean {node}.{near}?" if near else _only_these("output", outputs)
            fix = f"wire '{name}' from {join_words(others)}" if others else fix
            self.context.error("E-WIRE-OUTPUT", source.place, cause, fix)
        elif outputs[output] is not kind:
            self._report_mismatch(name, port, source, outputs[output], kind)

    def _report_unknown_node(self, name: str, source: Value, kind: type) -> None:
        node, _, output = str(source.data).partition(".")
        if any(self.context.pipeline_value(part, node) for part in ("blocks", "sources")):
            return  # the kind of the block or source is unknown, which is reported there
        left_out = [each for each in self.context.omissions if each.name == node]
        if left_out:
            cause = left_out[0].text()
            outputs = self._outputs_of(kind, name)
            fix = f"wire '{name}' from {join_words(outputs)}" if outputs else "remove this wire"
        elif node == "robot":
            cause, fix = "this pipeline has no robot", "add `robot: {in: {wheels: ...}}` to it"
        else:
            near = closest_match(node, self.nodes)
            cause = f"there is no block '{node}'"
            names = join_words(self.nodes, "and")
            fix = f"did you mean {near}.{output}?" if near else f"there are {names}"
        self.context.error("E-WIRE-NODE", source.place, cause, fix)

    def _report_mismatch(
        self, name: str, port: str, source: Value, carried: type, expected: type
    ) -> None:
        cause = (
            f"{source.data} carries {_with_units(carried, expected)}, "
            f"but input '{port}' of '{name}' takes {_with_units(expected, carried)}"
        )
        outputs = self._outputs_of(expected, name)
        fix = self._fix_by_bypass(name, source, carried, expected)
        if not fix and outputs:
            fix = f"wire it from {join_words(outputs)}"
        fix = fix or "insert a block that converts it"
        self.context.error("E-WIRE-TYPE", source.place, cause, fix)

    def _fix_by_bypass(self, name: str, source: Value, carried: type, expected: type) -> str:
        """How to do without the block `name` where its input carries already what it makes of it;
        empty where it does not."""
        made = [output for output, kind in self.nodes[name].outputs.items() if kind is carried]
        if not made or carried is expected:
            return ""
        kind = type_name(expected)
        kept = f", or give '{name}' `needs: {kind}`" if kind in get_args(SensorMessage) else ""
        return f"remove '{name}', and write {source.data} in place of {name}.{made[0]}{kept}"

    def _outputs_of(self, kind: type, name: str) -> list[str]:
        """Every output that an input for `kind` of the node `name` could be wired to."""
        return [
            f"{node}.{output}"
            for node, ports in self.nodes.items()
            for output, carried in ports.outputs.items()
            if carried is kind and node != name
        ]


def _did_you_mean(name: str, names: Iterable[str], kind: str) -> str:
    near = closest_match(name, names)
    return f"did you mean {near}?" if near else _only_these(kind, names)


def _only_these(kind: str, names: Iterable[str]) -> str:
    texts = list(names)
    if not texts:
        return f"it has no {kind}s; remove this wire"
    if len(texts) == 1:
        return f"its only {kind} is {texts[0]}"
    return f"its {kind}s are {join_words(texts, 'and')}"


def _with_units(kind: type, other: type) -> str:
    """A message class with the units that it carries: `Twist (m/s, rad/s)`.

    With its package if the class `other`, which it is compared with, has the same name.
    """
    text = full_name(kind) if kind.__name__ == other.__name__ else type_name(kind)
    if type_problem(kind) is not None:
        return text
    units = dict.fromkeys(
        field.unit for name, (_, field) in fields(kind).items() if field.unit and name != "time"
    )
    return f"{text} ({', '.join(units)})" if units else text
