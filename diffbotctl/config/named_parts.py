"""Pipelines under a name in another pipeline: `include: {path: hello, as: one}`.

Each one is loaded and checked by itself. In the whole, the names of its nodes begin with its own:
the wire `one.talker.text`. `in` of the include remaps an input of one of its blocks, or one of its
declared inputs, to another wire: `in: {listener.text: two.talker.text}`. One that drives a robot
has no name beside others; several robots are in `named_robots`.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TypeVar

from diffbotctl.block import In, inputs, outputs
from diffbotctl.config import lookup, source_tree
from diffbotctl.config.configuration import BlockUse, Configuration, InputUse, ProgramUse, SourceUse
from diffbotctl.config.named_robots import NESTED, LoadOne, NamedInclude, read_include, refuse
from diffbotctl.config.node_ports import NodePorts
from diffbotctl.config.source_tree import NamedIncludesError, Override
from diffbotctl.config.yaml_tree import Value
from diffbotctl.errors import ConfigurationError, Problem, UserError

SHARED_NODES = ("robot", "operator", "engine", "log", "gate")  # of the whole pipeline
INPUTS = "input."
Outside = TypeVar("Outside", ProgramUse, SourceUse)
Loops = Callable[[dict[str, list[str]]], list[list[str]]]


@dataclass(frozen=True)
class NamedPart:
    """One pipeline under a name; `value` is its include."""

    name: str
    value: Value
    configuration: Configuration

    def ports(self) -> NodePorts:
        """Its ports as those of one node: outputs `talker.text`, inputs `listener.text`."""
        whole = self.configuration
        made = {
            f"{use.name}.{port}": out.kind
            for use in whole.blocks
            for port, out in outputs(use.cls).items()
        }
        taken = {
            f"{use.name}.{port}": declared.kind
            for use in whole.blocks
            for port, declared in inputs(use.cls).items()
            if isinstance(declared, In)
        }
        made |= {use.wire: use.kind for use in whole.inputs}
        taken |= {use.wire: use.kind for use in whole.inputs if use.wire.startswith(INPUTS)}
        return NodePorts(made, {port: In(kind, optional=True) for port, kind in taken.items()})

    @property
    def remaps(self) -> dict[str, str]:
        """The wires that its include gives to inputs."""
        remaps = self.value.at("in")
        return {port: entry.text for port, entry in (remaps.entries if remaps else {}).items()}

    def wire(self, wire: str) -> str:
        if wire in self.remaps:
            return self.remaps[wire]
        return wire if wire.partition(".")[0] in SHARED_NODES else f"{self.name}.{wire}"

    def blocks(self) -> Iterator[BlockUse]:
        for use in self.configuration.blocks:
            wires = {port: self.wire(wire) for port, wire in use.wires.items()}
            for port in inputs(use.cls):
                if f"{use.name}.{port}" in self.remaps:
                    wires[port] = self.remaps[f"{use.name}.{port}"]
            yield replace(use, name=f"{self.name}.{use.name}", wires=wires)

    def renamed(self, use: Outside) -> Outside:
        """A program or source of it, named and wired as in the whole."""
        return replace(
            use,
            name=f"{self.name}.{use.name}",
            wires={port: self.wire(wire) for port, wire in use.wires.items()},
            outputs={self.wire(wire): kind for wire, kind in use.outputs.items()},
        )

    def inputs(self, feeds_motion: bool) -> Iterator[InputUse]:
        """Its wires from outside of the graph, without those that are remapped."""
        for use in self.configuration.inputs:
            if use.wire not in self.remaps:
                moves = use.feeds_motion or feeds_motion
                yield replace(use, wire=self.wire(use.wire), feeds_motion=moves)


def has_parts(file: Path, tree: Value) -> bool:
    """Whether the named includes of `tree`, the pipeline `file`, are parts and not robots."""
    include = tree.entries["include"]
    items = include.items or [include]
    return any(not item.entries for item in items) or not any(
        _drives_robot(file, item) for item in items
    )


def _drives_robot(file: Path, value: Value) -> bool:
    """Whether an include is a pipeline with a robot; what cannot be read is reported later."""
    try:
        found = lookup.find_pipeline(read_include(file, value).path)
        return "robot" in source_tree.read_pipeline(found, (), [])[0].entries
    except (UserError, NamedIncludesError):
        return False


def load_parts(
    file: Path, tree: Value, overrides: Sequence[Override], load_one: LoadOne
) -> list[NamedPart]:
    """The parts of the pipeline `file`. Raises ConfigurationError with the problems of all.

    `overrides` that begin with the name of a part are for it.
    """
    include = tree.entries["include"]
    parts: list[NamedPart] = []
    problems: list[Problem] = []
    for value in include.items or [include]:
        if not isinstance(value.data, dict):
            continue
        read = read_include(file, value)
        if read.name in [part.name for part in parts]:
            refuse(value.entries["as"], f"two includes are called '{read.name}'", "rename one")
        try:
            parts.append(_load_part(read, overrides, load_one))
        except ConfigurationError as error:
            problems += error.problems
    if problems:
        raise ConfigurationError(problems)
    return parts


def _load_part(
    include: NamedInclude, overrides: Sequence[Override], load_one: LoadOne
) -> NamedPart:
    own = [
        replace(override, steps=override.steps[1:])
        for override in overrides
        if override.steps[0] == include.name
    ]
    try:
        loaded = load_one(include.path, None, [*include.overrides, *own])
    except NamedIncludesError:
        refuse(include.value, f"{include.path} itself gives names to its includes", NESTED)
    if loaded.robot is not None:
        cause = f"either all includes have a name or none, where one drives a robot: {include.path}"
        refuse(include.value, cause, "include it without `as`, and the others with a name")
    return NamedPart(include.name, include.value, loaded)


def join_parts(
    whole: Configuration, parts: Iterable[NamedPart], moving: Iterable[str], loops: Loops
) -> Configuration:
    """The pipeline with its parts. `moving`: names of those on which the robot's motion depends.

    Raises ConfigurationError for blocks that form a loop.
    """
    parts = list(parts)
    blocks = [*(use for part in parts for use in part.blocks()), *whole.blocks]
    _check_loops(blocks, parts, loops)
    joined = whole
    for part in parts:
        own, name = part.configuration, part.name
        joined = replace(
            joined,
            files=tuple(dict.fromkeys([*joined.files, *own.files])),
            warnings=(*own.warnings, *joined.warnings),
            inputs=(*joined.inputs, *part.inputs(name in moving)),
            programs=(*joined.programs, *(part.renamed(use) for use in own.programs)),
            sources=(*joined.sources, *(part.renamed(use) for use in own.sources)),
        )
    return replace(joined, blocks=tuple(blocks))


def _check_loops(blocks: list[BlockUse], parts: list[NamedPart], loops: Loops) -> None:
    sources = {use.name: [wire.rpartition(".")[0] for wire in use.wires.values()] for use in blocks}
    for loop in loops(sources):
        around = " -> ".join([*loop, loop[0]])
        part = next(part for part in parts if any(n.startswith(f"{part.name}.") for n in loop))
        place = (part.value.at("in") or part.value).place
        cause, fix = f"these blocks form a loop: {around}", "remove one of these wires"
        raise ConfigurationError([Problem("E-WIRE-LOOP", place, cause, fix)])
