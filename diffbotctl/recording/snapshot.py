"""Saving the state of all blocks and wires between two instants.

The engine pickles it, in a third of a millisecond, for its own child process; that one writes it to
files in the JSON form of `snapshot_json`, which `snapshot_restore` reads.
"""

from __future__ import annotations

import pickle
from collections.abc import Callable, Mapping
from typing import Any

from diffbotctl.engine.loop import Engine
from diffbotctl.log import Logbook


class StateError(ValueError):
    """The state cannot be saved or restored, for the reason in the text."""


def take_snapshot(engine: Engine) -> bytes:
    """The pickled state after the last instant. Raises StateError when a block cannot be pickled.

    Only this process and its children unpickle it.
    """
    blocks = {node.name: without_log(vars(node.block)) for node in engine.graph.nodes}
    events = None if engine.event_logger is None else engine.event_logger.state()
    try:
        # In one piece, so that objects shared by blocks and wires stay shared.
        state = (blocks, engine.compiled.state(), _log_state(engine.graph.book), events)
        return pickle.dumps(state, pickle.HIGHEST_PROTOCOL)
    except Exception as error:  # a block of a user may hold anything
        raise StateError(culprit_text(blocks, pickle.dumps) or str(error)) from error


def culprit_text(
    blocks: Mapping[str, Mapping[str, Any]], save: Callable[[Any], object]
) -> str | None:
    """Which attribute of which block `save` cannot save; None when it is none of theirs."""
    for name, attributes in blocks.items():
        for attribute, value in attributes.items():
            try:
                save(value)
            except Exception:
                return f"`self.{attribute}` of block {name} holds more than plain data"
    return None


def without_log(state: dict[str, Any]) -> dict[str, Any]:
    """The attributes of a block without its Log, which belongs to the graph's Logbook."""
    return {name: value for name, value in state.items() if name != "log"}


def _log_state(book: Logbook | None) -> tuple[dict[str, int], dict[str, tuple[int, int]]] | None:
    """The threshold of each source, and how many lines it has logged: both affect later lines."""
    if book is None:
        return None
    return {source: log.threshold for source, log in book.logs.items()}, book.line_counts
