"""The graph's rules at one instant, on blocks small enough to follow by hand."""

from itertools import pairwise

import pytest

import diffbotctl.graph as graph_module
from diffbotctl.block import Block, Every, In, Out
from diffbotctl.graph import Graph, LoopError, Node, in_order
from diffbotctl.messages import Text, Twist, Wheels
from diffbotctl.params import Param
from diffbotctl.time import MILLISECOND as MS
from diffbotctl.time import NEVER


class Double(Block):
    """Twice the speed."""

    twist = In(Twist)
    out = Out(Twist)

    def react(self, now, twist):
        return twist._replace(linear=2 * twist.linear)


class Join(Block):
    """The trigger's speed plus the sampled one's."""

    twist = In(Twist)
    beside = In(Twist, trigger=False, optional=True)
    out = Out(Twist)

    def react(self, now, twist, beside):
        extra = 0 if beside is None else beside.linear
        return Twist(now, twist.linear + extra, 0.0)


class Fresh(Block):
    """Publishes whether its input is fresh."""

    patience = Param(float, default=0.1, help="s")
    twist = In(Twist, fresh_for="patience")
    words = Out(Text)

    def react(self, now, twist):
        return Text(now, "stale" if twist is None else "fresh")


class Clock(Block):
    """Publishes when its timer fired."""

    tick = Every(0.02)
    twist = In(Twist, optional=True)
    words = Out(Text)

    def react(self, now, tick, twist):
        return Text(now, f"{None if tick is None else tick // MS}")


class Split(Block):
    """Two outputs, the second only for positive speeds."""

    twist = In(Twist)
    wheels = Out(Wheels)
    words = Out(Text)

    def react(self, now, twist):
        text = Text(now, "up") if twist.linear > 0 else None
        return Wheels(now, twist.linear, twist.linear), text


SOURCES = {"drive.twist": Twist, "drive.other": Twist}


def run(nodes, *instants):
    """Run instants of (now, twist, other) and return what each put on every wire."""
    outputs_seen = []
    graph = Graph(nodes, SOURCES)
    compiled = graph.compile({}, outputs_seen.append)
    for now, *values in instants:
        messages = [None if v is None else Twist(now, v, 0.0) for v in values]
        compiled.instant(now, *messages)
    return graph, compiled, outputs_seen


def test_outputs_are_visible_to_later_blocks_within_the_instant():
    nodes = [
        Node("second", Double(), {"twist": "first.out"}),
        Node("first", Double(), {"twist": "drive.twist"}),
    ]
    graph, _, outputs_seen = run(nodes, (1, 1.0, None))
    assert [node.name for node in graph.nodes] == ["first", "second"]
    values = dict(zip(graph.wires, outputs_seen[0][1:], strict=True))
    assert values["second.out"].linear == 4.0  # doubled twice in one instant


def test_sampled_input_is_only_looked_at():
    nodes = [Node("join", Join(), {"twist": "drive.twist", "beside": "drive.other"})]
    _, _, outputs_seen = run(nodes, (1, None, 5.0), (2, 1.0, None), (3, 1.0, 7.0))
    out = [instant[-1] and instant[-1].linear for instant in outputs_seen]
    assert out == [None, 6.0, 8.0]  # 5 alone triggers no block; 1 + held 5; 1 + new 7


def test_input_goes_stale_at_its_deadline_and_wakes_the_block_once():
    nodes = [Node("fresh", Fresh(), {"twist": "drive.twist"})]
    _, compiled, outputs_seen = run(nodes, (10, 1.0, None))
    assert compiled.due() == 10 + 100 * MS
    compiled.instant(10 + 100 * MS)
    assert [instant[-1].text for instant in outputs_seen] == ["fresh", "stale"]
    assert compiled.due() == NEVER


def test_a_new_message_moves_the_deadline():
    nodes = [Node("fresh", Fresh(), {"twist": "drive.twist"})]
    _, compiled, _ = run(nodes, (0, 1.0, None), (60 * MS, 1.0, None))
    assert compiled.due() == 160 * MS


def test_timer_fires_at_nominal_times_and_merges_with_an_arrival():
    nodes = [Node("clock", Clock(), {"twist": "drive.twist"})]
    _, compiled, outputs_seen = run(nodes, (5 * MS, 1.0, None), (20 * MS, 1.0, None))
    assert [instant[-1].text for instant in outputs_seen] == ["None", "20"]
    assert compiled.due() == 40 * MS


def test_several_outputs_leave_as_a_tuple_and_none_means_no_message():
    nodes = [Node("split", Split(), {"twist": "drive.twist"})]
    _, _, outputs_seen = run(nodes, (1, 1.0, None), (2, -1.0, None))
    assert outputs_seen[0][-2:] == (Wheels(1, 1.0, 1.0), Text(1, "up"))
    assert outputs_seen[1][-2:] == (Wheels(2, -1.0, -1.0), None)


def test_sinks_get_new_messages_only():
    arrived = []
    nodes = [Node("split", Split(), {"twist": "drive.twist"})]
    graph = Graph(nodes, SOURCES)
    compiled = graph.compile({"split.words": lambda now, m: arrived.append((now, m.text))}, None)
    compiled.instant(1, Twist(1, 1.0, 0.0), None)
    compiled.instant(2, Twist(2, -1.0, 0.0), None)
    assert arrived == [(1, "up")]


def test_a_command_does_not_wait_for_blocks_that_it_does_not_need():
    happened = []

    class Slow(Double):
        """Takes long."""

        def react(self, now, twist):
            happened.append("slow")

    nodes = [
        Node("slow", Slow(), {"twist": "drive.twist"}),
        Node("split", Split(), {"twist": "double.out"}),
        Node("double", Double(), {"twist": "drive.twist"}),
    ]
    graph = Graph(nodes, SOURCES, commands=["split.wheels"])
    assert [node.name for node in graph.nodes] == ["double", "split", "slow"]
    sinks = {
        wire: lambda now, message, wire=wire: happened.append(wire)
        for wire in ("split.words", "split.wheels")
    }
    graph.compile(sinks, None).instant(1, Twist(1, 1.0, 0.0), None)
    assert happened == ["split.wheels", "slow", "split.words"]


def test_loop_names_the_blocks_in_order():
    nodes = [
        Node("a", Double(), {"twist": "c.out"}),
        Node("b", Double(), {"twist": "a.out"}),
        Node("c", Double(), {"twist": "b.out"}),
    ]
    with pytest.raises(LoopError) as caught:
        in_order(nodes)
    names = caught.value.names
    assert names[0] == names[-1] and set(names) == {"a", "b", "c"}
    follows = {"a": "b", "b": "c", "c": "a"}
    assert all(follows[x] == y for x, y in pairwise(names))


def test_the_block_that_raised_is_named():
    class Breaks(Double):
        """Raises."""

        def react(self, now, twist):
            raise ZeroDivisionError

    nodes = [
        Node("fine", Double(), {"twist": "drive.twist"}),
        Node("bad", Breaks(), {"twist": "fine.out"}),
    ]
    compiled = Graph(nodes, SOURCES).compile({}, None)
    with pytest.raises(ZeroDivisionError) as caught:
        compiled.instant(1, Twist(1, 1.0, 0.0), None)
    assert compiled.culprit(caught.value) == "bad"


def test_react_must_name_the_inputs_in_order():
    with pytest.raises(TypeError, match=r"now, twist"):

        class Wrong(Block):
            """Names its input otherwise."""

            twist = In(Twist)

            def react(self, now, speed):
                return None


class Talker(Block):
    """Publishes a text each second."""

    tick = Every(1.0)
    text = Out(Text)

    def react(self, now, tick):
        return Text(now, "hello")


class Echo(Block):
    """Publishes the text that it received, until it is stale."""

    received = In(Text, fresh_for=0.5)
    text = Out(Text)

    def react(self, now, received):
        return received


def talker_and_echo():
    nodes = [Node("talker", Talker(), {}), Node("echo", Echo(), {"received": "talker.text"})]
    return Graph(nodes, {}).compile({}, lambda instant: None)


def test_the_docstring_shows_the_source_that_is_generated():
    example = graph_module.__doc__.partition("    def make():")[2]
    lines = ("    def make():" + example).rstrip().splitlines()
    assert talker_and_echo().source.splitlines() == [line.removeprefix("    ") for line in lines]


def test_wires_with_like_names_do_not_share_a_variable():
    nodes = [Node("join", Join(), {"twist": "a_b.c", "beside": "a.b_c"})]
    outputs_seen = []
    compiled = Graph(nodes, {"a_b.c": Twist, "a.b_c": Twist}).compile({}, outputs_seen.append)
    compiled.instant(1, Twist(1, 1.0, 0.0), Twist(1, 5.0, 0.0))
    assert outputs_seen[0][-1].linear == 6.0
