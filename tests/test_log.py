"""The log as blocks see it, in logical time."""

import pytest

from diffbotctl.block import Block, In, Out
from diffbotctl.graph import Graph, Node
from diffbotctl.log import LINES_PER_SECOND_MAX, Logbook
from diffbotctl.messages import LOG_LEVELS, LogLine, Twist
from diffbotctl.time import SECOND


class Speaks(Block):
    """Logs one line a level at each message, and passes it on."""

    twist = In(Twist)
    passed = Out(Twist)

    def react(self, now, twist):
        for level, name in enumerate(LOG_LEVELS):
            self.log.write(level, f"{name} at {twist.linear:g}")
        return twist


def run(book, *speeds):
    """Everything recorded over instants with these speeds, one a nanosecond; and the graph."""
    graph = Graph([Node("one", Speaks(), {"twist": "drive.twist"})], {"drive.twist": Twist}, book)
    seen = []
    compiled = graph.compile({}, seen.append)
    for now, speed in enumerate(speeds):
        compiled.instant(now, Twist(now, speed, 0.0))
    return graph, seen


def lines(seen):
    return [instant[-1] for instant in seen if type(instant[-1]) is LogLine]


@pytest.mark.parametrize(
    "level, received",
    [
        (None, ["info", "warning", "error"]),  # info is where every block begins
        ("debug", ["debug", "info", "warning", "error"]),
        ("warning", ["warning", "error"]),
        ("error", ["error"]),
    ],
)
def test_a_block_logs_from_its_level_on(level, received):
    book = Logbook()
    if level is not None:
        book.set_level("one", level)
    _, seen = run(book, 2.0)
    assert lines(seen) == [LogLine(0, each, "one", f"{each} at 2") for each in received]


def test_lines_follow_their_instant_with_its_time_on_the_last_wire():
    graph, seen = run(Logbook(), 1.0, 2.0)
    assert graph.wires[-1] == "log"
    times_and_kinds = [(instant[0], type(instant[-1])) for instant in seen]
    logged = [(0, LogLine)] * 3
    assert times_and_kinds[:5] == [(0, type(None)), *logged, (1, type(None))]


def test_all_are_set_at_once_and_an_unknown_level_changes_nothing():
    book = Logbook()
    book.source_log("one")
    book.set_level("*", "error")
    assert book.level("one") == book.level("robot") == "error"
    with pytest.raises(ValueError):
        book.set_level("one", "loud")
    assert book.level("one") == "error"


def test_a_block_that_logs_a_line_a_message_is_cut_short_and_that_is_logged():
    book = Logbook()
    book.set_level("one", "error")  # one line an instant
    log = book.source_log("one")
    found = []
    for now in range(LINES_PER_SECOND_MAX + 7):  # 7 too many within a second
        log.error(f"line {now}")
        found += book.take_lines(now)
    assert len(found) == LINES_PER_SECOND_MAX
    log.error("later")
    reported, later = book.take_lines(SECOND)
    assert reported == LogLine(
        SECOND, "warning", "one", "7 lines of one were left out: too many in a second"
    )
    assert later.text == "later"


def test_sources_are_counted_apart():
    book = Logbook()
    for _ in range(LINES_PER_SECOND_MAX + 1):
        book.source_log("one").info("again")
    book.source_log("two").info("once")
    assert [line.source for line in book.take_lines(0)] == ["one"] * LINES_PER_SECOND_MAX + ["two"]


def test_a_block_that_stands_alone_logs_nothing():
    block = Speaks()
    assert block.react(0, Twist(0, 1.0, 0.0)).linear == 1.0
    assert not block.log.debugs and block.log.lines == []


def test_nothing_of_a_block_may_be_called_log():
    with pytest.raises(TypeError, match="reserved for the block's log"):
        type("Odd", (Block,), {"log": Out(Twist), "react": lambda self, now: None})
