"""The state of all blocks and wires between two instants, as bytes; and back.

A recording may come from anywhere, so reading a state must not be a way to run a program: only the
plain classes of blocks and messages are brought back, nothing that touches a file or a process.
"""

from __future__ import annotations

import io
import pickle
from typing import Any

from diffbotctl.graph import Compiled, Graph

# Modules whose classes hold nothing but numbers, texts and one another.
PLAIN = ("diffbotctl.blocks.", "diffbotctl.messages", "diffbotctl.config.robot",
         "diffbotctl.params", "diffbotctl.engine.gate")  # fmt: skip
COLLECTIONS = {("collections", "deque"), ("builtins", "set"), ("builtins", "frozenset")}


class StateError(ValueError):
    """The state cannot be taken or brought back; the text says why."""


def take(graph: Graph, compiled: Compiled) -> bytes:
    """The state after the last instant. Raises StateError when a block holds what has no bytes."""
    blocks = {node.name: vars(node.block) for node in graph.nodes}
    try:
        # In one piece: what blocks and wires share stays shared.
        return pickle.dumps((blocks, compiled.state()), pickle.HIGHEST_PROTOCOL)
    except Exception as error:  # a block of somebody else's may hold anything
        raise StateError(str(error)) from error


def restore(data: bytes, graph: Graph, compiled: Compiled) -> None:
    """Bring back a state taken from an equal graph. Raises StateError when it does not fit."""
    try:
        blocks, wires = _Plain(io.BytesIO(data)).load()
        for node in graph.nodes:
            vars(node.block).update(blocks[node.name])
        compiled.restore(wires)
    except StateError:
        raise
    except Exception as error:  # a damaged state fails in any way
        raise StateError(f"it does not fit this pipeline ({type(error).__name__})") from error


class _Plain(pickle.Unpickler):
    def find_class(self, module: str, name: str) -> Any:
        if (module, name) in COLLECTIONS:
            return super().find_class(module, name)
        if module.startswith(PLAIN):
            found = super().find_class(module, name)
            if isinstance(found, type) and found.__module__ == module:
                return found
        raise StateError(f"it holds a {module}.{name}, which is not brought back")
