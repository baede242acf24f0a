"""A map in a file: one zip archive of arrays (numpy's npz), in which nothing is executable."""

from __future__ import annotations

import io
import zipfile
import zlib
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import IO, Any

import numpy as np
from numpy.typing import NDArray

from diffbotctl.errors import Problem, RunError
from diffbotctl.file_replacement import replace_file
from diffbotctl.mapping.lidar_scan import MappedScan
from diffbotctl.mapping.match_field import CELL
from diffbotctl.mapping.occupancy_grid import (
    CELLS_MAX,
    RESOLUTION_MAX,
    RESOLUTION_MIN,
    OccupancyGrid,
)
from diffbotctl.mapping.scan_map import Map

FORMAT = 1
BAD_ARCHIVE = (
    *(ValueError, KeyError, IndexError, EOFError, OSError, RuntimeError, MemoryError),
    *(zipfile.BadZipFile, zlib.error, SyntaxError),
)
SIZE_MAX = 500_000_000  # bytes, of all arrays together
SCANS_MAX = 100_000
LENGTH_MAX = 1e5  # m; a coordinate beyond it is no place of a robot
Arrays = Mapping[str, NDArray[np.float64]]


def map_bytes(scan_map: Map) -> bytes:
    """The content of a map file; the same map gives the same bytes."""
    scans, grid = scan_map.scans, scan_map.imported
    arrays: dict[str, list[NDArray[Any]]] = {
        "format": [np.array([FORMAT])],
        "resolution": [np.array([scan_map.resolution])],
        "poses": [scan_map.poses],
        "numbers": [np.array([scan.number for scan in scans], float)],
        "times": [np.array([scan.time for scan in scans], float)],
        "origins": [np.array([scan.origin for scan in scans]).reshape(-1, 2)],
        "odometry": [np.array([scan.odometry for scan in scans]).reshape(-1, 3)],
        "covariances": [np.array([scan.covariance for scan in scans]).reshape(-1, 3, 3)],
        "point_counts": [np.array([len(scan.points) for scan in scans], float)],
        "clear_counts": [np.array([len(scan.clear) for scan in scans], float)],
        "points": [np.zeros((0, 2), np.float32), *(scan.points for scan in scans)],
        "clear": [np.zeros((0, 2), np.float32), *(scan.clear for scan in scans)],
    }
    if grid is not None:
        arrays |= {"cells": [grid.cells], "corner": [np.array(grid.origin)]}
    buffer = io.BytesIO()
    with zipfile.ZipFile(buffer, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, parts in arrays.items():
            with archive.open(f"{name}.npy", "w") as member:
                _write(member, parts)
    return buffer.getvalue()


def _write(stream: IO[bytes], parts: Sequence[NDArray[Any]]) -> None:
    """One array of all `parts`; written one by one, since a copy of all takes much memory."""
    kind, shape = parts[0].dtype, (sum(map(len, parts)), *parts[0].shape[1:])
    header = {"descr": kind.str, "fortran_order": False, "shape": shape}
    np.lib.format.write_array_header_1_0(stream, header)
    for part in parts:
        stream.write(part.astype(kind).tobytes())


def map_of_bytes(content: bytes, name: str) -> Map:
    """The map in `content`, the bytes of the file `name`.

    Raises RunError with place, cause and fix when it is no whole map file.
    """
    try:
        return _map_of_arrays(_arrays(content))
    except BAD_ARCHIVE as error:
        raise RunError([_problem(name, error)]) from error


def save_map(scan_map: Map, path: Path) -> None:
    """Write the map; a file of this name keeps its content until all is written."""
    replace_file(path, map_bytes(scan_map))


def load_map(path: Path) -> Map:
    """The map of a file that `save_map` wrote. Raises RunError, with place, cause and fix."""
    try:
        size = path.stat().st_size
        if size > SIZE_MAX:
            raise ValueError(f"it has {size / 1e6:.0f} MB, maps have at most {SIZE_MAX / 1e6:.0f}")
        content = path.read_bytes()
    except (OSError, ValueError) as error:
        raise RunError([_problem(str(path), error)]) from error
    return map_of_bytes(content, str(path))


def _problem(name: str, error: Exception) -> Problem:
    cause = error.strerror if isinstance(error, OSError) and error.strerror else str(error)
    return Problem(
        "E-MAP-FILE",
        name,
        f"this is no whole map file: {cause}",
        "load another map, or drive and save the map again",
    )


def _arrays(content: bytes) -> Arrays:
    with zipfile.ZipFile(io.BytesIO(content)) as archive:
        size = sum(entry.file_size for entry in archive.infolist())
    if size > SIZE_MAX:
        raise ValueError(f"its arrays have {size / 1e6:.0f} MB, at most {SIZE_MAX / 1e6:.0f} fit")
    with np.load(io.BytesIO(content), allow_pickle=False) as archive:
        arrays = {name: archive[name] for name in archive.files}
    for name, array in arrays.items():
        if array.dtype.kind not in "fiu" or not np.isfinite(array).all():
            raise ValueError(f"{name} are no finite numbers")
        if array.size and name not in ("times", "numbers") and np.abs(array).max() > LENGTH_MAX:
            raise ValueError(f"{name} are beyond {LENGTH_MAX:g}")
    return arrays


def _map_of_arrays(arrays: Arrays) -> Map:
    if arrays["format"].tolist() != [FORMAT]:
        raise ValueError(f"its format is {arrays['format'].tolist()}, this program reads {FORMAT}")
    count = len(arrays["poses"])
    resolution = float(arrays["resolution"][0])
    if count > SCANS_MAX or not RESOLUTION_MIN <= resolution <= RESOLUTION_MAX:
        raise ValueError(f"{count} scans at a resolution of {resolution:g} m")
    if "cells" in arrays:
        return Map(resolution, (), np.zeros((0, 3)), _imported(arrays, resolution))
    for name, shape in (("poses", (3,)), ("odometry", (3,)), ("covariances", (3, 3))):
        arrays[name].reshape(count, *shape)
    _check_extent(arrays, resolution)
    points = _parts(arrays["points"], arrays["point_counts"], count)
    clear = _parts(arrays["clear"], arrays["clear_counts"], count)
    origins = arrays["origins"].reshape(count, 2).tolist()
    scans = tuple(
        MappedScan(
            int(arrays["numbers"][i]),
            float(arrays["times"][i]),
            points[i],
            (origins[i][0], origins[i][1]),
            arrays["odometry"][i].astype(float),
            arrays["covariances"][i].astype(float),
            clear[i],
        )
        for i in range(count)
    )
    return Map(resolution, scans, arrays["poses"].astype(float))


def _check_extent(arrays: Arrays, resolution: float) -> None:
    """Raises ValueError for a map whose grid would be too large to hold."""
    if not len(arrays["poses"]):
        return
    reach = max(np.hypot(*arrays[name].T).max(initial=0.0) for name in ("points", "clear"))
    width, depth = (np.ptp(arrays["poses"][:, :2], axis=0) + 2 * reach).tolist()
    check_extent(width, depth, resolution)


def _imported(arrays: Arrays, resolution: float) -> OccupancyGrid:
    cells, (x, y) = arrays["cells"], arrays["corner"].tolist()
    rows, columns = cells.shape
    if not cells.size or cells.dtype != np.int8 or cells.min() < -1 or cells.max() > 100:
        raise ValueError("its cells are not -1 to 100")
    check_extent(columns * resolution, rows * resolution, resolution)
    return OccupancyGrid(resolution, (x, y), cells.astype(np.int8))


def check_extent(width: float, depth: float, resolution: float) -> None:
    """Raises ValueError for a map of `width` x `depth` m whose rasters would be too large."""
    cell = min(resolution, CELL)
    if width * depth > CELLS_MAX * cell**2:
        raise ValueError(
            f"it spans {width:.0f} m x {depth:.0f} m, more than {CELLS_MAX:,} cells of {cell:g} m"
        )


def _parts(
    rows: NDArray[np.float64], counts: NDArray[np.float64], count: int
) -> list[NDArray[np.float32]]:
    ends = np.cumsum(counts.astype(np.int64))
    if len(counts) != count or (counts < 0).any() or rows.shape != (ends[-1] if count else 0, 2):
        raise ValueError("the numbers of points of its scans do not add up")
    return np.split(rows.astype(np.float32), ends[:-1])
