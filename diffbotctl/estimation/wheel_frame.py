"""One frame of the board, as the filter of one wheel takes it."""

from __future__ import annotations

from typing import NamedTuple


class DriveChange(NamedTuple):
    """A command of a wheel and when it took effect; as in a WheelFrame."""

    time: int
    drive: float
    duty: float


class WheelFrame(NamedTuple):
    """One frame of the board, for one wheel."""

    time: int
    """ns"""
    edge_count: int
    edge_time: int | None
    """ns, of the last edge; None for a board that does not report edge times"""
    drive: float
    """pitches/s at which the commanded motor settles"""
    drive_since: int | None
    """ns, when that command took effect, if known"""
    duty: float
    """of that command"""
    skipped: DriveChange | None = None
    """the command before, where no frame showed it"""
    is_mixed: bool = False
    """whether edges of both signs may have been counted, of which pairs cancel"""
    has_counted_level: bool | None = None
    """whether the pin has the level to which a counted edge leads; None: not reported"""
