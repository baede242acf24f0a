"""Wiring: every input has a source, every source exists and speaks the input's message."""

from __future__ import annotations

from diffbotctl.block import In
from diffbotctl.config import nodes
from diffbotctl.config.case import Case
from diffbotctl.config.nodes import Node
from diffbotctl.config.value import Value
from diffbotctl.errors import listed, nearest
from diffbotctl.messages import fields


def check(case: Case) -> None:
    """Check both ends of every wire of the pipeline."""
    if case.tree is None:
        return
    known = all_nodes(case)
    for name, value in entries(case).items():
        if name in known:
            _check_inputs(case, name, value, known)
    if case.at("robot") is not None and case.at("robot", "in", "wheels") is None:
        cause = "nothing drives the robot's wheels: it will not move"
        fix = "wire them: robot: {in: {wheels: kinematics.wheels}}"
        place = case.at("robot")
        assert place is not None
        case.warn("W-WIRE-WHEELS", place.spot, cause, fix)


def all_nodes(case: Case) -> dict[str, Node]:
    """Every node whose ports are known, by name."""
    known = {name: nodes.of_block(kind) for name, kind in case.kinds.items()}
    known["operator"] = nodes.operator()
    if case.at("robot") is not None:
        known["robot"] = nodes.robot(case.robot)
    return known


def entries(case: Case) -> dict[str, Value]:
    """Everything in the pipeline file that may have an `in`."""
    blocks = case.at("blocks")
    found = dict(blocks.entries) if blocks else {}
    robot = case.at("robot")
    if robot is not None:
        found["robot"] = robot
    return found


def _check_inputs(case: Case, name: str, value: Value, known: dict[str, Node]) -> None:
    ports = known[name].inputs
    wires = value.at("in")
    given = wires.entries if wires else {}
    strange = [port for port in given if port not in ports]
    for port in strange:
        _unknown_input(case, name, port, given, ports)
    free = [port for port in ports if port not in given]
    meant = {nearest(port, free) for port in strange}
    for port, declared in ports.items():
        if port in given:
            _check_source(case, name, port, declared, given[port], known)
        elif not declared.optional and port not in meant:
            _unconnected(case, name, port, declared, wires or value, known)


def _unknown_input(
    case: Case, name: str, port: str, given: dict[str, Value], ports: dict[str, In]
) -> None:
    near = nearest(port, ports)
    fix = f"did you mean {near}?" if near else _those("input", list(ports))
    place = given[port].key or given[port].spot
    case.error("E-WIRE-INPUT", place, f"'{name}' has no input '{port}'", fix)


def _unconnected(
    case: Case, name: str, port: str, declared: In, place: Value, known: dict[str, Node]
) -> None:
    sources = suitable(declared.kind, name, known)
    kind = declared.kind.__name__
    fix = (
        f"add in: {{{port}: {sources[0]}}}"
        if len(sources) == 1
        else f"connect it to one of {listed(sources)}"
        if sources
        else f"add a block that gives a {kind}"
    )
    cause = f"input '{port}' of '{name}' is not connected; it needs a {kind}"
    case.error("E-WIRE-MISSING", place.key or place.spot, cause, fix)


def _those(what: str, names: list[str]) -> str:
    if not names:
        return f"it has no {what}s; remove this wire"
    if len(names) == 1:
        return f"its only {what} is {names[0]}"
    return f"its {what}s are {listed(names, 'and')}"


def suitable(kind: type, name: str, known: dict[str, Node]) -> list[str]:
    """Every output that an input for `kind` of the node `name` could be wired to."""
    return [
        f"{node}.{output}"
        for node, ports in known.items()
        for output, each in ports.outputs.items()
        if each is kind and node != name
    ]


def _check_source(
    case: Case, name: str, port: str, declared: In, source: Value, known: dict[str, Node]
) -> None:
    if not isinstance(source.data, str):
        return
    node, dot, output = source.data.partition(".")
    if not dot or not output:
        _incomplete(case, source, node, declared, known)
    elif node == "robot" and "robot" not in known:
        cause = "this pipeline has no robot"
        case.error("E-WIRE-NODE", source.spot, cause, "add `robot: {in: {wheels: ...}}` to it")
    elif node not in known:
        _unknown_node(case, source, node, output, known)
    elif node == "robot" and case.robot is None:
        return  # its file could not be read, so its sensors are not known
    elif output not in known[node].outputs:
        _unknown_output(case, source, node, output, declared, known)
    elif known[node].outputs[output] is not declared.kind:
        _mismatch(case, name, port, source, known[node].outputs[output], declared.kind, known)


def _incomplete(case: Case, source: Value, node: str, declared: In, known: dict[str, Node]) -> None:
    outputs = known[node].outputs if node in known else {}
    fitting = [output for output, kind in outputs.items() if kind is declared.kind]
    fix = f"write {node}.{fitting[0]}" if fitting else "write block.output"
    cause = f"'{source.data}' names no output; a wire begins at block.output"
    case.error("E-WIRE-OUTPUT", source.spot, cause, fix)


def _unknown_node(
    case: Case, source: Value, node: str, output: str, known: dict[str, Node]
) -> None:
    blocks = case.at("blocks")
    if blocks is not None and node in blocks.entries:
        return  # the block is there but its kind is unknown, which is said there
    near = nearest(node, known)
    fix = f"did you mean {near}.{output}?" if near else f"there are {listed(known, 'and')}"
    case.error("E-WIRE-NODE", source.spot, f"there is no block '{node}'", fix)


def _unknown_output(
    case: Case, source: Value, node: str, output: str, declared: In, known: dict[str, Node]
) -> None:
    outputs = known[node].outputs
    fitting = [each for each, kind in outputs.items() if kind is declared.kind]
    near = nearest(output, outputs) or (fitting[0] if len(fitting) == 1 else None)
    fix = f"did you mean {node}.{near}?" if near else _those("output", list(outputs))
    case.error("E-WIRE-OUTPUT", source.spot, f"'{node}' has no output '{output}'", fix)


def _mismatch(
    case: Case, name: str, port: str, source: Value, given: type, wanted: type,
    known: dict[str, Node],
) -> None:  # fmt: skip
    cause = (
        f"{source.data} carries {described(given)}, "
        f"but input '{port}' of '{name}' takes {described(wanted)}"
    )
    sources = suitable(wanted, name, known)
    fix = f"wire it from {listed(sources)}" if sources else "put a block that converts it between"
    case.error("E-WIRE-TYPE", source.spot, cause, fix)


def described(kind: type) -> str:
    """A message class with the units that it carries: `Twist (m/s, rad/s)`."""
    units = dict.fromkeys(
        field.unit for name, (_, field) in fields(kind).items() if field.unit and name != "time"
    )
    return f"{kind.__name__} ({', '.join(units)})" if units else kind.__name__
