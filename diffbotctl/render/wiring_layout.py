"""Where each part and pin of a wiring picture goes: four columns, and one row for each pin.

Signals run straight along their row from one column to the next. What the right column takes from
the board's 5 V and GND runs down two rails.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

from diffbotctl.config.harness import (
    BOARD,
    CELLS,
    DRIVER,
    GROUND,
    RADIO,
    STOP,
    SUPPLY,
    Harness,
    HarnessPart,
    HarnessWire,
)

SOURCES, DRIVES, BRAIN, SENSES = range(4)  # columns, from left to right
LEFT_ROWS = {"left motor": 0, "right motor": 4, CELLS: 8}  # top row of each part of the first one
DRIVER_ROWS = {
    "OUT1": 1,
    "OUT2": 2,
    "OUT3": 5,
    "OUT4": 6,
    "ENA": 1,
    "IN1": 2,
    "IN2": 3,
    "IN3": 4,
    "IN4": 5,
    "ENB": 6,
    "5V": 8,
    "12V": 9,
    "GND": 10,
}
SUPPLIES = ("VCC", "GND")


class PlacedPart(NamedTuple):
    """A part in the picture: `left` and `right` map the row of each pin on that side to its name.

    It covers the rows from `top` to `bottom`, both of which are its border.
    """

    part: HarnessPart
    column: int
    top: int
    bottom: int
    left: dict[int, str]
    right: dict[int, str]


class WireRun(NamedTuple):
    """How one wire runs: from a row of one column to a row of the next; by a rail if they differ.

    `start` is the wire's end on the left.
    """

    wire: HarnessWire
    column: int
    start: int
    end: int

    @property
    def is_railed(self) -> bool:
        """True for 5 V and ground between board and right column."""
        return self.column == BRAIN and self.wire.colour in (SUPPLY, GROUND)


class Layout(NamedTuple):
    """A whole picture in rows and columns."""

    parts: tuple[PlacedPart, ...]
    runs: tuple[WireRun, ...]
    rows: int


def layout(harness: Harness) -> Layout:
    """Place everything."""
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
                side[DRIVER_ROWS[pin.name]] = pin.name
    bottom = max(DRIVER_ROWS.values()) + 1
    return PlacedPart(harness.parts[DRIVER], DRIVES, 0, bottom, left, right)


def _senses(harness: Harness) -> Iterator[PlacedPart]:
    """The right column, from the radio down."""
    taken = {CELLS, DRIVER, BOARD, *LEFT_ROWS}
    keys = [key for key in harness.parts if key not in taken]
    order = {RADIO: 0, STOP: 2}
    top = 0
    for key in sorted(keys, key=lambda key: order.get(key, 1)):
        part = harness.parts[key]
        names = sorted(part.pins, key=lambda name: (name not in SUPPLIES, name == "RXD"))
        rows = {top + 1 + number: name for number, name in enumerate(names)}
        divided = any(wire.through for wire in harness.of(BOARD, key))
        bottom = top + len(names) + 1 + divided  # the resistor to ground needs a row
        yield PlacedPart(part, SENSES, top, bottom, rows, {})
        top = bottom + 1


def _runs(harness: Harness, senses: dict[str, PlacedPart]) -> Iterator[WireRun]:
    heads: dict[str, int] = {}  # row of the board's own 5V and GND pins for the right column
    for wire in harness.wires:
        ends = {wire.start.part: wire.start.name, wire.end.part: wire.end.name}
        if DRIVER in ends:
            row = DRIVER_ROWS[ends[DRIVER]]
            yield WireRun(wire, DRIVES if BOARD in ends else SOURCES, row, row)
            continue
        (key,) = ends.keys() - {BOARD}
        row = next(row for row, name in senses[key].left.items() if name == ends[key])
        railed = wire.colour in (SUPPLY, GROUND)
        start = heads.setdefault(wire.colour, row) if railed else row
        yield WireRun(wire, BRAIN, start, row)
