"""Layout of a wiring diagram: parts in four columns, and one row for each pin.

A signal is a straight line along its row, from one column to the next. The supply and GND of the
right column are connected to the board by vertical rails.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

from diffbotctl.render.harness import (
    BOARD,
    CELLS,
    DRIVER,
    RADIO,
    RAILED,
    STOP,
    Harness,
    HarnessPart,
    HarnessWire,
)

SOURCES, DRIVES, BRAIN, SENSES = range(4)  # columns from left to right
LEFT_ROWS = {
    "left motor": 0,
    "right motor": 4,
    CELLS: 8,
}  # top row of each part in the first column
SUPPLIES = ("VCC", "GND")


class PlacedPart(NamedTuple):
    """A part in the diagram. `left` and `right` map the row of each pin on that side to its name.

    Its border is in the rows `top` and `bottom`.
    """

    part: HarnessPart
    column: int
    top: int
    bottom: int
    left: dict[int, str]
    right: dict[int, str]


class WireRun(NamedTuple):
    """A wire from row `start` of one column to row `end` of the next; along a rail if they differ.

    `start` is the end on the left.
    """

    wire: HarnessWire
    column: int
    start: int
    end: int

    @property
    def is_railed(self) -> bool:
        """True for supply and GND between the board and the right column."""
        return self.column == BRAIN and self.wire.colour in RAILED


class Layout(NamedTuple):
    """A diagram in rows and columns."""

    parts: tuple[PlacedPart, ...]
    runs: tuple[WireRun, ...]
    rows: int


def layout(harness: Harness) -> Layout:
    senses = list(_senses(harness))
    runs = list(_runs(harness, {placed.part.key: placed for placed in senses}))
    left = {run.end: _board_pin(harness, run) for run in runs if run.column == DRIVES}
    right = {run.start: _board_pin(harness, run) for run in runs if run.column == BRAIN}
    bottom = max([*left, *right, *(placed.bottom - 1 for placed in senses)]) + 1
    board = PlacedPart(harness.parts[BOARD], BRAIN, 0, bottom, left, right)
    parts = [*_sources(harness), _driver(harness), board, *senses]
    return Layout(tuple(parts), tuple(runs), max(placed.bottom for placed in parts) + 1)


def _board_pin(harness: Harness, run: WireRun) -> str:
    name = run.wire.start.name if run.wire.start.part == BOARD else run.wire.end.name
    return harness.printed.get(name, name)


def _sources(harness: Harness) -> Iterator[PlacedPart]:
    for key, top in LEFT_ROWS.items():
        rows = {top + 1: "+", top + 2: "-"}
        yield PlacedPart(harness.parts[key], SOURCES, top, top + 3, {}, rows)


def _driver(harness: Harness) -> PlacedPart:
    left: dict[int, str] = {}
    right: dict[int, str] = {}
    for wire in harness.of(DRIVER, BOARD, *LEFT_ROWS):
        for pin, other in ((wire.start, wire.end), (wire.end, wire.start)):
            if pin.part == DRIVER:
                side = right if other.part == BOARD else left
                side[harness.driver_rows[pin.name]] = pin.name
    bottom = max(harness.driver_rows.values()) + 1
    return PlacedPart(harness.parts[DRIVER], DRIVES, 0, bottom, left, right)


def _senses(harness: Harness) -> Iterator[PlacedPart]:
    """The parts of the right column, from the radio down."""
    placed_elsewhere = {CELLS, DRIVER, BOARD, *LEFT_ROWS}
    keys = [key for key in harness.parts if key not in placed_elsewhere]
    order = {RADIO: 0, STOP: 2}
    top = 0
    for key in sorted(keys, key=lambda key: order.get(key, 1)):
        part = harness.parts[key]
        names = sorted(part.pins, key=lambda name: (name not in SUPPLIES, name == "RXD"))
        rows = {top + 1 + number: name for number, name in enumerate(names)}
        divided = any(wire.through is not None for wire in harness.of(BOARD, key))
        bottom = top + len(names) + 1 + divided  # a row for the resistor to ground
        yield PlacedPart(part, SENSES, top, bottom, rows, {})
        top = bottom + 1


def _runs(harness: Harness, senses: dict[str, PlacedPart]) -> Iterator[WireRun]:
    heads: dict[str, int] = {}  # row of the board's 5V and GND pins for the right column
    for wire in harness.wires:
        ends = {wire.start.part: wire.start.name, wire.end.part: wire.end.name}
        if DRIVER in ends:
            row = harness.driver_rows[ends[DRIVER]]
            yield WireRun(wire, DRIVES if BOARD in ends else SOURCES, row, row)
            continue
        (key,) = ends.keys() - {BOARD}
        row = next(row for row, name in senses[key].left.items() if name == ends[key])
        railed = wire.colour in RAILED
        start = heads.setdefault(wire.colour, row) if railed else row
        yield WireRun(wire, BRAIN, start, row)
