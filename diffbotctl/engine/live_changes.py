"""Changes to running blocks by the operator: live parameters and actions.

Both arrive as recorded messages of `operator` and take effect at the end of their instant, in a
live run and in its replay.
"""

from __future__ import annotations

from contextlib import redirect_stdout
from typing import Any, NamedTuple

from diffbotctl.block import action_arguments, takes_text
from diffbotctl.graph import Graph, Sink
from diffbotctl.log import LEVEL, QUIET, LogFile
from diffbotctl.messages import Call, Setting
from diffbotctl.params import declared


class ChangeError(Exception):
    """The block with the name `block` raised when a parameter changed, or in an action."""

    def __init__(self, block: str) -> None:
        super().__init__(block)
        self.block = block


class CallOutcome(NamedTuple):
    """What came of a call: why the block refused it, or what the action returned."""

    refusal: str
    value: Any = None


class LiveChanges:
    """Applies Settings and Calls to the blocks of `graph`, and to `drivers` by node name.

    A call to a driver that does not exist, as in a replay, is ignored: its effects were recorded.
    `outcomes` gets one entry for each call.
    """

    def __init__(self, graph: Graph, drivers: dict[str, Any]) -> None:
        self.targets: dict[str, Any] = {node.name: node.block for node in graph.nodes}
        self.targets.update(drivers)
        self.book = graph.book
        self.outcomes: list[CallOutcome] = []

    def sinks(self) -> dict[str, Sink]:
        return {"operator.setting": self.set, "operator.call": self.call}

    def set(self, now: int, change: Setting) -> None:
        """Set a parameter of a block, or the log level of a source."""
        if change.name == LEVEL:
            if self.book is not None and change.text is not None:
                self.book.set_level(change.block, change.text)
            return
        block = self.targets[change.block]
        kind = declared(type(block))[change.name].kind
        value: Any = change.text
        if change.number is not None:
            value = kind(change.number)
        setattr(block, change.name, value)
        try:
            with redirect_stdout(LogFile(block.log)):
                block.changed(change.name)
        except Exception as error:
            raise ChangeError(change.block) from error

    def call(self, now: int, call: Call) -> None:
        """Call an action. An action refuses by raising ValueError before it changes anything."""
        target = self.targets.get(call.block)
        if target is None:
            return
        numbers, texts = iter(call.arguments), iter(call.texts)
        arguments: dict[str, Any] = {}
        for argument in action_arguments(getattr(type(target), call.action)):
            value = next(texts if takes_text(argument) else numbers, None)
            if value is not None:  # otherwise its default
                arguments[argument.name] = value
        try:
            with redirect_stdout(LogFile(getattr(target, "log", QUIET))):
                value = getattr(target, call.action)(now, **arguments)
        except ValueError as error:
            self.outcomes.append(CallOutcome(str(error) or "it refuses"))
        except Exception as error:
            raise ChangeError(call.block) from error
        else:
            self.outcomes.append(CallOutcome("", value))


def live_sinks(graph: Graph) -> dict[str, Sink]:
    """The function to call for each wire with changes, of a graph without drivers."""
    parts = graph.parts or {"": graph}
    return {
        f"{name}.{wire}" if name else wire: sink
        for name, part in parts.items()
        for wire, sink in LiveChanges(part, {}).sinks().items()
    }
