"""Which command counts: a person's before the pipeline's, and a stand in between."""

import pytest

from diffbotctl.blocks.command_mux import CommandMux
from diffbotctl.graph import Graph, Node
from diffbotctl.messages import Twist

MS = 1_000_000
OWN, PERSON = Twist(1, 0.2, 0.0), Twist(2, 0.0, 1.0)


@pytest.mark.parametrize(
    "teleop, autonomous, out",
    [
        (None, None, None),
        (None, OWN, OWN),
        (PERSON, None, Twist(9, 0.0, 1.0)),  # stamped anew: it counts for as long as it is held
        (PERSON, OWN, Twist(9, 0.0, 1.0)),
    ],
)
def test_selection(teleop, autonomous, out):
    assert CommandMux().react(9, teleop, autonomous) == out


def test_when_the_person_lets_go_it_stands_until_a_new_command_comes():
    mux = CommandMux()
    mux.react(1, PERSON, OWN)
    assert mux.react(2, None, OWN) == Twist(2, 0.0, 0.0)
    new = Twist(3, 0.1, 0.0)
    assert mux.react(3, None, new) is new


def test_in_a_graph_a_persons_command_outlives_its_400_ms_by_nothing():
    sources = {"operator.twist": Twist, "follower.twist": Twist}
    wires = {"teleop": "operator.twist", "autonomous": "follower.twist"}
    graph = Graph([Node("mux", CommandMux(), wires)], sources)
    heard = []
    compiled = graph.compile({"mux.twist": lambda now, twist: heard.append(twist)}, None)
    compiled.instant(0, None, OWN)
    compiled.instant(100 * MS, PERSON, None)
    assert compiled.due() == 500 * MS
    compiled.instant(499 * MS, None, OWN)  # still the person's
    compiled.instant(500 * MS, None, None)
    compiled.instant(600 * MS, None, OWN)
    assert heard == [
        OWN,
        PERSON._replace(time=100 * MS),
        PERSON._replace(time=499 * MS),
        Twist(500 * MS, 0.0, 0.0),
        OWN,
    ]
