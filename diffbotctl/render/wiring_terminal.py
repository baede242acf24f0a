"""A wiring diagram in characters, 80 columns wide."""

from __future__ import annotations

from rich.text import Text

from diffbotctl.render.harness import GROUND, LOGIC, SUPPLY, Harness
from diffbotctl.render.wiring_layout import BRAIN, SENSES, Layout, PlacedPart, WireRun, layout

# First and last character column of each column of parts; the wires are in the gaps.
BOXES = ((0, 12), (15, 34), (38, 51), (64, 79))
RAILS = {SUPPLY: 54, LOGIC: 52, GROUND: 56}
NODE_AT_BOARD = 60  # the node of a divider at the board's pin
RESISTOR, NODE = 58, 61  # of the divider: its resistors, and the node between them
KEY_GAP = 2  # rows between the lowest part on the left and the colour key
STYLES = {
    "red": "red",
    "black": "grey46",
    "orange": "dark_orange",
    "green": "green",
    "blue": "dodger_blue2",
    "purple": "magenta",
    "yellow": "yellow",
    "cyan": "cyan",
    "white": "bold",
    "pink": "hot_pink",
    "grey": "grey74",
    "brown": "orange4",
}


Rails = dict[str, tuple[int, int]]  # first and last row of each rail, by colour


def wiring_text(harness: Harness) -> Text:
    plan = layout(harness)
    canvas = _Canvas()
    rails = _rails(plan)
    for run in plan.runs:
        (_tap if run.is_railed else _straight)(canvas, run, rails)
    for colour in rails:
        _rail(canvas, colour, rails)
    for placed in plan.parts:
        _box(canvas, placed)
    return canvas.text(max(plan.rows, _key(canvas, harness, plan)))


def _key(canvas: _Canvas, harness: Harness, plan: Layout) -> int:
    """Write the colour key at the lower left; returns the row after it."""
    top = KEY_GAP + max(placed.bottom for placed in plan.parts if placed.column < BRAIN)
    colours = harness.colours()
    for number, (colour, meaning) in enumerate(colours.items()):
        canvas.put(0, top + number, "━━━", STYLES[colour])
        canvas.put(4, top + number, f"{colour:7} {meaning}", "")
    return top + len(colours)


class _Canvas:
    """Characters by position."""

    def __init__(self) -> None:
        self.cells: dict[tuple[int, int], tuple[str, str]] = {}

    def put(self, x: int, y: int, signs: str, style: str) -> None:
        for i, sign in enumerate(signs):
            self.cells[x + i, y] = (sign, style)

    def text(self, rows: int) -> Text:
        out = Text(no_wrap=True)
        for y in range(rows):
            line = Text()
            for x in range(BOXES[-1][1] + 1):
                line.append(*self.cells.get((x, y), (" ", "")))
            line.rstrip()
            out.append_text(line)
            if y < rows - 1:
                out.append("\n")
        return out


def _rails(plan: Layout) -> Rails:
    rails: Rails = {}
    for run in plan.runs:
        if run.is_railed:
            first, last = rails.get(run.wire.colour, (run.start, run.end))
            rails[run.wire.colour] = (first, max(last, run.end))
        elif run.wire.through is not None:
            first, last = rails[GROUND]
            rails[GROUND] = (first, max(last, run.end + 1))
    return rails


def _level(canvas: _Canvas, first: int, last: int, run: WireRun, row: int, rails: Rails) -> None:
    """A line along `row`, with a crossing at each rail."""
    style = STYLES[run.wire.colour]
    for x in range(first, last):
        crossed = [
            colour
            for colour, (top, bottom) in rails.items()
            if RAILS[colour] == x and top <= row <= bottom
        ]
        canvas.put(x, row, "┼" if crossed else "─", style)


def _straight(canvas: _Canvas, run: WireRun, rails: Rails) -> None:
    _level(canvas, BOXES[run.column][1] + 1, BOXES[run.column + 1][0], run, run.start, rails)
    divider = run.wire.through
    if divider is None:
        return
    node, series, parallel = NODE, RESISTOR, RESISTOR
    if divider.is_at_board:
        node, series, parallel = NODE_AT_BOARD, NODE_AT_BOARD + 1, RAILS[GROUND] + 1
    canvas.put(series, run.start, divider.series, "bold")
    canvas.put(node, run.start, "●", STYLES[run.wire.colour])
    level = "─" * (node - RAILS[GROUND] - 1)
    canvas.put(RAILS[GROUND], run.start + 1, f"●{level}╯", STYLES[GROUND])
    canvas.put(parallel, run.start + 1, divider.parallel, "bold")


def _tap(canvas: _Canvas, run: WireRun, rails: Rails) -> None:
    """A line from the board to its rail, or from the rail to a part."""
    colour = run.wire.colour
    x, style, (top, bottom) = RAILS[colour], STYLES[colour], rails[colour]
    if run.start == run.end:
        _level(canvas, BOXES[BRAIN][1] + 1, x, run, run.end, rails)
    _level(canvas, x + 1, BOXES[SENSES][0], run, run.end, rails)
    canvas.put(x, run.end, "╰" if run.end == bottom > top else "●", style)


def _rail(canvas: _Canvas, colour: str, rails: Rails) -> None:
    first, last = rails[colour]
    for y in range(first, last + 1):
        if (RAILS[colour], y) not in canvas.cells:
            canvas.put(RAILS[colour], y, "│", STYLES[colour])


def _box(canvas: _Canvas, placed: PlacedPart) -> None:
    first, last = BOXES[placed.column]
    inner = last - first - 1
    title = placed.part.title
    if len(title) > inner:
        title = title[: inner - 1] + "…"
    if len(title) <= inner - 2:
        title = f" {title} "
    canvas.put(first, placed.top, f"╭{title:─^{inner}}╮", "bold")
    remark = placed.part.remark
    if 0 < len(remark) <= inner - 2:
        remark = f" {remark} "
    canvas.put(first, placed.bottom, f"╰{remark:─^{inner}}╯", "bold")
    for y in range(placed.top + 1, placed.bottom):
        wall = "│" + " " * inner + "│"
        canvas.put(first, y, wall, "bold")
        if y in placed.left:
            canvas.put(first, y, "┤", "bold")
            canvas.put(first + 2, y, placed.left[y], "")
        if y in placed.right:
            canvas.put(last, y, "├", "bold")
            label = placed.right[y]
            canvas.put(last - 1 - len(label), y, label, "")
