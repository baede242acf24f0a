"""Saving the state of all blocks and wires between two instants as bytes, and restoring it.

A recording may come from anywhere, so that reading a state must not run a program: only the plain
classes of blocks and messages are restored, nothing that touches a file or a process.
"""

from __future__ import annotations

import io
import pickle
from typing import Any

from diffbotctl.block import Block
from diffbotctl.engine.loop import Engine
from diffbotctl.log import Logbook
from diffbotctl.recording import snapshot_0_1

# Modules whose classes hold only numbers, texts and one another.
PLAIN_MODULES = (
    "diffbotctl.blocks.",
    "diffbotctl.control.",
    "diffbotctl.estimation.",
    "diffbotctl.geometry.",
    "diffbotctl.messages",
    "diffbotctl.config.robot",
    "diffbotctl.params",
    "diffbotctl.engine.safety_gate",
)
COLLECTIONS = {("collections", "deque"), ("builtins", "set"), ("builtins", "frozenset")}


class StateError(ValueError):
    """The state cannot be saved or restored, for the reason in the text."""


def take_snapshot(engine: Engine) -> bytes:
    """The state after the last instant. Raises StateError when a block cannot be pickled."""
    blocks = {node.name: _without_log(vars(node.block)) for node in engine.graph.nodes}
    events = None if engine.event_logger is None else engine.event_logger.state()
    try:
        # In one piece, so that objects shared by blocks and wires stay shared.
        state = (blocks, engine.compiled.state(), _log_state(engine.graph.book), events)
        return pickle.dumps(state, pickle.HIGHEST_PROTOCOL)
    except Exception as error:  # a block of a user may hold anything
        raise StateError(str(error)) from error


def restore_snapshot(data: bytes, engine: Engine) -> None:
    """Restore a state saved from an engine with an equal graph.

    Raises StateError when it does not fit.
    """
    try:
        blocks, wires, log_state, events = _PlainUnpickler(io.BytesIO(data)).load()
        for node in engine.graph.nodes:
            vars(node.block).update(_attributes(node.block, blocks[node.name]))
        engine.compiled.restore(wires)
        if engine.graph.book is not None and log_state is not None:
            _restore_log(engine.graph.book, *log_state)
        if engine.event_logger is not None and events is not None:
            engine.event_logger.restore(events)
    except StateError:
        raise
    except Exception as error:  # a damaged state can raise anything
        raise StateError(f"it does not fit this pipeline ({type(error).__name__})") from error


def _attributes(block: Block, state: dict[str, Any]) -> dict[str, Any]:
    """The attributes of a block in a saved state, by their present names."""
    attributes = _without_log(state)
    if attributes.keys() <= vars(block).keys():
        return attributes
    return snapshot_0_1.present_attributes(type(block), attributes)


def _without_log(state: dict[str, Any]) -> dict[str, Any]:
    """The attributes of a block without its Log, which belongs to the graph's Logbook."""
    return {name: value for name, value in state.items() if name != "log"}


def _log_state(book: Logbook | None) -> tuple[dict[str, int], dict[str, tuple[int, int]]] | None:
    """The threshold of each source, and how many lines it has logged: both affect later lines."""
    if book is None:
        return None
    return {source: log.threshold for source, log in book.logs.items()}, book.line_counts


def _restore_log(
    book: Logbook, thresholds: dict[str, int], counts: dict[str, tuple[int, int]]
) -> None:
    for source, threshold in thresholds.items():
        book.source_log(source).set_threshold(threshold)
    book.line_counts.update(counts)


class _PlainUnpickler(pickle.Unpickler):
    def find_class(self, module: str, name: str) -> Any:
        if (module, name) in COLLECTIONS:
            return super().find_class(module, name)
        former = (module.removeprefix("diffbotctl."), name)
        is_former = former in snapshot_0_1.CLASSES
        if is_former:
            module, name = snapshot_0_1.CLASSES[former]
            module = f"diffbotctl.{module}"
        if module.startswith(PLAIN_MODULES):
            kind = super().find_class(module, name)
            if isinstance(kind, type) and kind.__module__ == module:
                return snapshot_0_1.reader_class(kind) if is_former else kind
        raise StateError(f"it holds a {module}.{name}, which is not restored")
