"""The grid of a map as picture and description of ROS's map_server: NAME.pgm and NAME.yaml.

Rules: wiki.ros.org/map_server. A picture's row 0 is the top, dark is occupied.
"""

from __future__ import annotations

import re
from errno import EINVAL
from pathlib import Path
from typing import IO, Any

import numpy as np
import yaml
from numpy.typing import NDArray

from diffbotctl.errors import Problem, RunError
from diffbotctl.mapping.map_file import LENGTH_MAX, check_extent
from diffbotctl.mapping.occupancy_grid import (
    CELLS_MAX,
    FREE,
    OCCUPIED,
    RESOLUTION_MAX,
    RESOLUTION_MIN,
    OccupancyGrid,
)

DESCRIPTION_MAX, HEADER_MAX = 10_000, 4096  # bytes
GREY_OCCUPIED, GREY_FREE, GREY_UNKNOWN = 0, 254, 205
HEADER = re.compile(rb"P5" + 3 * rb"(?:\s|#[^\n]*\n)+(\d+)" + rb"\s")
UNREADABLE = (LookupError, ArithmeticError, ValueError, TypeError, yaml.YAMLError)


def save_picture(grid: OccupancyGrid, path: Path) -> None:
    """Write `path` (NAME.yaml) and NAME.pgm beside it: black occupied, white free, grey unknown."""
    grey = np.full(grid.cells.shape, GREY_UNKNOWN, np.uint8)
    grey[grid.is_occupied] = GREY_OCCUPIED
    grey[grid.is_free] = GREY_FREE
    rows, columns = len(grey), grey.size // max(1, len(grey))
    picture = path.with_suffix(".pgm")
    picture.write_bytes(f"P5\n{columns} {rows}\n255\n".encode() + np.flipud(grey).tobytes())
    x, y = grid.origin
    path.write_text(
        f"image: {picture.name}\nmode: trinary\nresolution: {grid.resolution:.6g}\n"
        f"origin: [{x:.6g}, {y:.6g}, 0]\nnegate: 0\n"
        f"occupied_thresh: {OCCUPIED}\nfree_thresh: {FREE}\n"
    )


def load_picture(path: Path) -> OccupancyGrid:
    """The grid of a yaml file and its pgm, of map_server or `save_picture`.

    Raises RunError, with place, cause and fix.
    """
    picture = path
    try:
        with _open(path) as file:
            text = yaml.safe_load(file.read(DESCRIPTION_MAX))
        if not (isinstance(text, dict) and isinstance(text["image"], str)):  # aliases may be huge
            raise ValueError("it is no table of keys, or its image is no name of a file")
        picture = path.parent / text["image"]
        with _open(picture) as content:
            return _grid(text, _greys(content))
    except OSError as error:
        raise RunError([_problem(path, f"{picture}: {error.strerror}")]) from error
    except RecursionError as error:
        raise RunError([_problem(path, "it is nested too deeply")]) from error
    except UNREADABLE as error:
        cause = f"{error.args[0]} is missing" if isinstance(error, KeyError) else str(error)
        raise RunError([_problem(path, cause)]) from error


def _open(path: Path) -> IO[bytes]:
    if path.exists() and not path.is_file():  # a pipe would keep its reader waiting
        raise OSError(EINVAL, "this is a device, a pipe or a directory, not a file")
    return path.open("rb")


def _problem(path: Path, cause: str) -> Problem:
    cause, _, fix = cause.partition("; ")
    keys = "state image (binary pgm), resolution, origin, negate, occupied_thresh and free_thresh"
    return Problem("E-MAP-IMAGE", str(path), f"this map cannot be read: {cause}", fix or keys)


def _greys(content: IO[bytes]) -> NDArray[np.uint8]:
    """Reads no more than a header before it knows the size."""
    header = HEADER.match(content.read(HEADER_MAX))
    if header is None:
        raise ValueError("the picture is no binary pgm (P5)")
    columns, rows, highest = map(int, header.groups())
    if not 0 < highest <= 255:
        raise ValueError(f"its highest grey is {highest}; save the picture with 8 bits a cell")
    if not 0 < columns * rows <= CELLS_MAX:
        raise ValueError(
            f"the picture has {columns} x {rows} cells, of {CELLS_MAX:,} that fit; "
            "cut off its margins, or scale it down and raise resolution"
        )
    content.seek(header.end())
    body = content.read(columns * rows)
    if len(body) < columns * rows:
        raise ValueError(f"it has {len(body)} of {columns * rows} bytes; copy the whole file")
    scaled = np.rint(np.minimum(np.arange(256) / highest, 1.0) * 255.0).astype(np.uint8)
    return np.flipud(scaled[np.frombuffer(body, np.uint8).reshape(rows, columns)])


def _grid(text: dict[str, Any], grey: NDArray[np.uint8]) -> OccupancyGrid:
    resolution = float(text["resolution"])
    x, y, turn = (float(each) for each in text["origin"])
    if not (abs(x) + abs(y) < LENGTH_MAX and RESOLUTION_MIN <= resolution <= RESOLUTION_MAX):
        raise ValueError(f"resolution {resolution:g} m, origin {x:g} {y:g}")
    if turn:
        raise ValueError(
            f"its origin is turned by {turn:g} rad, but here cells lie along the axes of the map; "
            "turn the picture by that angle, and state 0"
        )
    cells = _cells_of_greys(text)[grey]
    check_extent(cells.shape[1] * resolution, cells.shape[0] * resolution, resolution)
    grid = OccupancyGrid(resolution, (x, y), cells)
    if not (grid.is_occupied.any() and grid.is_free.any()):
        raise ValueError("no cell is occupied, or none is free; look at negate and the thresholds")
    return grid


def _cells_of_greys(text: dict[str, Any]) -> NDArray[np.int8]:
    """The cell for each of the 256 greys, by map_server's modes trinary, scale and raw."""
    grey = np.arange(256)
    mode = text.get("mode", "trinary")
    if mode == "raw":
        return np.where(grey <= 100, grey, -1).astype(np.int8)
    if mode not in ("trinary", "scale"):
        raise ValueError(f"mode is {mode:.20}, not trinary, scale or raw")
    share = grey / 255.0 if int(text["negate"]) else (255.0 - grey) / 255.0
    high, low = float(text["occupied_thresh"]), float(text["free_thresh"])
    if not 0 <= low < high <= 1:
        raise ValueError(f"free_thresh {low:g} is not below occupied_thresh {high:g}")
    between = -1.0 if mode == "trinary" else np.rint(99 * (share - low) / (high - low))
    return np.where(share > high, 100.0, np.where(share < low, 0.0, between)).astype(np.int8)
