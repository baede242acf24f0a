"""Places of the blocks of a pipeline in layers from left to right, and the routes of its wires.

The method of Sugiyama and others (1981): a block is right of all that it depends on; a wire that
passes a layer has a place of its own there; the order within a layer follows the neighbours.
"""

from __future__ import annotations

import json
from collections.abc import Iterator, Sequence, Set
from itertools import pairwise
from statistics import fmean
from typing import NamedTuple


class Wire(NamedTuple):
    """One wire, from a node's output to another node's input."""

    source: str
    output: str
    target: str
    port: str

    @property
    def label(self) -> str:
        """What runs along the wire; the port where it has another name."""
        return self.output if self.output == self.port else f"{self.output} to {self.port}"


def node_names(wires: Sequence[Wire]) -> list[str]:
    """The nodes at the ends of the wires, in the order in which they appear."""
    return list(dict.fromkeys(end for wire in wires for end in (wire.source, wire.target)))


def mermaid_lines(wires: Sequence[Wire], blocks: Set[str]) -> Iterator[str]:
    """A Mermaid flow chart; drivers, which are not in `blocks`, are rounded."""
    yield "flowchart LR"
    for name in node_names(wires):
        key = _mermaid_key(name)
        yield f"    {key}[{name}]" if name in blocks else f"    {key}([{name}])"
    for wire in wires:
        source, target = _mermaid_key(wire.source), _mermaid_key(wire.target)
        yield f"    {source} -->|{wire.label}| {target}"


def _mermaid_key(name: str) -> str:
    """The name of a node in Mermaid, where a dot has a meaning."""
    return name.replace(".", "_")


def dot_lines(wires: Sequence[Wire], blocks: Set[str], title: str) -> Iterator[str]:
    """A digraph in the language of Graphviz; drivers are ellipses."""
    yield "digraph pipeline {"
    yield f"  graph [rankdir=LR, label={json.dumps(title)}];"
    for name in node_names(wires):
        yield f"  {json.dumps(name)} [shape={'box' if name in blocks else 'ellipse'}];"
    for wire in wires:
        ends = f"{json.dumps(wire.source)} -> {json.dumps(wire.target)}"
        yield f"  {ends} [label={json.dumps(wire.label)}];"
    yield "}"


LETTER_WIDTH, TITLE_LETTER_WIDTH = 6.6, 8.0  # px of fonts of 12 and 14 px
TITLE_HEIGHT, PORT_HEIGHT, PASSAGE_HEIGHT = 24.0, 17.0, 10.0  # px
LAYER_GAP, NODE_GAP, BOX_PADDING = 70.0, 22.0, 12.0  # px
ORDER_SWEEPS = 8

Point = tuple[float, float]


class GraphBox(NamedTuple):
    """A node with its ports; x, y is its upper left corner, in px."""

    name: str
    inputs: tuple[str, ...]
    outputs: tuple[str, ...]
    x: float
    y: float
    width: float
    height: float

    def port(self, name: str, is_input: bool) -> Point:
        ports = self.inputs if is_input else self.outputs
        y = self.y + TITLE_HEIGHT + (ports.index(name) + 0.5) * PORT_HEIGHT
        return (self.x if is_input else self.x + self.width), y


class GraphLayout(NamedTuple):
    """Boxes, and for each wire the points through which it runs; all in px from the corner."""

    boxes: tuple[GraphBox, ...]
    routes: tuple[tuple[Wire, tuple[Point, ...]], ...]
    width: float
    height: float


class _Node(NamedTuple):
    """A box without a place, or the passage of the wires of one output through a layer."""

    key: str
    name: str  # empty for a passage
    inputs: tuple[str, ...] = ()
    outputs: tuple[str, ...] = ()

    @property
    def width(self) -> float:
        if not self.name:
            return 0.0
        ports = sum(max(map(len, names), default=0) for names in (self.inputs, self.outputs))
        inner = max(TITLE_LETTER_WIDTH * len(self.name), LETTER_WIDTH * (ports + 3))
        return inner + 2 * BOX_PADDING

    @property
    def height(self) -> float:
        rows = max(len(self.inputs), len(self.outputs))
        return TITLE_HEIGHT + rows * PORT_HEIGHT + BOX_PADDING / 2 if self.name else PASSAGE_HEIGHT


def layout_graph(wires: Sequence[Wire], blocks: Sequence[str]) -> GraphLayout:
    """The layout; `blocks` in the order of their reactions, which has no circle.

    A driver that also gets commands, such as the robot, is drawn at both ends.
    """
    wires = list(dict.fromkeys(wires))
    ends = [(wire.source, _end_key(wire, set(blocks))) for wire in wires]
    layer_of = _layers(ends, blocks)
    nodes = _nodes(wires, ends)
    layers: list[list[_Node]] = [[] for _ in range(max(layer_of.values(), default=0) + 1)]
    for key, node in nodes.items():
        layers[layer_of[key]].append(node)
    paths = []
    for wire, (source, target) in zip(wires, ends, strict=True):
        path = [source]
        for layer in range(layer_of[source] + 1, layer_of[target]):
            passage = _Node(f"{wire.source}.{wire.output}@{layer}", "")
            if passage not in layers[layer]:
                layers[layer].append(passage)
            path.append(passage.key)
        paths.append([*path, target])
    _order(layers, paths)
    return _placed(layers, list(zip(wires, paths, strict=True)))


def _end_key(wire: Wire, blocks: Set[str]) -> str:
    """The node at the end of a wire; the command of a driver ends at a node of its own."""
    return wire.target if wire.target in blocks else f"{wire.target}<"


def _layers(ends: Sequence[tuple[str, str]], blocks: Sequence[str]) -> dict[str, int]:
    """The layer of each node: one more than the highest of its sources."""
    keys = [key for pair in ends for key in pair]
    order = [*blocks, *(key for key in keys if key.endswith("<"))]
    layers = dict.fromkeys(keys, 0)
    for key in dict.fromkeys(order):
        if key in layers:
            layers[key] = 1 + max((layers[s] for s, t in ends if t == key), default=-1)
    last = max(layers.values(), default=0)
    return {key: last if key.endswith("<") else layer for key, layer in layers.items()}


def _nodes(wires: Sequence[Wire], ends: Sequence[tuple[str, str]]) -> dict[str, _Node]:
    nodes = {}
    for key in dict.fromkeys(key for pair in ends for key in pair):
        pairs = list(zip(wires, ends, strict=True))
        inputs = dict.fromkeys(wire.port for wire, (_, target) in pairs if target == key)
        outputs = dict.fromkeys(wire.output for wire, (source, _) in pairs if source == key)
        nodes[key] = _Node(key, key.removesuffix("<"), tuple(inputs), tuple(outputs))
    return nodes


def _order(layers: list[list[_Node]], paths: Sequence[Sequence[str]]) -> None:
    """Sort each layer by the mean place of its neighbours, from the left and from the right."""
    for sweep in range(ORDER_SWEEPS):
        is_forward = sweep % 2 == 0
        sequence = layers if is_forward else layers[::-1]
        for fixed, changed in pairwise(sequence):
            places = {node.key: place for place, node in enumerate(fixed)}
            neighbours: dict[str, list[int]] = {}
            for path in paths:
                for left, right in pairwise(path):
                    here, there = (right, left) if is_forward else (left, right)
                    if there in places:
                        neighbours.setdefault(here, []).append(places[there])
            ranked = sorted(
                (fmean(neighbours.get(node.key, [place])), place)
                for place, node in enumerate(changed)
            )
            changed[:] = [changed[place] for _, place in ranked]


def _placed(layers: list[list[_Node]], paths: list[tuple[Wire, list[str]]]) -> GraphLayout:
    heights = [sum(node.height + NODE_GAP for node in layer) - NODE_GAP for layer in layers]
    height = max(heights, default=0.0)
    boxes: dict[str, GraphBox] = {}
    passages: dict[str, tuple[Point, Point]] = {}
    x = 0.0
    for layer, used in zip(layers, heights, strict=True):
        width, y = max(node.width for node in layer), (height - used) / 2
        for node in layer:
            if node.name:
                left = x + (width - node.width) / 2
                boxes[node.key] = GraphBox(*node[1:], left, y, node.width, node.height)
            else:
                middle = y + node.height / 2
                passages[node.key] = ((x, middle), (x + width, middle))
            y += node.height + NODE_GAP
        x += width + LAYER_GAP
    routes = []
    for wire, path in paths:
        between = [point for key in path[1:-1] for point in passages[key]]
        start = boxes[path[0]].port(wire.output, False)
        routes.append((wire, (start, *between, boxes[path[-1]].port(wire.port, True))))
    return GraphLayout(tuple(boxes.values()), tuple(routes), x - LAYER_GAP, height)
