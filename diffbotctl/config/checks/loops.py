"""No loop among blocks: in one instant each reacts once, so none can wait for itself."""

from __future__ import annotations

from diffbotctl.config.case import Case
from diffbotctl.config.nodes import RESERVED
from diffbotctl.config.value import Value


def check(case: Case) -> None:
    """Refuse each loop once, naming its blocks in the order of the wires."""
    sources = {name: _sources(value) for name, value in _blocks(case).items()}
    for loop in loops({name: list(found) for name, found in sources.items()}):
        downstream = list(reversed(loop))
        around = " -> ".join([*downstream, downstream[0]])
        place = sources[loop[0]][loop[1 % len(loop)]]
        cause = f"these blocks wait for each other: {around}"
        fix = (
            "take one wire away; what the robot did comes back as robot.encoders, "
            "without a wire from the end of the graph"
        )
        case.error("E-WIRE-LOOP", place.spot, cause, fix)


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


def _blocks(case: Case) -> dict[str, Value]:
    blocks = case.at("blocks")
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
