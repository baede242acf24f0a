"""No loop among blocks: in one instant each reacts once, so none can wait for itself.

Names of blocks and sensors: plain words that a wire can carry.

Wiring: every input has a source, every source exists and speaks the input's message.
"""

from __future__ import annotations

import re

from diffbotctl.block import In
from diffbotctl.config import node_ports
from diffbotctl.config.checks.context import CheckContext
from diffbotctl.config.node_ports import NODE_NAME, RESERVED, ROBOT, NodePorts
from diffbotctl.config.yaml_tree import Value
from diffbotctl.errors import closest_match, join_words
from diffbotctl.messages import fields


def check_loops(context: CheckContext) -> None:
    """Refuse each loop once, naming its blocks in the order of the wires."""
    sources = {name: _sources(value) for name, value in _blocks(context).items()}
    for loop in loops({name: list(found) for name, found in sources.items()}):
        downstream = list(reversed(loop))
        around = " -> ".join([*downstream, downstream[0]])
        place = sources[loop[0]][loop[1 % len(loop)]]
        cause = f"these blocks wait for each other: {around}"
        fix = (
            "take one wire away; what the robot did comes back as robot.encoders, "
            "without a wire from the end of the graph"
        )
        context.error("E-WIRE-LOOP", place.place, cause, fix)


def loops(sources: dict[str, list[str]]) -> list[list[str]]:
    """Loops in a graph given as node -> nodes it takes from; each as its nodes against the wires.

    Nodes that wait for nothing are taken away until only loops, and what waits for them, is left.
    """
    left = {node: [each for each in found if each in sources] for node, found in sources.items()}
    found: list[list[str]] = []
    while True:
        ready = [node for node, waits in left.items() if not any(each in left for each in waits)]
        for node in ready:
            del left[node]
        if ready:
            continue
        if not left:
            return found
        loop = _loop_from(next(iter(left)), left)
        found.append(loop)
        for node in loop:
            del left[node]


def _loop_from(node: str, left: dict[str, list[str]]) -> list[str]:
    """Walk against the wires until a node comes again; every node here has a source here."""
    path: list[str] = []
    while node not in path:
        path.append(node)
        node = next(each for each in left[node] if each in left)
    return path[path.index(node) :]


def _blocks(context: CheckContext) -> dict[str, Value]:
    blocks = context.pipeline_value("blocks")
    return dict(blocks.entries) if blocks else {}


def _sources(value: Value) -> dict[str, Value]:
    """The nodes that a block takes from, with the wire's value."""
    wires = value.at("in")
    found: dict[str, Value] = {}
    for source in wires.entries.values() if wires else ():
        if isinstance(source.data, str):
            node = source.data.partition(".")[0]
            if node not in RESERVED:
                found.setdefault(node, source)
    return found


def check_names(context: CheckContext) -> None:
    """Refuse names that are no plain words, and those that mean something else."""
    for name, value in _entries(context.pipeline_value("blocks")):
        _check_word(context, name, value, "block")
        if name in RESERVED:
            cause = f"'{name}' is the name of a node that every pipeline has"
            context.error(
                "E-NAME", value.key_place or value.place, cause, "give the block another name"
            )
    for name, value in _entries(context.robot_value("sensors")):
        _check_word(context, name, value, "sensor")
        if name in ROBOT:
            cause = f"'{name}' is already an output of the robot"
            context.error(
                "E-NAME", value.key_place or value.place, cause, "give the sensor another name"
            )


def _entries(value: Value | None) -> list[tuple[str, Value]]:
    return list(value.entries.items()) if value else []


def _check_word(context: CheckContext, name: str, value: Value, what: str) -> None:
    if re.fullmatch(NODE_NAME.strip("^$"), name):
        return
    plain = re.sub(r"[^a-z0-9]+", "_", name.lower()).strip("_")
    plain = plain if plain[:1].isalpha() else f"{what}_{plain}".rstrip("_")
    cause = f"'{name}' cannot name a {what}: small letters, digits and _ make a name"
    context.error("E-NAME", value.key_place or value.place, cause, f"call it {plain}")


def check_wires(context: CheckContext) -> None:
    """Check both ends of every wire of the pipeline."""
    if context.pipeline_tree is None:
        return
    known = all_nodes(context)
    for name, value in entries(context).items():
        if name in known:
            _check_inputs(context, name, value, known)
    if (
        context.pipeline_value("robot") is not None
        and context.pipeline_value("robot", "in", "wheels") is None
    ):
        cause = "nothing drives the robot's wheels: it will not move"
        fix = "wire them: robot: {in: {wheels: kinematics.wheels}}"
        place = context.pipeline_value("robot")
        assert place is not None
        context.warn("W-WIRE-WHEELS", place.place, cause, fix)


def all_nodes(context: CheckContext) -> dict[str, NodePorts]:
    """Every node whose ports are known, by name."""
    known = {name: node_ports.of_block(kind) for name, kind in context.block_classes.items()}
    known["operator"] = node_ports.operator()
    if context.pipeline_value("robot") is not None:
        known["robot"] = node_ports.robot(context.robot)
    return known


def entries(context: CheckContext) -> dict[str, Value]:
    """Everything in the pipeline file that may have an `in`."""
    blocks = context.pipeline_value("blocks")
    found = dict(blocks.entries) if blocks else {}
    robot = context.pipeline_value("robot")
    if robot is not None:
        found["robot"] = robot
    return found


def _check_inputs(
    context: CheckContext, name: str, value: Value, known: dict[str, NodePorts]
) -> None:
    ports = known[name].inputs
    wires = value.at("in")
    given = wires.entries if wires else {}
    strange = [port for port in given if port not in ports]
    for port in strange:
        _unknown_input(context, name, port, given, ports)
    free = [port for port in ports if port not in given]
    meant = {closest_match(port, free) for port in strange}
    for port, declared in ports.items():
        if port in given:
            _check_source(context, name, port, declared, given[port], known)
        elif not declared.optional and port not in meant:
            _unconnected(context, name, port, declared, wires or value, known)


def _unknown_input(
    context: CheckContext, name: str, port: str, given: dict[str, Value], ports: dict[str, In]
) -> None:
    near = closest_match(port, ports)
    fix = f"did you mean {near}?" if near else _those("input", list(ports))
    place = given[port].key_place or given[port].place
    context.error("E-WIRE-INPUT", place, f"'{name}' has no input '{port}'", fix)


def _unconnected(
    context: CheckContext,
    name: str,
    port: str,
    declared: In,
    place: Value,
    known: dict[str, NodePorts],
) -> None:
    sources = suitable(declared.kind, name, known)
    kind = declared.kind.__name__
    fix = (
        f"add in: {{{port}: {sources[0]}}}"
        if len(sources) == 1
        else f"connect it to one of {join_words(sources)}"
        if sources
        else f"add a block that gives a {kind}"
    )
    cause = f"input '{port}' of '{name}' is not connected; it needs a {kind}"
    context.error("E-WIRE-MISSING", place.key_place or place.place, cause, fix)


def _those(what: str, names: list[str]) -> str:
    if not names:
        return f"it has no {what}s; remove this wire"
    if len(names) == 1:
        return f"its only {what} is {names[0]}"
    return f"its {what}s are {join_words(names, 'and')}"


def suitable(kind: type, name: str, known: dict[str, NodePorts]) -> list[str]:
    """Every output that an input for `kind` of the node `name` could be wired to."""
    return [
        f"{node}.{output}"
        for node, ports in known.items()
        for output, each in ports.outputs.items()
        if each is kind and node != name
    ]


def _check_source(
    context: CheckContext,
    name: str,
    port: str,
    declared: In,
    source: Value,
    known: dict[str, NodePorts],
) -> None:
    if not isinstance(source.data, str):
        return
    node, dot, output = source.data.partition(".")
    if not dot or not output:
        _incomplete(context, source, node, declared, known)
    elif node == "robot" and "robot" not in known:
        cause = "this pipeline has no robot"
        context.error("E-WIRE-NODE", source.place, cause, "add `robot: {in: {wheels: ...}}` to it")
    elif node not in known:
        _unknown_node(context, source, node, output, known)
    elif node == "robot" and context.robot is None:
        return  # its file could not be read, so its sensors are not known
    elif output not in known[node].outputs:
        _unknown_output(context, source, node, output, declared, known)
    elif known[node].outputs[output] is not declared.kind:
        _mismatch(context, name, port, source, known[node].outputs[output], declared.kind, known)


def _incomplete(
    context: CheckContext, source: Value, node: str, declared: In, known: dict[str, NodePorts]
) -> None:
    outputs = known[node].outputs if node in known else {}
    fitting = [output for output, kind in outputs.items() if kind is declared.kind]
    fix = f"write {node}.{fitting[0]}" if fitting else "write block.output"
    cause = f"'{source.data}' names no output; a wire begins at block.output"
    context.error("E-WIRE-OUTPUT", source.place, cause, fix)


def _unknown_node(
    context: CheckContext, source: Value, node: str, output: str, known: dict[str, NodePorts]
) -> None:
    blocks = context.pipeline_value("blocks")
    if blocks is not None and node in blocks.entries:
        return  # the block is there but its kind is unknown, which is said there
    near = closest_match(node, known)
    fix = f"did you mean {near}.{output}?" if near else f"there are {join_words(known, 'and')}"
    context.error("E-WIRE-NODE", source.place, f"there is no block '{node}'", fix)


def _unknown_output(
    context: CheckContext,
    source: Value,
    node: str,
    output: str,
    declared: In,
    known: dict[str, NodePorts],
) -> None:
    outputs = known[node].outputs
    fitting = [each for each, kind in outputs.items() if kind is declared.kind]
    near = closest_match(output, outputs) or (fitting[0] if len(fitting) == 1 else None)
    fix = f"did you mean {node}.{near}?" if near else _those("output", list(outputs))
    context.error("E-WIRE-OUTPUT", source.place, f"'{node}' has no output '{output}'", fix)


def _mismatch(
    context: CheckContext,
    name: str,
    port: str,
    source: Value,
    given: type,
    wanted: type,
    known: dict[str, NodePorts],
) -> None:
    cause = (
        f"{source.data} carries {described(given)}, "
        f"but input '{port}' of '{name}' takes {described(wanted)}"
    )
    sources = suitable(wanted, name, known)
    fix = (
        f"wire it from {join_words(sources)}" if sources else "put a block that converts it between"
    )
    context.error("E-WIRE-TYPE", source.place, cause, fix)


def described(kind: type) -> str:
    """A message class with the units that it carries: `Twist (m/s, rad/s)`."""
    units = dict.fromkeys(
        field.unit for name, (_, field) in fields(kind).items() if field.unit and name != "time"
    )
    return f"{kind.__name__} ({', '.join(units)})" if units else kind.__name__
