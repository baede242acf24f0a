"""The process that builds the map: scans and requests come as packets, each gets one answer.

python -m diffbotctl.drivers.map_process FILE PARAMETERS
"""

from __future__ import annotations

import json
import pickle
import signal
import socket
import sys
from contextlib import suppress
from typing import Any

import numpy as np

from diffbotctl.drivers.map_builder import PACKET_MAX_BYTES
from diffbotctl.drivers.map_store import map_path, maps_folder, stored_maps
from diffbotctl.errors import RunError
from diffbotctl.geometry.map_tiles import (
    EMPTY_TILE,
    FREE,
    OCCUPIED,
    TILE,
    UNKNOWN,
    Place,
    encode_tile,
    tiles_sha256,
)
from diffbotctl.mapping.lidar_scan import MappedScan
from diffbotctl.mapping.map_file import load_map, save_map
from diffbotctl.mapping.mapper import Correction, Mapper, MapperParameters, MapperState
from diffbotctl.mapping.occupancy_grid import OccupancyGrid
from diffbotctl.mapping.plane_pose import Array, compose
from diffbotctl.messages import MapRequest, MapUpdate, ScanPoints
from diffbotctl.time import SECOND

AUTOSAVE = "autosave"
AUTOSAVE_PERIOD = 30 * SECOND
TILES_PERIOD = SECOND  # between two looks for tiles that have changed
TILES_MAX = 48  # of one answer
TILE_BYTES_MAX = 100_000
RESUMED_SD = (0.15, 0.15, 0.1)  # m, m, rad: after the death of the process before
PLACED_SD = 0.2  # m, of a person's click
NOT_PLACED = "no heading fits there; state it, or another place"
PLACE_KNOWN = "the place in the map is known; state the heading too to correct it"
PARAMETERS = ("resolution", "range_max")
CAUSES = {  # and what a person can do
    MapperState.SEARCHING: "drive gently, a look from one place is not enough",
    MapperState.LOST: "what the lidar measures does not fit the map; drive on, state the place "
    "by a click on the map or `diffbotctl map place`, or load the map of this place",
}


class MapSession:
    """The map of one run, and what of it was sent."""

    def __init__(self, facts: dict[str, Any]) -> None:
        self.facts = facts
        self.number = int(facts.get("map", 1))
        self.resume: list[float] | None = facts.get("resume")
        self.not_loaded = self.not_saved = ""  # why; empty when nothing failed
        self.request, self.refusal = 0, ""
        self.scans = 0
        self.time = self.tiles_due = self.autosave_due = 0
        self.has_changed = False  # since it was saved
        self.correction: Correction | None = None
        self._begin(None)
        name = AUTOSAVE if self.resume and map_path(AUTOSAVE).exists() else facts["load"]
        if name:
            self.not_loaded = self._load(name, bool(self.facts.get("grows")))

    def scan(self, points: ScanPoints) -> MapUpdate:
        self.scans += 1
        self.time = points.time
        scan = mapped_scan(self.scans, points)
        self.correction = self.mapper.add(scan)
        if self.resume is not None:
            place = compose(self.resume, scan.odometry)
            self.mapper.answer(place, np.diag(np.square(RESUMED_SD)))
            self.correction = self.mapper.add(scan)  # the same scan, from the place that is known
            self.resume = None
        self.has_changed = self.has_changed or self.correction.changed_map
        if self.facts["autosave"] and self.time >= self.autosave_due:
            self.autosave()
        return self._update()

    def ask(self, request: MapRequest) -> MapUpdate:
        cause = ""
        if request.task == "save":
            cause = self._save(request.name)
        elif request.task == "load":
            cause = self._load(request.name)
        elif request.task == "clear":
            self._begin(None)
            self.not_loaded = ""
            self.number += 1
        elif request.task == "place":
            pose = np.array([request.x, request.y, request.heading])
            spread = np.diag(np.square([PLACED_SD, PLACED_SD, request.heading_sd]))
            is_known = not self.mapper.is_searching
            refusal = PLACE_KNOWN if is_known else NOT_PLACED
            cause = "" if self.mapper.answer(pose, spread) else refusal
        self.request, self.refusal = request.number, cause
        return self._update()

    def autosave(self) -> None:
        """Save the map if it has grown; a full disk ends no run."""
        self.autosave_due = self.time + AUTOSAVE_PERIOD
        if self.has_changed and self.facts["autosave"]:
            self.not_saved = self._save(AUTOSAVE)
            self.has_changed = False

    def _begin(self, saved: Any, grows: bool = False) -> None:
        settings = {name: self.facts[name] for name in PARAMETERS}
        self.mapper = Mapper(MapperParameters(**settings), saved, grows)
        self.sent: dict[Place, str] = {}
        self.changed: dict[Place, str] = {}
        self.compared: OccupancyGrid | None = None
        self.tiles_due = 0

    def _save(self, name: str) -> str:
        try:
            maps_folder().mkdir(parents=True, exist_ok=True)
            save_map(self.mapper.map(), map_path(name))
        except OSError as error:
            return f"the map could not be saved: {error.strerror}"
        return ""

    def _load(self, name: str, grows: bool = False) -> str:
        if name not in [stored.name for stored in stored_maps()]:
            return f"there is no map {name!r}; `diffbotctl map list` shows them"
        try:
            saved = load_map(map_path(name))
        except RunError as error:
            problem = error.problems[0]
            return f"{problem.place}: {problem.cause}; {problem.fix}"
        self._begin(saved, grows)
        self.not_loaded = ""
        self.number += 1
        return ""

    def _update(self) -> MapUpdate:
        tiles = self._tiles()
        cause = self.not_loaded or self.not_saved
        if self.correction is None:
            return MapUpdate(
                self.time,
                "searching" if self.facts["load"] else "starting",
                map=self.number,
                request=self.request,
                refusal=self.refusal,
                cause=cause,
                resolution=self.mapper.resolution,
            )
        c = self.correction
        x, y, heading = c.transform.tolist()
        p = c.covariance
        upper = (p[0, 0], p[0, 1], p[0, 2], p[1, 1], p[1, 2], p[2, 2])
        return MapUpdate(
            time=self.time,
            state=c.state.value,
            x=x,
            y=y,
            heading=heading,
            covariance=tuple(float(each) for each in upper),  # type: ignore[arg-type]
            candidates=tuple(c.places.ravel().tolist()),
            map=self.number,
            version=c.version,
            sha256="" if self.changed else tiles_sha256(self.sent),
            resolution=self.mapper.resolution,
            places=tuple(number for place, _ in tiles for number in place),
            tiles=tuple(text for _, text in tiles),
            request=self.request,
            refusal=self.refusal,
            cause=cause or CAUSES.get(c.state, ""),
        )

    def _tiles(self) -> list[tuple[Place, str]]:
        """The next of the tiles that have changed."""
        if not self.changed and self.time >= self.tiles_due:
            self.tiles_due = self.time + TILES_PERIOD
            self._compare(self.mapper.grid())
        sent: list[tuple[Place, str]] = []
        size = 0
        for place in sorted(self.changed):
            size += len(self.changed[place])
            if len(sent) >= TILES_MAX or size > TILE_BYTES_MAX:
                break
            sent.append((place, self.changed[place]))
        for place, text in sent:
            self.sent[place] = text
            del self.changed[place]
        return sent

    def _compare(self, grid: OccupancyGrid) -> None:
        """Find the tiles that differ from those that were sent."""
        if grid is self.compared:
            return
        self.compared = grid
        for place, text in grid_tiles(grid).items():
            if self.sent.get(place, EMPTY_TILE) != text:
                self.changed[place] = text


def grid_tiles(grid: OccupancyGrid) -> dict[Place, str]:
    cells = grid.cells
    letters = np.full(cells.shape, ord(UNKNOWN), np.uint8)
    letters[grid.is_free] = ord(FREE)
    letters[grid.is_occupied] = ord(OCCUPIED)
    column, row = (round(each / grid.resolution) for each in grid.origin)
    rows, columns = cells.shape
    low, left = row % TILE, column % TILE
    height, width = -(-(low + rows) // TILE), -(-(left + columns) // TILE)
    padded = np.full((height * TILE, width * TILE), ord(UNKNOWN), np.uint8)
    padded[low : low + rows, left : left + columns] = letters
    parts = padded.reshape(height, TILE, width, TILE).swapaxes(1, 2)
    known = (parts != ord(UNKNOWN)).any((2, 3))
    return {
        (column // TILE + j, row // TILE + i): encode_tile(parts[i, j].tobytes().decode())
        for i, j in np.argwhere(known).tolist()
    }


def mapped_scan(number: int, points: ScanPoints) -> MappedScan:
    xx, xy, xh, yy, yh, hh = points.covariance
    covariance: Array = np.array([[xx, xy, xh], [xy, yy, yh], [xh, yh, hh]])
    return MappedScan(
        number,
        points.time / SECOND,
        np.array(points.points, float).reshape(-1, 2),
        points.origin,
        np.array([points.x, points.y, points.heading]),
        covariance,
        np.array(points.clear, float).reshape(-1, 2),
    )


def serve(channel: socket.socket, facts: dict[str, Any]) -> int:
    """Answer packets until the engine closes the channel."""
    try:
        session = MapSession(facts)
        while data := channel.recv(PACKET_MAX_BYTES):
            port, values = pickle.loads(data)
            update = (
                session.scan(ScanPoints(*values))
                if port == "scan"
                else session.ask(MapRequest(*values))
            )
            channel.send(pickle.dumps(("update", tuple(update))))
        session.autosave()
    except OSError:  # the engine has ended
        session.autosave()
    except Exception as error:
        with suppress(OSError):
            channel.send(pickle.dumps(("failed", f"{type(error).__name__}: {error}"[:300])))
        return 1
    return 0


if __name__ == "__main__":
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    sys.exit(serve(socket.socket(fileno=int(sys.argv[1])), json.loads(sys.argv[2])))
