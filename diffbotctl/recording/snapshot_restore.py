"""Restoring the state of all blocks and wires from the bytes of a snapshot.

A recording may come from anywhere, so that reading a state must not run a program: only the plain
classes of blocks and messages are restored, nothing that touches a file or a process.
"""

from __future__ import annotations

import io
import pickle
from collections.abc import Iterable
from enum import Enum
from typing import Any

from diffbotctl.block import Block
from diffbotctl.engine.loop import Engine
from diffbotctl.log import Logbook
from diffbotctl.message_types import records_in
from diffbotctl.messages import fields
from diffbotctl.recording import snapshot_0_1
from diffbotctl.recording.snapshot import StateError, without_log

# Modules whose classes hold only numbers, texts and one another.
PLAIN_MODULES = (
    "diffbotctl.blocks.",
    "diffbotctl.control.",
    "diffbotctl.estimation.",
    "diffbotctl.geometry.",
    "diffbotctl.messages",
    "diffbotctl.config.robot",
    "diffbotctl.params",
    "diffbotctl.engine.overspeed",
    "diffbotctl.engine.safety_gate",
)
COLLECTIONS = {("collections", "deque"), ("builtins", "set"), ("builtins", "frozenset")}


def restore_snapshot(data: bytes, engine: Engine) -> None:
    """Restore a state saved from an engine with an equal graph.

    Raises StateError when it does not fit.
    """
    try:
        messages = _message_classes(engine.graph.kinds.values())
        blocks, wires, log_state, events = _PlainUnpickler(io.BytesIO(data), messages).load()
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
    attributes = without_log(state)
    if attributes.keys() <= vars(block).keys():
        return attributes
    return snapshot_0_1.present_attributes(type(block), attributes)


def _restore_log(
    book: Logbook, thresholds: dict[str, int], counts: dict[str, tuple[int, int]]
) -> None:
    for source, threshold in thresholds.items():
        book.source_log(source).set_threshold(threshold)
    book.line_counts.update(counts)


def _message_classes(kinds: Iterable[type]) -> dict[tuple[str, str], type]:
    """The message classes of the pipeline and those of their fields, by module and name."""
    classes: dict[tuple[str, str], type] = {}
    waiting = list(kinds)
    while waiting:
        kind = waiting.pop()
        if (kind.__module__, kind.__qualname__) not in classes:
            classes[kind.__module__, kind.__qualname__] = kind
            waiting += [part for hint, _ in fields(kind).values() for part in records_in(hint)]
    return classes


class _PlainUnpickler(pickle.Unpickler):
    """Restores only plain classes, and the message classes of the pipeline."""

    def __init__(self, file: io.BytesIO, messages: dict[tuple[str, str], type]) -> None:
        super().__init__(file)
        self.messages = messages

    def find_class(self, module: str, name: str) -> Any:
        if (module, name) == ("builtins", "getattr"):
            return _enum_member
        if (module, name) in COLLECTIONS:
            return super().find_class(module, name)
        if (module, name) in self.messages:
            return self.messages[module, name]
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


def _enum_member(kind: Any, name: str) -> Enum:
    """A member of an enumeration. Python before 3.11.4 saves it as the call of `getattr`."""
    if isinstance(kind, type) and issubclass(kind, Enum):
        return kind[name]
    raise StateError(f"it holds an attribute of {kind!r}, which is not restored")
