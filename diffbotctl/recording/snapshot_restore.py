"""Restoring the state of all blocks and wires from a recording.

A recording may come from anywhere, so that reading a state must not run a program: only the plain
classes of blocks and messages are restored, nothing that touches a file or a process.
"""

from __future__ import annotations

from collections.abc import Iterable
from importlib import import_module
from typing import Any

from diffbotctl.engine.loop import Engine
from diffbotctl.log import Logbook
from diffbotctl.message_types import records_in
from diffbotctl.messages import fields
from diffbotctl.recording.snapshot import StateError, without_log
from diffbotctl.recording.snapshot_json import FindClass, from_json

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
    "diffbotctl.engine.wheel_direction",
)


def restore_snapshot(data: bytes, time: int, engine: Engine) -> None:
    """Restore the state after the instant `time` (ns), saved from an engine with an equal graph.

    `data` is its JSON form. Raises StateError when it does not fit.
    """
    state = from_json(data, plain_classes(engine.graph.kinds.values()))
    try:
        blocks, wires, log_state, events = state
        for node in engine.graph.nodes:
            vars(node.block).update(without_log(blocks[node.name]))
        engine.compiled.restore(wires)
        if engine.graph.book is not None and log_state is not None:
            _restore_log(engine.graph.book, *log_state)
        if engine.event_logger is not None and events is not None:
            engine.event_logger.restore(events)
        is_due_later = engine.compiled.due() > time
    except Exception as error:  # a damaged state can raise anything
        raise StateError(f"it does not fit this pipeline ({type(error).__name__})") from error
    if not is_due_later:
        raise StateError("a timer is due before it")


def _restore_log(
    book: Logbook, thresholds: dict[str, int], counts: dict[str, tuple[int, int]]
) -> None:
    for source, threshold in thresholds.items():
        book.source_log(source).set_threshold(threshold)
    book.line_counts.update(counts)


def plain_classes(kinds: Iterable[type]) -> FindClass:
    """What finds the plain classes, and the message classes of the pipeline, which are `kinds`."""
    messages = _message_classes(kinds)

    def find_class(module: str, name: str) -> type:
        if (module, name) in messages:
            return messages[module, name]
        if module.startswith(PLAIN_MODULES):
            kind: Any = getattr(import_module(module), name)
            if isinstance(kind, type) and kind.__module__ == module:
                return kind
        raise StateError(f"it holds a {module[:80]}.{name[:80]}, which is not restored")

    return find_class


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
