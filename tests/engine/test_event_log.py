"""How the messages of a run appear in the log."""

import pytest

from diffbotctl.block import Block, In, Out
from diffbotctl.engine.event_log import EventLogger
from diffbotctl.graph import Graph, Node
from diffbotctl.log import Logbook
from diffbotctl.messages import (
    Call,
    Encoders,
    Goal,
    GoalState,
    Link,
    LogLine,
    Resume,
    Setting,
    Stop,
    Text,
)


class Ends(Block):
    """Passes on what it is handed."""

    stop_in = In(Stop, optional=True)
    state_in = In(GoalState, optional=True)
    stop = Out(Stop)
    state = Out(GoalState)

    def react(self, now, stop_in, state_in):
        return stop_in, state_in


SOURCES = {
    "drive.stop": Stop,
    "drive.state": GoalState,
    "robot.encoders": Encoders,
    "robot.link": Link,
    "robot.text": Text,
    "operator.goal": Goal,
    "operator.resume": Resume,
    "operator.setting": Setting,
    "operator.call": Call,
    "operator.log": LogLine,
}


def logged_lines(*deliveries):
    """The lines over instants with one message each: (level, source, text)."""
    wires = {"stop_in": "drive.stop", "state_in": "drive.state"}
    book = Logbook()
    graph = Graph([Node("guard", Ends(), wires)], SOURCES, book)
    instants = []
    compiled = graph.compile({}, instants.append, EventLogger(graph, book).sinks())
    for now, (wire, message) in enumerate(deliveries):
        compiled.instant(now, *(message if each == wire else None for each in graph.sources))
    return [tuple(instant[-1][1:]) for instant in instants if type(instant[-1]) is LogLine]


HELD, LATCHED = Stop(0, "obstacle", "a wall", False), Stop(0, "link_lost", "pulled", True)
TURNING, DRIVING = GoalState(0, 1, "turning", 1.0, 0.5), GoalState(0, 1, "driving", 0.5, 0.0)


@pytest.mark.parametrize(
    "deliveries, lines",
    [
        # The same stop reported again is no new event; its end is one.
        (
            [("drive.stop", HELD), ("drive.stop", HELD), ("drive.stop", Stop(0, "", "", False))],
            [
                ("warning", "guard", "STOP obstacle: a wall; ends by itself"),
                ("info", "guard", "stop obstacle ended"),
            ],
        ),
        (
            [("drive.stop", LATCHED)],
            [("error", "guard", "STOP link_lost: pulled; waits for `resume`")],
        ),
        # A state that lasts is logged when it begins; 0.5 rad are 28.6 degrees.
        (
            [("drive.state", TURNING), ("drive.state", TURNING), ("drive.state", DRIVING)],
            [
                ("info", "guard", "goal 1: turning, 1000 mm, 28.6 deg to go"),
                ("info", "guard", "goal 1: driving, 500 mm, 0.0 deg to go"),
            ],
        ),
        # A goal that was withdrawn and goes on begins anew.
        (
            [
                ("drive.state", TURNING),
                ("operator.goal", Goal(0, 0)),
                ("drive.state", TURNING),
            ],
            [
                ("info", "guard", "goal 1: turning, 1000 mm, 28.6 deg to go"),
                ("info", "operator", "the goal is withdrawn"),
                ("info", "guard", "goal 1: turning, 1000 mm, 28.6 deg to go"),
            ],
        ),
        (
            [("drive.state", GoalState(0, 2, "reached", 0.004, 0.0))],
            [("info", "guard", "goal 2 reached, error 4 mm, 0.0 deg")],
        ),
        (
            [("drive.state", GoalState(0, 2, "given_up", 0.4, 0.0, "it took 60 s"))],
            [("error", "guard", "goal 2 given up, 400 mm, 0.0 deg away: it took 60 s")],
        ),
        (
            [("drive.state", GoalState(0, 2, "cancelled", 0.4, 0.0, "replaced by goal 3"))],
            [("info", "guard", "goal 2 cancelled, 400 mm, 0.0 deg away: replaced by goal 3")],
        ),
        (
            [("operator.goal", Goal(0, 1, 1.0, 0.5, None)), ("operator.goal", Goal(0, 0))],
            [
                ("info", "operator", "goal 1 accepted: x 1.000 m  y 0.500 m"),
                ("info", "operator", "the goal is withdrawn"),
            ],
        ),
        (
            [
                ("robot.link", Link(0, "up")),
                ("robot.link", Link(1, "up", received=40)),
                ("robot.link", Link(2, "lost", cause="unplugged")),
                ("robot.link", Link(3, "up", restarts=1)),
            ],
            [
                ("info", "robot", "link up"),
                ("error", "robot", "link lost: unplugged"),
                ("warning", "robot", "the board restarted (restart 1 of this run)"),
                ("info", "robot", "link up"),
            ],
        ),
        (
            [
                ("operator.resume", Resume(0)),
                ("operator.setting", Setting(0, "guard", "margin", 0.08)),
                ("operator.call", Call(0, "robot", "teleport", (0.5, 0.0))),
                ("robot.text", Text(0, "hello from the board")),
                ("operator.log", LogLine(0, "warning", "engine", "the disk is full")),
            ],
            [
                ("info", "operator", "resume: the operator allows motion"),
                ("info", "operator", "guard.margin = 0.08"),
                ("info", "operator", "robot.teleport(0.5, 0) called"),
                ("info", "robot", "hello from the board"),
                ("warning", "engine", "the disk is full"),
            ],
        ),
    ],
    ids=[
        "held",
        "latched",
        "states",
        "anew",
        "reached",
        "given_up",
        "cancelled",
        "goals",
        "link",
        "clients",
    ],
)
def test_each_event_is_one_line(deliveries, lines):
    assert logged_lines(*deliveries) == lines


def test_a_driver_is_logged_from_its_own_level():
    book = Logbook()
    graph = Graph([], SOURCES, book)
    instants = []
    compiled = graph.compile({}, instants.append, EventLogger(graph, book).sinks())
    book.set_level("engine", "error")
    line = LogLine(0, "info", "engine", "x")
    compiled.instant(0, *(line if wire == "operator.log" else None for wire in graph.sources))
    assert not [instant for instant in instants if type(instant[-1]) is LogLine]
