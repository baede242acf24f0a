"""Folders for the files of the program that belong to one user (XDG base directory specification).

As the specification requires, a variable that is not an absolute path is ignored.
"""

from __future__ import annotations

import os
from pathlib import Path

NAME = "diffbotctl"


def state_folder() -> Path:
    """What lasts from run to run, and is no setting."""
    return _named("XDG_STATE_HOME", ".local/state")


def cache_folder() -> Path:
    """What can be made again."""
    return _named("XDG_CACHE_HOME", ".cache")


def _named(variable: str, below_home: str) -> Path:
    named = os.environ.get(variable)
    base = Path(named) if named and Path(named).is_absolute() else Path.home() / below_home
    return base / NAME
