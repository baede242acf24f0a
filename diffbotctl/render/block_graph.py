"""The wires of a pipeline, and their graph as text for other programs: Mermaid and Graphviz."""

from __future__ import annotations

import json
from collections.abc import Iterator, Sequence, Set
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
