"""The map in tiles: only those that have changed are sent, recorded and drawn anew.

A tile is 64 x 64 cells, written as runs, row after row from the lowest y on: `60u3.1#` are 60
unknown cells, three free ones and an occupied one. Column 0, row 0 begins at the map's origin.
"""

from __future__ import annotations

import hashlib
import re
from collections.abc import Iterable, Iterator, Mapping
from typing import Any, NamedTuple

from diffbotctl.messages import MapUpdate

TILE = 64  # cells on each side
UNKNOWN, FREE, OCCUPIED = "u", ".", "#"
PART_TILES = 64  # of one answer to a client
EMPTY_TILE = f"{TILE * TILE}{UNKNOWN}"
RUNS = re.compile(r"(.)\1*")
RUN = re.compile(r"(\d+)([u.#])")

Place = tuple[int, int]  # column and row of a tile


def encode_tile(cells: str) -> str:
    """The runs of 64 x 64 cells."""
    return RUNS.sub(lambda run: f"{len(run[0])}{run[1]}", cells)


def decode_tile(text: str) -> str:
    """64 x 64 cells, as letters. Raises ValueError for anything else."""
    cells = "".join([int(count[:5]) * cell for count, cell in RUN.findall(text[: 8 * TILE * TILE])])
    if len(cells) != TILE * TILE:
        raise ValueError(f"a tile has {len(cells)} cells, not {TILE * TILE}")
    return cells


def tiles_sha256(tiles: Mapping[Place, str]) -> str:
    """The hash of a whole map: of its tiles, in the order of their places."""
    digest = hashlib.sha256()
    for place, text in sorted(tiles.items()):
        if text != EMPTY_TILE:
            digest.update(f"{place} {text}\n".encode())
    return digest.hexdigest()


def tile_places(numbers: Iterable[int]) -> list[Place]:
    """The places that a message has as column, row, column, row."""
    each = iter(numbers)
    return list(zip(each, each, strict=False))


class CellRows(NamedTuple):
    """A whole map: `x` and `y` (m) of the lower left corner, and its rows from the lowest y on."""

    resolution: float
    x: float
    y: float
    rows: tuple[str, ...]


class MapTiles:
    """The map of a run, from all its updates."""

    def __init__(self) -> None:
        self.tiles: dict[Place, str] = {}
        self.changes: dict[Place, int] = {}  # number of the update that changed each tile
        self.number = 0  # of the last update
        self.read = 0  # number of the last reply to `read_map`
        self.points: dict[Place, list[tuple[float, float]]] = {}  # as they were asked for
        self.map = self.version = 0
        self.sha256 = ""
        self.resolution = 0.05

    def take(self, update: MapUpdate) -> list[Place]:
        """Take an update; returns the places of the tiles that it changes."""
        if update.map != self.map:
            self.map, self.tiles, self.changes, self.points = update.map, {}, {}, {}
        self.number += 1
        self.version, self.sha256 = update.version, update.sha256
        self.resolution = update.resolution
        places = tile_places(update.places)
        self.tiles.update(zip(places, update.tiles, strict=False))
        self.changes.update(dict.fromkeys(places, self.number))
        for place in places:
            self.points.pop(place, None)
        return places

    def take_reply(self, reply: Mapping[str, Any]) -> bool:
        """Take a reply to `read_map`. True when there are more."""
        names = ("map", "resolution", "places", "tiles")
        self.take(MapUpdate(0, "starting", **{name: reply[name] for name in names}))
        self.read = int(reply["number"])
        if reply["is_last"]:
            self.version, self.sha256 = reply["version"], reply["sha256"]
        return not reply["is_last"]

    def since(self, map_number: int, number: int) -> tuple[list[Place], int]:
        """The tiles that changed after update `number` of that map, a part of them.

        Returns their places, and the number up to which they are then known.
        """
        begin = number if map_number == self.map else 0
        changed = sorted((at, place) for place, at in self.changes.items() if at > begin)
        part = changed[:PART_TILES]
        if len(part) < len(changed):  # those of one update stay together
            last = part[-1][0]
            whole = [each for each in part if each[0] < last]
            part = whole or [each for each in changed if each[0] == last]
        return [place for _, place in part], part[-1][0] if len(part) < len(
            changed
        ) else self.number

    @property
    def is_whole(self) -> bool:
        """Whether the tiles are those of the version: none is to come, and none was lost."""
        return self.sha256 != "" and tiles_sha256(self.tiles) == self.sha256

    def rows(self) -> CellRows:
        """All tiles as one raster; without any, without rows."""
        if not self.tiles:
            return CellRows(self.resolution, 0.0, 0.0, ())
        columns, rows = zip(*self.tiles, strict=True)
        first, last = min(columns), max(columns)
        lines = []
        for row in range(min(rows), max(rows) + 1):
            band = [
                decode_tile(self.tiles.get((column, row), EMPTY_TILE))
                for column in range(first, last + 1)
            ]
            lines += [
                "".join([cells[line : line + TILE] for cells in band])
                for line in range(0, TILE * TILE, TILE)
            ]
        side = TILE * self.resolution
        return CellRows(self.resolution, first * side, min(rows) * side, tuple(lines))

    def occupied(self) -> Iterator[tuple[float, float]]:
        """The middle of each occupied cell, m."""
        for place, text in self.tiles.items():
            if place not in self.points:
                self.points[place] = list(occupied_cells(place, text, self.resolution))
            yield from self.points[place]


def occupied_cells(place: Place, text: str, resolution: float) -> Iterator[tuple[float, float]]:
    """The middle of each occupied cell of a tile, in m in the map."""
    left, low = place[0] * TILE, place[1] * TILE
    at = 0
    for count, cell in RUN.findall(text):
        if cell == OCCUPIED:
            for index in range(at, at + int(count)):
                row, column = divmod(index, TILE)
                yield (left + column + 0.5) * resolution, (low + row + 0.5) * resolution
        at += int(count)
