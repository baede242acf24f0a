"""`graph --output`: the picture has every block and wire, each at a place of its own."""

import re
from itertools import combinations
from xml.etree import ElementTree

import pytest

from diffbotctl.cli.graph import wires_of
from diffbotctl.cli.output import has_mark
from diffbotctl.config.load import load
from diffbotctl.message_types import type_name
from diffbotctl.render.graph_layout import Wire, dot_lines, layout_graph, mermaid_lines
from diffbotctl.render.graph_svg import graph_svg
from diffbotctl.runs.build_graph import assemble
from tests.support.running import cli

SVG = "{http://www.w3.org/2000/svg}"
DIAMOND = [
    Wire("robot", "encoders", "a", "encoders"),
    Wire("a", "out", "b", "in"),
    Wire("a", "out", "c", "in"),
    Wire("b", "out", "d", "left"),
    Wire("c", "out", "d", "right"),
    Wire("a", "out", "d", "past"),  # passes the layer of b and c
    Wire("d", "wheels", "robot", "wheels"),
]


def graph_of(pipeline):
    assembly = assemble(load(pipeline), False)
    return list(wires_of(assembly.graph, assembly.command)), assembly.graph


def test_the_layers_follow_the_wires():
    plan = layout_graph(DIAMOND, ["a", "b", "c", "d"])
    names = sorted((box.x, box.name) for box in plan.boxes)
    assert [name for _, name in names] == ["robot", "a", "b", "c", "d", "robot"]
    x = {box.name: box.x for box in plan.boxes}
    assert x["b"] == x["c"]
    (past,) = (points for wire, points in plan.routes if wire.port == "past")
    boxes = {box.name: box for box in plan.boxes}
    for name in "bc":  # the wire passes between them or beside them, not through them
        box = boxes[name]
        assert all(not box.y < y < box.y + box.height for _, y in past[1:-1])


@pytest.mark.parametrize("pipeline", ["goal", "turtle", "hello", "wander"])
def test_no_box_covers_another_and_every_wire_runs_right(pipeline):
    wires, graph = graph_of(pipeline)
    plan = layout_graph(wires, [node.name for node in graph.nodes])
    for one, other in combinations(plan.boxes, 2):
        is_beside = one.x + one.width <= other.x or other.x + other.width <= one.x
        is_apart = one.y + one.height <= other.y or other.y + other.height <= one.y
        assert is_beside or is_apart, (one.name, other.name)
    assert {wire for wire, _ in plan.routes} == set(wires)
    for wire, points in plan.routes:
        assert [x for x, _ in points] == sorted(x for x, _ in points), wire
        assert all(0 <= x <= plan.width and 0 <= y <= plan.height for x, y in points)


def test_the_picture_names_blocks_ports_types_and_file():
    wires, graph = graph_of("goal")
    kinds = {wire: type_name(kind) for wire, kind in graph.kinds.items()}
    blocks = [node.name for node in graph.nodes]
    root = ElementTree.fromstring(graph_svg("goal.yaml", wires, blocks, kinds))
    texts = [text.text for text in root.iter(f"{SVG}text")]
    assert {"goal.yaml", *blocks, "robot", "operator", "Encoders", "autonomous"} <= set(texts)
    assert texts.count("robot") == 2  # its sensors, and its commands
    names = [title.text for title in root.iter(f"{SVG}title")]
    assert len(names) == len(wires) and "gate.wheels to robot.wheels" in names


def test_graphviz_and_mermaid_have_the_same_wires():
    wires, graph = graph_of("goal")
    blocks = {node.name for node in graph.nodes}
    dot = "\n".join(dot_lines(wires, blocks, 'a "name"'))
    assert dot.count(" -> ") == len(wires) and '"guard" [shape=box]' in dot
    assert '"operator" [shape=ellipse]' in dot and 'label="a \\"name\\""' in dot
    assert "\n".join(mermaid_lines(wires, blocks)).count(" -->|") == len(wires)


def test_a_picture_is_written_over_ours_but_over_no_other_file(tmp_path):
    for name in ("g.svg", "g.dot", "g.mmd"):
        path = tmp_path / name
        for _ in range(2):
            code, printed, complaint = cli(tmp_path, "graph", "hello", "--output", str(path))
            assert code == 0 and re.search(r"written: .*g\.", printed), complaint
        assert has_mark(path.read_bytes())
    own = tmp_path / "own.dot"
    own.write_text("// a drawing of my own\n")
    code, _, complaint = cli(tmp_path, "graph", "hello", "--output", str(own))
    assert code != 0 and "E-OUTPUT" in complaint and own.read_text().startswith("// a drawing")
