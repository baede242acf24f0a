"""The blocks and wires of a pipeline as an SVG picture; a colour stands for a message type."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence

from diffbotctl.render.graph_layout import (
    BOX_PADDING,
    LETTER_WIDTH,
    TITLE_HEIGHT,
    GraphBox,
    Point,
    Wire,
    layout_graph,
)
from diffbotctl.render.svg import element, format_number, svg_document, text_element

MARGIN, HEAD, FONT_SIZE, TITLE_SIZE = 30.0, 60.0, 12, 14  # px
KEY_HEIGHT, KEY_LINE = 40.0, 24.0  # px
# Of Okabe and Ito, distinct with colour vision deficiency too; further lines repeat them dashed.
COLOURS = ("#0072b2", "#d55e00", "#009e73", "#cc79a7", "#56b4e9", "#e69f00", "#000000")
DRIVER_FILL, BLOCK_FILL = "#eeeeee", "#e8f1fa"


def graph_svg(
    title: str, wires: Sequence[Wire], blocks: Sequence[str], kinds: Mapping[str, str]
) -> str:
    """The picture. `kinds`: the message type of each `node.output`."""
    plan = layout_graph(wires, blocks)
    used = list(dict.fromkeys(kinds[f"{wire.source}.{wire.output}"] for wire, _ in plan.routes))
    width = max(plan.width, _key_width(used), TITLE_SIZE * len(title) / 2)
    marks = [text_element(MARGIN, MARGIN, title, font_size=TITLE_SIZE, font_weight="bold")]
    for wire, points in plan.routes:
        kind = kinds[f"{wire.source}.{wire.output}"]
        name = element("title", f"{wire.source}.{wire.output} to {wire.target}.{wire.port}")
        marks.append(element("path", name, d=_curve(points), **_stroke(used.index(kind))))
    for box in plan.boxes:
        marks += _box(box, box.name in blocks)
    marks += _key(used, HEAD + plan.height + KEY_HEIGHT)
    height = HEAD + plan.height + KEY_HEIGHT + MARGIN
    return svg_document(
        width + 2 * MARGIN, height, marks, font_family="sans-serif", font_size=FONT_SIZE
    )


def _stroke(number: int) -> dict[str, object]:
    dashes = "6 3" if number // len(COLOURS) % 2 else None
    colour = COLOURS[number % len(COLOURS)]
    return {"fill": "none", "stroke": colour, "stroke_width": 1.6, "stroke_dasharray": dashes}


def _curve(points: Sequence[Point]) -> str:
    """A path that leaves and reaches each point horizontally; straight along a passage."""
    (x, y), *others = [(MARGIN + x, HEAD + y) for x, y in points]
    parts = [f"M{_number(x)} {_number(y)}"]
    for number, (to_x, to_y) in enumerate(others):
        if number % 2:  # the two points of a passage
            parts.append(f"H{_number(to_x)}")
        else:
            middle = _number((x + to_x) / 2)
            ends = f"{_number(to_x)} {_number(to_y)}"
            parts.append(f"C{middle} {_number(y)} {middle} {_number(to_y)} {ends}")
        x, y = to_x, to_y
    return "".join(parts)


def _number(value: float) -> str:
    return format_number(float(value))


def _box(box: GraphBox, is_block: bool) -> Iterator[str]:
    x, y = MARGIN + box.x, HEAD + box.y
    fill = BLOCK_FILL if is_block else DRIVER_FILL
    corner = 4.0 if is_block else 14.0  # drivers are rounded
    yield element(
        "rect", x=x, y=y, width=box.width, height=box.height, rx=corner, fill=fill, stroke="#555555"
    )
    middle = x + box.width / 2
    yield text_element(
        middle,
        y + TITLE_HEIGHT - 8,
        box.name,
        text_anchor="middle",
        font_size=TITLE_SIZE,
        font_weight="bold",
    )
    for names, is_input in ((box.inputs, True), (box.outputs, False)):
        for name in names:
            at, height = box.port(name, is_input)
            shift = BOX_PADDING / 2 if is_input else -BOX_PADDING / 2
            anchor = "start" if is_input else "end"
            yield text_element(MARGIN + at + shift, HEAD + height + 4, name, text_anchor=anchor)


def _key(kinds: Sequence[str], y: float) -> Iterator[str]:
    """The message type of each colour."""
    x = MARGIN
    for number, kind in enumerate(kinds):
        line = f"M{_number(x)} {_number(y)}h{_number(KEY_LINE)}"
        yield element("path", d=line, **_stroke(number))
        yield text_element(x + KEY_LINE + 4, y + 4, kind)
        x += _key_step(kind)


def _key_step(kind: str) -> float:
    return KEY_LINE + LETTER_WIDTH * len(kind) + 24


def _key_width(kinds: Sequence[str]) -> float:
    return sum(map(_key_step, kinds))
