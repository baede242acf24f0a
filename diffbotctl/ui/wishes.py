"""What the command line asks of a full-screen program."""

from __future__ import annotations

from typing import NamedTuple


class Wishes(NamedTuple):
    """Keys and mode of the hand, pictures a second, speeds to begin with, letters only."""

    keys: str = "twist"
    mode: str = "hold"
    hz: float = 10.0
    speed: float | None = None  # m/s
    turn: float | None = None  # rad/s
    ascii_only: bool = False
