"""The saved maps of the user: their folder, their names, and what a file name stands for."""

from __future__ import annotations

from pathlib import Path
from typing import NamedTuple

from diffbotctl.user_folders import state_folder

SUFFIX = ".npz"


class StoredMap(NamedTuple):
    """A saved map: its name, its size in bytes, and when it was saved (s since 1970)."""

    name: str
    size: int
    time: float


def maps_folder() -> Path:
    """The folder of the saved maps; it may not exist yet."""
    return state_folder() / "maps"


def map_path(name: str) -> Path:
    return maps_folder() / f"{name}{SUFFIX}"


def stored_maps() -> list[StoredMap]:
    files = sorted(maps_folder().glob(f"*{SUFFIX}"))
    stats = [(path, path.stat()) for path in files if not path.name.startswith(".")]
    return [StoredMap(path.stem, stat.st_size, stat.st_mtime) for path, stat in stats]
