"""A stop that ends and begins again at the same place is one stop, for whoever reports stops."""

import json

import pytest
from click.testing import CliRunner

from diffbotctl.block import Block, In, Out
from diffbotctl.cli.main import program
from diffbotctl.drivers.goal_queue import Operator
from diffbotctl.engine.event_log import EventLogger
from diffbotctl.engine.stop_places import stops_in_force
from diffbotctl.graph import Graph, Node
from diffbotctl.log import Logbook
from diffbotctl.messages import LogLine, Odometry, Stop
from diffbotctl.processes.screen import RunSnapshot
from diffbotctl.recording.metrics import MetricsAccumulator
from diffbotctl.ui.run_text import active_stop

WALL, FREE = Stop(0, "obstacle", "a wall", False), Stop(0, "", "", False)
FAULT, OTHER = Stop(0, "wheel_fault", "it slips", True), Stop(0, "range_fault", "no echo", False)


def at(x, y=0.0):
    return Odometry(0, x, y, 0.0, 0.0, 0.0, (0.0,) * 6)


class Guard(Block):
    """Passes on the stops that it is handed."""

    given = In(Stop, optional=True)
    stop = Out(Stop)

    def react(self, now, given):
        return given


# Messages, and the codes of the stops that are reported: `-` marks the end of one.
CASES = [
    ([at(1.0), WALL, FREE, WALL, FREE, WALL, FREE], ["obstacle"]),
    ([at(1.0), WALL, FREE, at(1.03), WALL, FREE, at(1.04, 0.02), WALL], ["obstacle"]),
    # It has left the place: the stop has ended, and the next one is another.
    ([at(1.0), WALL, FREE, at(1.06), WALL], ["obstacle", "-obstacle", "obstacle"]),
    ([at(1.0), WALL, FREE, at(0.9), at(0.8)], ["obstacle", "-obstacle"]),
    # It has left while the stop was in force, backwards.
    ([at(1.0), WALL, at(0.9), FREE, WALL], ["obstacle", "-obstacle", "obstacle"]),
    # It creeps away in steps that are small each.
    (
        [at(1.0), WALL, FREE, at(1.03), WALL, FREE, at(1.06), WALL, FREE],
        ["obstacle", "-obstacle", "obstacle"],
    ),
    ([at(1.0), WALL, FREE, OTHER, FREE], ["obstacle", "range_fault"]),
    # A person has ended the first of them.
    (
        [at(1.0), FAULT, FREE, FAULT, FREE],
        ["wheel_fault", "-wheel_fault", "wheel_fault", "-wheel_fault"],
    ),
    # Without a pose nothing is known of the place.
    ([WALL, FREE, WALL, FREE], ["obstacle", "-obstacle", "obstacle", "-obstacle"]),
]


@pytest.mark.parametrize(("messages", "codes"), CASES)
def test_the_log_shows_each_stop_once(messages, codes):
    book, instants = Logbook(), []
    sources = {"drive.stop": Stop, "robot.pose": Odometry}
    graph = Graph([Node("guard", Guard(), {"given": "drive.stop"})], sources, book)
    compiled = graph.compile({}, instants.append, EventLogger(graph, book).sinks())
    for now, message in enumerate(messages):
        given = (message, None) if isinstance(message, Stop) else (None, message)
        compiled.instant(now, *given)
    lines = [instant[-1].text for instant in instants if type(instant[-1]) is LogLine]
    words = [f"-{line.split()[1]}" if line.startswith("stop") else line for line in lines]
    assert [word.removeprefix("STOP ").partition(":")[0] for word in words] == codes


@pytest.mark.parametrize(("messages", "codes"), CASES)
def test_the_summary_and_the_black_box_keep_each_stop_once(messages, codes):
    operator, box = Operator([], lambda code, cause: None), []
    operator.on_new_stop = lambda now, stop: box.append(stop.code)
    on_stop = operator.stop_sink("guard.stop")
    for now, message in enumerate(messages):
        (on_stop if isinstance(message, Stop) else operator.on_odometry)(now, message)
        in_force = [stop for stop in operator.stops_in_force.values() if stop.code]
        if isinstance(message, Stop):  # what holds the robot is another question
            assert bool(in_force) == bool(message.code)
    begun = [code for code in codes if not code.startswith("-")]
    assert [stop.code for stop in operator.stops] == box == begun


@pytest.mark.parametrize(("messages", "codes"), CASES)
def test_the_metrics_of_a_recording_count_each_stop_once(messages, codes):
    metrics = MetricsAccumulator()
    for now, message in enumerate(messages):
        wire = "guard.stop" if isinstance(message, Stop) else "odometry.odometry"
        metrics.take(now, wire, message)
    assert metrics.metrics().stops == sum(not code.startswith("-") for code in codes)


def test_the_state_between_two_instants_is_kept():
    book = Logbook()
    graph = Graph([Node("guard", Guard(), {"given": "drive.stop"})], {"drive.stop": Stop}, book)
    logger, again = EventLogger(graph, book), EventLogger(graph, book)
    logger.places.move(at(1.0))
    assert logger.places.begins("guard", WALL)
    again.restore(logger.state())
    assert not again.places.begins("guard", WALL)


@pytest.mark.parametrize("seed", [1, 3])
def test_a_goal_behind_a_wall_is_given_up_after_the_patience(seed):
    """The scanner's guard releases it and stops it again: the waits at one place are one."""
    words = ["run", "goal", "--robot", "turtlebot3_burger", "--fast", "--json", "--goal", "2 0 0"]
    wall = "world.walls=[{from: [0.8 m, -1 m], to: [0.8 m, 1 m]}]"
    done = CliRunner().invoke(
        program, [*words, "--seed", str(seed), "--set", wall], standalone_mode=False
    )
    result = json.loads(done.stdout)
    assert result["exit_code"] == 1 and "blocked" in result["cause"]
    assert [stop["code"] for stop in result["stops"]] == ["obstacle"]
    assert result["duration"] < 3.7 + 4.5 + 1.5  # it stands there after 3.7 s


ASKED = Stop(0, "operator_stop", "asked", True)


@pytest.mark.parametrize("request_wire", ["operator.halt", "robot.stop"])
@pytest.mark.parametrize(
    ("messages", "in_force"),
    [
        ({"gate.stop": ASKED}, ["operator_stop"]),
        ({"gate.stop": FREE}, []),  # after `resume`
        ({"guard.stop": WALL, "gate.stop": ASKED}, ["operator_stop", "obstacle"]),
        ({"guard.stop": WALL, "gate.stop": FREE}, ["obstacle"]),
    ],
)
def test_the_request_of_a_stop_is_not_in_force_after_resume(request_wire, messages, in_force):
    found = stops_in_force({request_wire: ASKED, **messages})
    assert [stop.code for _, stop in found] == in_force
    shown = active_stop(RunSnapshot(9, {request_wire: ASKED, **messages}, 0, 0))
    assert (shown.code if shown else None) == next(iter(in_force), None)
