"""What a job at a board tells while it runs; others draw it."""

from __future__ import annotations

from typing import NamedTuple


class FlashMessage(NamedTuple):
    """A line for the person who waits."""

    text: str


class FlashProgress(NamedTuple):
    """How far a job is."""

    what: str  # `writing`, `verifying`, `reading`
    done: int  # bytes
    total: int  # bytes


Event = FlashProgress | FlashMessage
