"""The wired graph: blocks in topological order, compiled into one flat function.

The rules in each instant `now` (one logical time with all messages that arrived at it):

1. A block reacts if there is a new message on one of its trigger inputs, if one of its timers is
   due, or if the message of one of its inputs has just become older than its `fresh_for`.
2. Each block reacts at most once, in topological order, first those that the motors' command needs.
   Its outputs are visible to the later blocks in the same instant.
3. An input holds the last message of its wire. If it declares `fresh_for`, an older one is None.

A message passes along a wire by assignment to a local variable: the graph is compiled into one
function, because a loop over the wires takes twice as long as the calls of the blocks. For a talker
with a timer of 1 s and an echo with `received = In(Text, fresh_for=0.5)`, both recorded, it is

    def make():
        next_talker_tick = 1000000000
        fresh_echo_received = None
        deadline_echo_received = NEVER
        def instant(now):
            nonlocal next_talker_tick, fresh_echo_received, deadline_echo_received
            new_talker_text = new_echo_text = None
            fired_talker_tick = None
            if now >= next_talker_tick:
                fired_talker_tick = next_talker_tick
                next_talker_tick += 1000000000
            if fired_talker_tick is not None:
                new_talker_text = react_talker(now, fired_talker_tick)
            expired_echo_received = False
            if new_talker_text is not None:
                fresh_echo_received = new_talker_text
                deadline_echo_received = now + 500000000
            elif now >= deadline_echo_received:
                fresh_echo_received = None
                deadline_echo_received = NEVER
                expired_echo_received = True
            if new_talker_text is not None or expired_echo_received:
                new_echo_text = react_echo(now, fresh_echo_received)
            record((now, new_talker_text, new_echo_text))
        def due():
            return min(next_talker_tick, deadline_echo_received)
        def timers():
            return [next_talker_tick]
        return instant, due, timers
"""

import re
from collections.abc import Callable, Iterable, Mapping, Sequence
from graphlib import CycleError, TopologicalSorter
from typing import Any, NamedTuple

from diffbotctl.block import Block, Every, In, inputs, outputs
from diffbotctl.log import Logbook, NamedLogbook
from diffbotctl.messages import LogLine
from diffbotctl.time import NEVER, SECOND

LOG = "log"  # the wire of all log lines, the last one of a graph

Sink = Callable[[int, Any], None]
Instant = Callable[..., None]


class Node(NamedTuple):
    """A block and its name in the pipeline; `wires` maps each connected input to `node.port`."""

    name: str
    block: Block
    wires: dict[str, str]


class LoopError(ValueError):
    """Blocks form a loop; `names` lists them in order and repeats the first one at the end."""

    def __init__(self, names: list[str]) -> None:
        super().__init__(f"the blocks {' -> '.join(names)} form a loop")
        self.names = names


class Graph:
    """Blocks and wires.

    `sources` maps each wire on which drivers deliver to its message class. `wires` lists all wires:
    the sources, then the outputs of the blocks in topological order. With a `book`, the lines that
    blocks log are on the last wire, `log`. `lifetimes`: ns after which a message of a source is no
    longer valid, as if each input of that wire declared such a `fresh_for`. `commands`: wires to
    motors, which do not wait for blocks that they do not need. `parts` are the graphs that
    `join_graphs` has joined, by name; none for another graph.
    """

    def __init__(
        self,
        nodes: Sequence[Node],
        sources: dict[str, type],
        book: Logbook | None = None,
        lifetimes: Mapping[str, int] | None = None,
        commands: Sequence[str] = (),
    ) -> None:
        self.parts: Mapping[str, Graph] = {}
        self.commands = tuple(commands)
        self.nodes = in_order(nodes, self.commands)
        self.lifetimes = dict(lifetimes or {})
        self.sources = list(sources)
        self.kinds: dict[str, type] = dict(sources)
        for node in self.nodes:
            for port, out in outputs(type(node.block)).items():
                self.kinds[f"{node.name}.{port}"] = out.kind
        self.book = book
        if book is not None:
            self.kinds[LOG] = LogLine
            for node in self.nodes:
                node.block.log = book.source_log(node.name)
        self.wires = list(self.kinds)

    def block(self, name: str) -> Block:
        """The block of the node `name`. Raises KeyError."""
        return {node.name: node.block for node in self.nodes}[name]

    def compile(
        self,
        sinks: dict[str, Sink],
        record: Callable[[tuple[Any, ...]], object] | None,
        listeners: dict[str, Sink] | None = None,
    ) -> "Compiled":
        """Compile the graph.

        `sinks` are called with (now, message) at the end of an instant for each new message on
        their wire; those of `commands` as soon as there is one. `listeners` are called in the same
        way, after all sinks and in the order of the wires, so that the lines they log do not depend
        on which sinks there are. `record` is then called with one tuple for the instant, (now,
        message or None for each of `wires`), and with one more tuple of the same time for each line
        of the log.
        """
        sinks = dict(sinks)
        publish = self._publisher(sinks.pop(LOG, None), record)
        listeners = {
            wire: listeners[wire] for wire in self.wires if listeners and wire in listeners
        }
        writer = _Writer(self, list(sinks), record is not None, list(listeners))
        source = writer.source()
        names: dict[str, Any] = {"NEVER": NEVER, "record": record, "publish": publish}
        names["lines"] = [] if self.book is None else self.book.lines
        names.update({f"react_{writer.nodes[node.name]}": node.block.react for node in self.nodes})
        names.update({f"sink_{writer.wires[wire]}": sinks[wire] for wire in sinks})
        names.update({f"listener_{writer.wires[wire]}": listeners[wire] for wire in listeners})
        exec(compile(source, GENERATED, "exec"), names)  # source generated above
        instant, due, timers = names["make"]()
        return Compiled(
            instant=instant,
            due=due,
            source=source,
            line_owner=writer.line_owner,
            publish=publish,
            names=names,
            timers=timers,
            timer_owners=writer.timer_owners,
            nodes=writer.nodes,
        )

    def _publisher(
        self, sink: Sink | None, record: Callable[[tuple[Any, ...]], object] | None
    ) -> Callable[[int], None]:
        """A function that publishes the lines logged in the instant `now`."""
        book, blank = self.book, [None] * (len(self.wires) - 1)

        def publish(now: int) -> None:
            if book is None:
                return
            for line in book.take_lines(now):
                if sink is not None:
                    sink(now, line)
                if record is not None:
                    record((now, *blank, line))

        return publish


def join_graphs(parts: Mapping[str, Graph], book: Logbook) -> Graph:
    """One graph of several, between which there are no wires, with one log.

    The names of nodes and wires begin with that of their part: `left.follower`,
    `left.follower.twist`. Each part then logs in `book` too.
    """
    nodes: list[Node] = []
    sources: dict[str, type] = {}
    lifetimes: dict[str, int] = {}
    commands: list[str] = []
    for name, part in parts.items():
        for node in part.nodes:
            wires = {port: f"{name}.{wire}" for port, wire in node.wires.items()}
            nodes.append(Node(f"{name}.{node.name}", node.block, wires))
        sources |= {f"{name}.{wire}": part.kinds[wire] for wire in part.sources}
        lifetimes |= {f"{name}.{wire}": lifetime for wire, lifetime in part.lifetimes.items()}
        commands += [f"{name}.{wire}" for wire in part.commands]
        part.book = NamedLogbook(book, name)
    joined = Graph(nodes, sources, book, lifetimes, commands)
    joined.parts = dict(parts)
    return joined


class Compiled(NamedTuple):
    """A compiled graph.

    `instant(now, message or None for each source)` runs one instant. `due()` is the time of the
    next timer or deadline. `publish(now)` publishes the log lines that remain after an instant that
    raised. `timers()` are the next times of the timers, `timer_owners` their nodes and periods in
    ns. `line_owner` maps a line of `source` to the node whose block it calls, `nodes` a node to its
    name in `source`.
    """

    instant: Instant
    due: Callable[[], int]
    source: str
    line_owner: dict[int, str]
    publish: Callable[[int], None]
    names: dict[str, Any]
    timers: Callable[[], list[int]]
    timer_owners: list[tuple[str, int]]
    nodes: dict[str, str]

    def reaction(self, node: str) -> Callable[..., Any]:
        react: Callable[..., Any] = self.names[f"react_{self.nodes[node]}"]
        return react

    def swap(self, node: str, react: Callable[..., Any]) -> None:
        """Call `react` for this node from the next instant on."""
        self.names[f"react_{self.nodes[node]}"] = react

    def replace(self, node: str, before: Callable[..., Any], react: Callable[..., Any]) -> None:
        """As `swap`, if `before` is what is called now."""
        if self.reaction(node) is before:
            self.swap(node, react)

    def state(self) -> dict[str, Any]:
        """The state of wires and timers between two instants, by the names in `source`."""
        return {name: cell.cell_contents for name, cell in self._cells().items()}

    def restore(self, state: dict[str, Any]) -> None:
        """Restore a `state` of an equal graph. Raises KeyError when a name is missing."""
        for name, cell in self._cells().items():
            cell.cell_contents = state[name]

    def _cells(self) -> dict[str, Any]:
        closure: Any = self.instant
        return dict(zip(closure.__code__.co_freevars, closure.__closure__ or (), strict=True))

    def culprit(self, error: BaseException) -> str | None:
        """The node whose block raised `error`, or None if no block did."""
        trace = error.__traceback__
        while trace is not None:
            if trace.tb_frame.f_code.co_filename == GENERATED:
                return self.line_owner.get(trace.tb_lineno)
            trace = trace.tb_next
        return None


GENERATED = "<graph>"


def in_order(nodes: Sequence[Node], commands: Sequence[str] = ()) -> list[Node]:
    """`nodes` in topological order, first those that the wires `commands` need. Raises LoopError.

    Otherwise they are in the order of the file.
    """
    by_name = {node.name: node for node in nodes}
    sorter: TopologicalSorter[str] = TopologicalSorter()
    for node in nodes:
        before = {wire.rpartition(".")[0] for wire in node.wires.values()}
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
    needed = {wire.rpartition(".")[0] for wire in commands}
    for node in reversed(ordered):
        if node.name in needed:
            needed |= {wire.rpartition(".")[0] for wire in node.wires.values()}
    return sorted(ordered, key=lambda node: node.name not in needed)


def nanoseconds(block: Block, seconds: float | str) -> int:
    """A period in ns, from seconds or the name of the parameter that holds them."""
    value = getattr(block, seconds) if isinstance(seconds, str) else seconds
    return round(value * SECOND)


def _identifiers(texts: Iterable[str]) -> dict[str, str]:
    """A distinct part of an identifier for each text, such as `robot_link` for `robot.link`."""
    names: dict[str, str] = {}
    for text in texts:
        name = base = re.sub(r"\W", "_", text)
        number = 1
        while name in names.values():
            number += 1
            name = f"{base}_{number}"
        names[text] = name
    return names


class _Input(NamedTuple):
    """The source for one input: lines before the call, conditions under which the block reacts, and
    the argument of `react`."""

    lines: list[str]
    conditions: list[str]
    argument: str


class _Writer:
    """Writes the source of a graph's functions.

    The variables are, for a wire, new_ (its message in this instant) and held_ (the last one); for
    an input with `fresh_for`, fresh_ (the last message until its deadline_) and expired_ (True in
    the instant of the deadline); for a timer, next_ (its next time) and fired_ (the time at which
    it fired in this instant).
    """

    def __init__(
        self, graph: Graph, sinks: list[str], recording: bool, listeners: list[str]
    ) -> None:
        self.graph = graph
        self.nodes = _identifiers(node.name for node in graph.nodes)
        self.wires = _identifiers(graph.wires)
        self.ports = _identifiers(
            f"{node.name}.{port}" for node in graph.nodes for port in inputs(type(node.block))
        )
        self.initial: dict[str, str] = {}  # of each variable that outlives an instant
        self.deadlines: list[str] = []
        self.timers: list[str] = []
        self.timer_owners: list[tuple[str, int]] = []
        self.line_owner: dict[int, str] = {}
        self.reactions = [self._reaction(node) for node in graph.nodes]
        calls = {wire: self._call_when_new(wire, "sink") for wire in sinks}
        self.at_once = {wire: calls.pop(wire) for wire in graph.commands if wire in calls}
        self.final = [*calls.values()]
        self.final += [self._call_when_new(wire, "listener") for wire in listeners]
        if recording:
            messages = ["None" if wire == LOG else self._new(wire) for wire in graph.wires]
            self.final.append([f"record(({', '.join(['now', *messages])}))"])
        if graph.book is not None:
            self.final.append(["if lines:", "    publish(now)"])

    def source(self) -> str:
        """The text of `make`, which returns (instant, due, timers); fills `line_owner`."""
        inner = [
            self._new(wire)
            for wire in self.graph.wires
            if wire not in self.graph.sources and wire != LOG
        ]
        arguments = ["now", *(f"{self._new(wire)}=None" for wire in self.graph.sources)]
        lines = ["def make():"]
        lines += [f"    {name} = {value}" for name, value in self.initial.items()]
        lines.append(f"    def instant({', '.join(arguments)}):")
        body = [f"nonlocal {', '.join(self.initial)}"] if self.initial else []
        body += [f"{' = '.join(inner)} = None"] if inner else []
        for wire in self.graph.sources:
            body += self._hold(wire)
        for node, reaction in zip(self.graph.nodes, self.reactions, strict=True):
            first = len(lines) + len(body) + 1
            body += reaction
            self.line_owner.update(
                {number: node.name for number in range(first, first + len(reaction))}
            )
            for port in outputs(type(node.block)):
                body += self._hold(f"{node.name}.{port}")
                body += self.at_once.get(f"{node.name}.{port}", [])
        for final in self.final:
            body += final
        lines += [f"        {line}" for line in body or ["pass"]]
        lines += ["    def due():", f"        return {self._earliest()}"]
        lines += ["    def timers():", f"        return [{', '.join(self.timers)}]"]
        lines.append("    return instant, due, timers")
        return "\n".join(lines) + "\n"

    def _new(self, wire: str) -> str:
        return f"new_{self.wires[wire]}"

    def _variable(self, name: str, initial: str) -> str:
        """Declare a variable that outlives an instant; returns its name."""
        self.initial[name] = initial
        return name

    def _hold(self, wire: str) -> list[str]:
        held = f"held_{self.wires[wire]}"
        if held not in self.initial:
            return []
        return [f"if {self._new(wire)} is not None:", f"    {held} = {self._new(wire)}"]

    def _call_when_new(self, wire: str, callee: str) -> list[str]:
        new = self._new(wire)
        return [f"if {new} is not None:", f"    {callee}_{self.wires[wire]}(now, {new})"]

    def _reaction(self, node: Node) -> list[str]:
        """The lines that check whether the block reacts, and call it."""
        ports = [
            self._input(node, port, declaration)
            for port, declaration in inputs(type(node.block)).items()
        ]
        conditions = [condition for port in ports for condition in port.conditions]
        if not conditions:
            return [line for port in ports for line in port.lines]
        arguments = ["now", *(port.argument for port in ports)]
        call = f"react_{self.nodes[node.name]}({', '.join(arguments)})"
        return [
            *(line for port in ports for line in port.lines),
            f"if {' or '.join(conditions)}:",
            *(f"    {line}" for line in self._call(node, call)),
        ]

    def _input(self, node: Node, port: str, declaration: In | Every) -> _Input:
        name = self.ports[f"{node.name}.{port}"]
        if isinstance(declaration, Every):
            period = nanoseconds(node.block, declaration.period)
            self.timer_owners.append((node.name, period))
            return self._timer(name, period)
        if port not in node.wires:
            return _Input([], [], "None")
        wire = node.wires[port]
        conditions = [f"{self._new(wire)} is not None"] if declaration.trigger else []
        lifetimes = [self.graph.lifetimes[wire]] if wire in self.graph.lifetimes else []
        if declaration.fresh_for is not None:
            lifetimes.append(nanoseconds(node.block, declaration.fresh_for))
        if not lifetimes:
            held = self._variable(f"held_{self.wires[wire]}", "None")
            return _Input([], conditions, held)
        return self._fresh_input(name, self._new(wire), min(lifetimes), conditions)

    def _timer(self, name: str, period: int) -> _Input:
        next_time = self._variable(f"next_{name}", str(period))
        self.deadlines.append(next_time)
        self.timers.append(next_time)
        fired = f"fired_{name}"
        lines = [
            f"{fired} = None",
            f"if now >= {next_time}:",
            f"    {fired} = {next_time}",
            f"    {next_time} += {period}",
        ]
        return _Input(lines, [f"{fired} is not None"], fired)

    def _fresh_input(self, name: str, new: str, lifetime: int, conditions: list[str]) -> _Input:
        fresh = self._variable(f"fresh_{name}", "None")
        deadline = self._variable(f"deadline_{name}", "NEVER")
        self.deadlines.append(deadline)
        expired = f"expired_{name}"
        lines = [
            f"{expired} = False",
            f"if {new} is not None:",
            f"    {fresh} = {new}",
            f"    {deadline} = now + {lifetime}",
            f"elif now >= {deadline}:",
            f"    {fresh} = None",
            f"    {deadline} = NEVER",
            f"    {expired} = True",
        ]
        return _Input(lines, [*conditions, expired], fresh)

    def _call(self, node: Node, call: str) -> list[str]:
        """The lines that call a block and put what it returns on its wires."""
        news = [self._new(f"{node.name}.{port}") for port in outputs(type(node.block))]
        if not news:
            return [call]
        if len(news) == 1:
            return [f"{news[0]} = {call}"]
        return [
            f"messages = {call}",
            "if messages is not None:",
            f"    {', '.join(news)} = messages",
        ]

    def _earliest(self) -> str:
        if not self.deadlines:
            return "NEVER"
        if len(self.deadlines) == 1:
            return self.deadlines[0]
        return f"min({', '.join(self.deadlines)})"
