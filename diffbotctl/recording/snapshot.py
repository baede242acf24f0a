"""The state of all blocks and wires between two instants, as bytes; and back.

A recording may come from anywhere, so reading a state must not be a way to run a program: only the
plain classes of blocks and messages are brought back, nothing that touches a file or a process.
"""

from __future__ import annotations

import io
import pickle
from typing import Any

from diffbotctl.block import Block
from diffbotctl.engine.loop import Engine
from diffbotctl.log import Logbook
from diffbotctl.recording import snapshot_0_1

# Modules whose classes hold nothing but numbers, texts and one another.
PLAIN = (
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
    """The state cannot be taken or brought back; the text says why."""


def take_snapshot(engine: Engine) -> bytes:
    """The state after the last instant. Raises StateError when a block holds what has no bytes."""
    blocks = {node.name: _own(vars(node.block)) for node in engine.graph.nodes}
    told = None if engine.event_logger is None else engine.event_logger.state()
    try:
        # In one piece: what blocks and wires share stays shared.
        state = (blocks, engine.compiled.state(), _said(engine.graph.book), told)
        return pickle.dumps(state, pickle.HIGHEST_PROTOCOL)
    except Exception as error:  # a block of somebody else's may hold anything
        raise StateError(str(error)) from error


def restore_snapshot(data: bytes, engine: Engine) -> None:
    """Bring back a state taken from an engine with an equal graph.

    Raises StateError when it does not fit.
    """
    try:
        blocks, wires, said, told = _Plain(io.BytesIO(data)).load()
        for node in engine.graph.nodes:
            vars(node.block).update(_attributes(node.block, blocks[node.name]))
        engine.compiled.restore(wires)
        if engine.graph.book is not None and said is not None:
            _say_on(engine.graph.book, *said)
        if engine.event_logger is not None and told is not None:
            engine.event_logger.restore(told)
    except StateError:
        raise
    except Exception as error:  # a damaged state fails in any way
        raise StateError(f"it does not fit this pipeline ({type(error).__name__})") from error


def _attributes(block: Block, state: dict[str, Any]) -> dict[str, Any]:
    """What a state holds of a block, by the present names."""
    own = _own(state)
    if own.keys() <= vars(block).keys():
        return own
    return snapshot_0_1.present_attributes(type(block), own)


def _own(state: dict[str, Any]) -> dict[str, Any]:
    """What belongs to a block itself: its voice belongs to the book of its graph."""
    return {name: value for name, value in state.items() if name != "log"}


def _said(book: Logbook | None) -> tuple[dict[str, int], dict[str, tuple[int, int]]] | None:
    """Which lines are wanted of each source, and how many it has said; on these the log hangs."""
    if book is None:
        return None
    return {source: log.threshold for source, log in book.logs.items()}, book.line_counts


def _say_on(book: Logbook, thresholds: dict[str, int], said: dict[str, tuple[int, int]]) -> None:
    for source, threshold in thresholds.items():
        book.source_log(source).set_threshold(threshold)
    book.line_counts.update(said)


class _Plain(pickle.Unpickler):
    def find_class(self, module: str, name: str) -> Any:
        if (module, name) in COLLECTIONS:
            return super().find_class(module, name)
        former = (module.removeprefix("diffbotctl."), name)
        is_former = former in snapshot_0_1.CLASSES
        if is_former:
            module, name = snapshot_0_1.CLASSES[former]
            module = f"diffbotctl.{module}"
        if module.startswith(PLAIN):
            kind = super().find_class(module, name)
            if isinstance(kind, type) and kind.__module__ == module:
                return snapshot_0_1.reader_class(kind) if is_former else kind
        raise StateError(f"it holds a {module}.{name}, which is not brought back")
