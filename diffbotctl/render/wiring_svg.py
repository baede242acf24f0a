"""A wiring diagram as SVG: parts, wires in their colours, and notes below."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from textwrap import wrap

from diffbotctl.render.harness import (
    BOARD,
    CELLS,
    DRIVER,
    GROUND,
    LOGIC,
    RADIO,
    SUPPLY,
    Divider,
    Harness,
)
from diffbotctl.render.svg import element, svg_document, text_element
from diffbotctl.render.wiring_layout import Layout, PlacedPart, WireRun, layout

# In pixels. Left and right edge of each column of parts; the wires are in the gaps.
BOXES = ((30, 150), (220, 380), (480, 650), (860, 1010))
RAILS = {SUPPLY: 700, LOGIC: 714, GROUND: 728}
RESISTORS, NODE = 750, 822  # left end of the resistors of the divider, and the node between them
# The same where the node is the board's pin: the series resistor is right of the node.
NODE_AT_BOARD, SERIES_AT_BOARD = 803, 808
RESISTOR_WIDTH, RESISTOR_HEIGHT = 48, 16
WIDTH, ROW, TOP, MARGIN = 1040, 28, 92, 30
PIN, WIRE, HALO, NOTE = 5, 4, 9, 21
KEY_COLUMNS, KEY_WIDTH = 5, 200
LONG_TITLE = 16  # characters that fit a part at full size
NOTE_WIDTH = 130  # characters of a line of notes
PAINTS = {
    "red": "#d62828",
    "black": "#2b2b2b",
    "orange": "#f57c00",
    "green": "#2e9b46",
    "blue": "#1d72c9",
    "purple": "#8e3bb5",
    "yellow": "#f4c20d",
    "white": "#ffffff",
    "pink": "#d9679b",
    "cyan": "#1fb5ad",
    "grey": "#8a98a0",
    "brown": "#8a5a3c",
}
PAPER = "#f6f4ee"
BOARDS_PAINT = {DRIVER: "#a8322d", BOARD: "#0b6b7d", RADIO: "#23508e", CELLS: "#3d4147"}
PLAIN_PAINT = "#46535c"
STYLE = """
text { font-family: "DejaVu Sans", "Segoe UI", Helvetica, Arial, sans-serif; font-size: 14px }
.pin { font-family: "DejaVu Sans Mono", Menlo, Consolas, monospace; font-size: 13px; fill: #fff }
.part { font-weight: bold; fill: #fff; text-anchor: middle }
.remark { font-size: 12px; fill: #fffc; text-anchor: middle }
.title { font-size: 22px; font-weight: bold; fill: #22282d }
.note, .ohm { font-size: 13px; fill: #333a40 }
.ohm { font-size: 11px; text-anchor: middle }
path { fill: none; stroke-linejoin: round }
"""


def wiring_svg(harness: Harness, notes: Iterable[str], title: str) -> str:
    """The diagram as an SVG document, with `notes` below it."""
    plan = layout(harness)
    key = _y(plan.rows) + ROW
    lines_below = [line for note in notes for line in _wrapped(note)]
    key_end = key + ROW + NOTE
    height = key_end + len(lines_below) * NOTE + MARGIN
    parts = (line for placed in plan.parts for line in _part(placed))
    marks = [
        element("style", STYLE),
        text_element(MARGIN, 46, title, class_="title"),
        *_wires(plan),
        *parts,
        *_key(harness.colours(), key),
        *(
            text_element(MARGIN + (0 if first else 18), key_end + n * NOTE, line, class_="note")
            for n, (first, line) in enumerate(lines_below)
        ),
    ]
    return svg_document(WIDTH, height, marks, background=PAPER)


def _y(row: int) -> int:
    return TOP + row * ROW


def _wrapped(note: str) -> Iterator[tuple[bool, str]]:
    for number, line in enumerate(wrap(note, NOTE_WIDTH)):
        yield number == 0, f"•  {line}" if number == 0 else line


def _wires(plan: Layout) -> Iterator[str]:
    """Rails first, so that straight wires are drawn on top of them."""
    for run in sorted(plan.runs, key=lambda run: not run.is_railed):
        yield from _wire(run)
    for run in plan.runs:
        if run.is_railed:
            yield _dot(RAILS[run.wire.colour], _y(run.end), run.wire.colour)
        if run.wire.through is not None:
            yield from _divider(run, run.wire.through)


def _wire(run: WireRun) -> Iterator[str]:
    first, last = BOXES[run.column][1], BOXES[run.column + 1][0]
    route = f"M{first} {_y(run.start)}"
    if run.is_railed:
        route += f" H{RAILS[run.wire.colour]} V{_y(run.end)}"
    route += f" H{last}"
    yield from _line(route, run.wire.colour, not run.is_railed)


def _line(route: str, colour: str, over: bool = False) -> Iterator[str]:
    if over:
        yield element("path", d=route, stroke=PAPER, stroke_width=HALO)
    if colour == "white":  # visible on the light background
        yield element("path", d=route, stroke="#555", stroke_width=WIRE + 2)
    yield element("path", class_="wire", d=route, stroke=PAINTS[colour], stroke_width=WIRE)


def _dot(x: float, y: float, colour: str) -> str:
    return element("circle", cx=x, cy=y, r=PIN, fill=PAINTS[colour])


def _divider(run: WireRun, divider: Divider) -> Iterator[str]:
    """A voltage divider: one resistor in the wire, one from its node to the ground rail."""
    x, y, below = RAILS[GROUND], _y(run.start), _y(run.start + 1)
    node, series = (NODE_AT_BOARD, SERIES_AT_BOARD) if divider.is_at_board else (NODE, RESISTORS)
    route = f"M{node} {y} V{below} H{x}"
    yield element("path", d=route, stroke=PAINTS[GROUND], stroke_width=WIRE)
    yield _dot(x, below, GROUND)
    yield _dot(node, y, run.wire.colour)
    for left, height, ohms in ((series, y, divider.series), (RESISTORS, below, divider.parallel)):
        yield element(
            "rect",
            x=left,
            y=height - RESISTOR_HEIGHT // 2,
            width=RESISTOR_WIDTH,
            height=RESISTOR_HEIGHT,
            rx=3,
            fill="#ecd9b0",
            stroke="#7c6a45",
        )
        yield text_element(left + RESISTOR_WIDTH / 2, height + 4, ohms, class_="ohm")


def _part(placed: PlacedPart) -> Iterator[str]:
    first, last = BOXES[placed.column]
    top, bottom = _y(placed.top) - 10, _y(placed.bottom) - 2
    middle = (first + last) / 2
    paint = BOARDS_PAINT.get(placed.part.key, PLAIN_PAINT)
    yield element(
        "rect",
        x=first,
        y=top,
        width=last - first,
        height=bottom - top,
        rx=7,
        fill=paint,
        stroke="#0004",
    )
    title, room = placed.part.title, last - first - 20
    squeezed = {"textLength": room, "lengthAdjust": "spacingAndGlyphs"}
    looks = squeezed if len(title) > LONG_TITLE else {}
    yield text_element(middle, top + 18, title, class_="part", **looks)
    if placed.part.remark:
        yield text_element(middle, bottom - 7, placed.part.remark, class_="remark")
    yield from _pins(placed.left, first, 1)
    yield from _pins(placed.right, last, -1)


def _pins(rows: dict[int, str], edge: int, inward: int) -> Iterator[str]:
    anchor = None if inward > 0 else "end"
    for row, name in rows.items():
        y = _y(row)
        yield element("circle", cx=edge, cy=y, r=PIN, fill="#e7c45a", stroke="#5c4a12")
        yield text_element(edge + inward * 13, y + 5, name, class_="pin", text_anchor=anchor)


def _key(colours: dict[str, str], y: int) -> Iterable[str]:
    for number, (colour, meaning) in enumerate(colours.items()):
        x = MARGIN + number % KEY_COLUMNS * KEY_WIDTH
        at = y + number // KEY_COLUMNS * NOTE
        yield from _line(f"M{x} {at - 5} h22", colour)
        yield text_element(x + 28, at, f"{colour}: {meaning}", class_="note")
