"""The wired graph: blocks in topological order, compiled into one flat function.

The rules it keeps, at each instant `now` (one logical time with everything that arrived at it):

1. A block is reached when a new message is on one of its trigger inputs, when one of its timers is
   due, or when one of its inputs has just outlived its `fresh_for`.
2. Each block that is reached reacts once, in topological order; its outputs are visible to the
   blocks after it within the same instant.
3. An input holds the last message of its wire; where it declares `fresh_for`, older is None.

A hop is an assignment to a local variable: the graph is written out as the source of one function
per run, because walking a list of wires costs twice as much as the call itself.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from graphlib import CycleError, TopologicalSorter
from typing import Any, NamedTuple

from diffbotctl.block import Block, Every, In, inputs, outputs
from diffbotctl.log import Logbook
from diffbotctl.messages import LogLine
from diffbotctl.time import NEVER, SECOND

LOG = "log"  # the wire of all lines; it comes last

Sink = Callable[[int, Any], None]
Instant = Callable[..., None]


class Node(NamedTuple):
    """A block under its name in the pipeline; `wires` maps an input to `node.port`."""

    name: str
    block: Block
    wires: dict[str, str]


class LoopError(ValueError):
    """Blocks feed each other in a circle; `names` lists them in order, the first one again last."""

    def __init__(self, names: list[str]) -> None:
        super().__init__(f"the blocks {' -> '.join(names)} form a loop")
        self.names = names


class Graph:
    """Blocks and wires, ready to run.

    `sources` are the wires that drivers deliver on, by name with their message class. After
    construction `wires` lists all wires, sources first, then the blocks' outputs in the order in
    which they are computed. With a `book` the blocks are heard, on the last wire, `log`.
    """

    def __init__(
        self, nodes: Sequence[Node], sources: dict[str, type], book: Logbook | None = None
    ) -> None:
        self.nodes = in_order(nodes)
        self.sources = list(sources)
        self.kinds: dict[str, type] = dict(sources)
        for node in self.nodes:
            for port, out in outputs(type(node.block)).items():
                self.kinds[f"{node.name}.{port}"] = out.kind
        self.book = book
        if book is not None:
            self.kinds[LOG] = LogLine
            for node in self.nodes:
                node.block.log = book.of(node.name)
        self.wires = list(self.kinds)

    def block(self, name: str) -> Block:
        """The block under `name`. Raises KeyError."""
        return {node.name: node.block for node in self.nodes}[name]

    def compile(
        self,
        sinks: dict[str, Sink],
        record: Callable[[tuple[Any, ...]], object] | None,
        listeners: dict[str, Sink] | None = None,
    ) -> Compiled:
        """Make the run's functions.

        `sinks` are called with (now, message) at the end of an instant for each new message on
        their wire. `record`, when given, then gets one tuple an instant: (now, message or None for
        each of `wires`); and one more, with the same time, for each line of the log. `listeners`
        are called like sinks, after them all and in the order of the wires: what they say must not
        hang on which sinks there are.
        """
        sinks = dict(sinks)
        publish = self._publisher(sinks.pop(LOG, None), record)
        heard = {wire: listeners[wire] for wire in self.wires if listeners and wire in listeners}
        writer = _Writer(self, list(sinks), record is not None, list(heard))
        names: dict[str, Any] = {"NEVER": NEVER, "record": record, "publish": publish}
        names["lines"] = [] if self.book is None else self.book.lines
        names.update({f"r{i}": node.block.react for i, node in enumerate(self.nodes)})
        names.update({f"s{i}": sink for i, sink in enumerate(sinks.values())})
        names.update({f"h{i}": listener for i, listener in enumerate(heard.values())})
        exec(compile(writer.source(), GENERATED, "exec"), names)  # the graph's own source
        instant, due, timers = names["make"]()
        return Compiled(
            instant, due, writer.source(), writer.line_owner, publish, names, timers, writer.timers
        )

    def _publisher(
        self, sink: Sink | None, record: Callable[[tuple[Any, ...]], object] | None
    ) -> Callable[[int], None]:
        """What hands out the lines said in the instant at the time it is given."""
        book, blank = self.book, [None] * (len(self.wires) - 1)

        def publish(now: int) -> None:
            if book is None:
                return
            for line in book.taken(now):
                if sink is not None:
                    sink(now, line)
                if record is not None:
                    record((now, *blank, line))

        return publish


class Compiled(NamedTuple):
    """A graph turned into functions.

    `instant(now, message or None for each source)` runs one instant; `due()` is the time at which
    the graph wants an instant of its own accord; `publish(now)` hands out the lines of the log that
    an instant which raised has left. `timers()` are the timers' next times, `timer_owners` their
    nodes and periods in ns.
    """

    instant: Instant
    due: Callable[[], int]
    source: str
    line_owner: dict[int, str]
    publish: Callable[[int], None]
    names: dict[str, Any]
    timers: Callable[[], tuple[int, ...]]
    timer_owners: list[tuple[str, int]]

    def swap(self, place: int, react: Callable[..., Any]) -> None:
        """From the next instant on call `react` for the node at `place` in `Graph.nodes`."""
        self.names[f"r{place}"] = react

    def state(self) -> dict[str, Any]:
        """What wires and timers hold between two instants, by the names in `source`."""
        return {name: cell.cell_contents for name, cell in self._cells().items()}

    def restore(self, state: dict[str, Any]) -> None:
        """Bring back a `state` of an equal graph. Raises KeyError when a name is missing."""
        for name, cell in self._cells().items():
            cell.cell_contents = state[name]

    def _cells(self) -> dict[str, Any]:
        closure: Any = self.instant
        return dict(zip(closure.__code__.co_freevars, closure.__closure__ or (), strict=True))

    def culprit(self, error: BaseException) -> str | None:
        """The node whose reaction raised `error`, or None when no reaction did."""
        trace = error.__traceback__
        while trace is not None:
            if trace.tb_frame.f_code.co_filename == GENERATED:
                return self.line_owner.get(trace.tb_lineno)
            trace = trace.tb_next
        return None


GENERATED = "<graph>"


def in_order(nodes: Sequence[Node]) -> list[Node]:
    """`nodes` in topological order; ties keep the order of the file. Raises LoopError."""
    by_name = {node.name: node for node in nodes}
    sorter: TopologicalSorter[str] = TopologicalSorter()
    for node in nodes:
        before = {wire.split(".")[0] for wire in node.wires.values()}
        sorter.add(node.name, *[name for name in by_name if name in before])
    try:
        sorter.prepare()
    except CycleError as error:
        raise LoopError(list(error.args[1])) from None
    place = {name: i for i, name in enumerate(by_name)}
    ordered: list[Node] = []
    while sorter.is_active():
        for name in sorted(sorter.get_ready(), key=place.__getitem__):
            ordered.append(by_name[name])
            sorter.done(name)
    return ordered


def nanoseconds(block: Block, seconds: float | str) -> int:
    """A period of a port: seconds, or the name of the parameter that holds them."""
    value = getattr(block, seconds) if isinstance(seconds, str) else seconds
    return round(value * SECOND)


class _Writer:
    """Writes the source. n = new on wire, v = held on wire, f = held while fresh, x = its deadline,
    q = a timer's next time, k = its firing."""

    def __init__(
        self, graph: Graph, sinks: list[str], recording: bool, listeners: list[str]
    ) -> None:
        self.number = {wire: i for i, wire in enumerate(graph.wires)}
        self.lines: list[str] = []
        self.state: dict[str, str] = {}
        self.deadlines: list[str] = []
        self.line_owner: dict[int, str] = {}
        self.timers: list[tuple[str, int]] = []
        self.reactions: list[tuple[str, list[str]]] = [
            (node.name, self.reaction(i, node)) for i, node in enumerate(graph.nodes)
        ]
        self.arguments = [f"n{self.number[wire]}=None" for wire in graph.sources]
        self.inner = [w for w in graph.wires if w not in graph.sources and w != LOG]
        self.sinks = [
            f"if n{self.number[w]} is not None: s{i}(now, n{self.number[w]})"
            for i, w in enumerate(sinks)
        ]
        self.sinks += [
            f"if n{self.number[w]} is not None: h{i}(now, n{self.number[w]})"
            for i, w in enumerate(listeners)
        ]
        everything = ", ".join("None" if w == LOG else f"n{i}" for w, i in self.number.items())
        self.last = [f"record((now, {everything}))"] if recording else []
        self.last += ["if lines: publish(now)"] if graph.book is not None else []

    def reaction(self, index: int, node: Node) -> list[str]:
        """The lines that decide whether the node is reached and let it react."""
        reached: list[str] = []
        arguments = ["now"]
        lines: list[str] = []
        for port, declaration in inputs(type(node.block)).items():
            key = f"{index}_{port}"
            if isinstance(declaration, Every):
                period = nanoseconds(node.block, declaration.period)
                lines += self.timer(key, period)
                self.timers.append((node.name, period))
                reached.append(f"k{key} is not None")
                arguments.append(f"k{key}")
            elif port not in node.wires:
                arguments.append("None")
            else:
                arguments.append(self.input(key, node, port, declaration, lines, reached))
        call = f"r{index}({', '.join(arguments)})"
        return [*lines, *self.call(reached, call, node)]

    def timer(self, key: str, period: int) -> list[str]:
        self.state[f"q{key}"] = str(period)
        self.deadlines.append(f"q{key}")
        return [f"k{key} = None", f"if now >= q{key}: k{key} = q{key}; q{key} += {period}"]

    def input(
        self, key: str, node: Node, port: str, declared: In, lines: list[str], reached: list[str]
    ) -> str:
        wire = self.number[node.wires[port]]
        if declared.trigger:
            reached.append(f"n{wire} is not None")
        if declared.fresh_for is None:
            self.state[f"v{wire}"] = "None"
            return f"v{wire}"
        self.state[f"f{key}"] = "None"
        self.state[f"x{key}"] = "NEVER"
        self.deadlines.append(f"x{key}")
        span = nanoseconds(node.block, declared.fresh_for)
        lines.append(f"e{key} = False")
        lines.append(f"if n{wire} is not None: f{key} = n{wire}; x{key} = now + {span}")
        lines.append(f"elif now >= x{key}: f{key} = None; x{key} = NEVER; e{key} = True")
        reached.append(f"e{key}")
        return f"f{key}"

    def call(self, reached: list[str], call: str, node: Node) -> list[str]:
        outs = [self.number[f"{node.name}.{port}"] for port in outputs(type(node.block))]
        if not reached:
            return []
        lines = [f"if {' or '.join(reached)}:"]
        if not outs:
            return [*lines, f"    {call}"]
        if len(outs) == 1:
            lines.append(f"    n{outs[0]} = {call}")
        else:
            lines.append(f"    o = {call}")
            lines.append(f"    if o is not None: {', '.join(f'n{i}' for i in outs)} = o")
        return lines

    def source(self) -> str:
        """The text of `make`, which returns (instant, due); fills `line_owner` on the way."""
        held = [name for name in self.state if name.startswith("v")]
        lines = ["def make():"]
        lines += [f"    {name} = {value}" for name, value in self.state.items()]
        lines.append(f"    def instant({', '.join(['now', *self.arguments])}):")
        if self.state:
            lines.append(f"        nonlocal {', '.join(self.state)}")
        inner = [f"n{self.number[wire]}" for wire in self.inner]
        if inner:
            lines.append(f"        {' = '.join(inner)} = None")
        keep = {name: f"if n{name[1:]} is not None: {name} = n{name[1:]}" for name in held}
        given = {f"v{self.number[w]}" for w in self.number} - {f"v{i[1:]}" for i in inner}
        lines += [f"        {keep[name]}" for name in held if name in given]
        for owner, reaction in self.reactions:
            for line in reaction:
                lines.append(f"        {line}")
                self.line_owner[len(lines)] = owner
            lines += [
                f"        {keep[f'v{self.number[w]}']}"
                for w in self.inner
                if w.split(".")[0] == owner and f"v{self.number[w]}" in keep
            ]
        lines += [f"        {line}" for line in [*self.sinks, *self.last] or ["pass"]]
        lines.append("    def due():")
        lines.append(f"        return {self.earliest()}")
        lines.append("    def timers():")
        lines.append(f"        return ({''.join(f'{q}, ' for q in self.state if q[0] == 'q')})")
        lines.append("    return instant, due, timers")
        return "\n".join(lines) + "\n"

    def earliest(self) -> str:
        """An expression for the earliest deadline."""
        if not self.deadlines:
            return "NEVER"
        if len(self.deadlines) == 1:
            return self.deadlines[0]
        return f"min({', '.join(self.deadlines)})"
