"""Where requests are answered: the run that a hub stands before, and what is known of it."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from typing import Any, NamedTuple

from diffbotctl.control_socket.connection import Client
from diffbotctl.control_socket.protocol import RefusalError, Request
from diffbotctl.control_socket.run_state import RunInfo, RunState
from diffbotctl.errors import closest_match


class CommandDraft(NamedTuple):
    """A command for the engine, before it has a number."""

    verb: str
    values: tuple[Any, ...] = ()


Fields = dict[str, Any]


class RequestContext:
    """What every verb is handed: the run, what is known of it, and a word to the engine."""

    def __init__(self, about: RunInfo, knowledge: RunState, whisper: Callable[[str], None]) -> None:
        self.about = about
        self.knowledge = knowledge
        self.whisper = whisper
        self.blocks = {node.name: node.block for node in about.graph.nodes}
        self.heard = {wire for node in about.graph.nodes for wire in node.wires.values()}

    def needs(self, wire: str, cause: str) -> None:
        """Refuse what no block of this pipeline would hear."""
        if wire not in self.heard:
            raise RefusalError("E-REQUEST", cause, f"wire {wire} to a block that takes it")

    def within(self, name: str, value: float, limit: float | None, unit: str) -> None:
        """Refuse what is beyond the robot's limit."""
        if limit is not None and abs(value) > limit:
            cause = f"{name} {value:g} {unit} is beyond this robot's limit of {limit:g} {unit}"
            raise RefusalError("E-REQUEST", cause, "ask for less")


def nearest_of(name: str, names: Iterable[str]) -> str:
    """The way out for a name that does not exist."""
    names = list(names)
    near = closest_match(name, names)
    return f"did you mean {near}?" if near else f"there is {', '.join(names) or 'none'}"


Verb = Callable[[RequestContext, Client, Request], Fields | CommandDraft]
