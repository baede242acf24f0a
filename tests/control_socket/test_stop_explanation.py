"""Which of several stops `why` explains: the cause, and not what follows from it."""

import pytest

from diffbotctl.config.load import load
from diffbotctl.control_socket.engine_channel import EngineUpdate
from diffbotctl.control_socket.run_state import RunState
from diffbotctl.control_socket.stop_explanation import explain_stop
from diffbotctl.messages import Link, Odometry, Stop
from diffbotctl.runs.build_graph import assemble
from diffbotctl.time import MILLISECOND, SECOND

GRAPH = assemble(load("goal"), False).graph
MS = MILLISECOND
COVARIANCE = (0.0,) * 6
NONE = Stop(0, "", "", False)
LOST = Stop(0, "link_lost", "the cable is out", True)
OLD = Stop(0, "telemetry_stale", "no telemetry for 250 ms", False)
SILENT = Stop(0, "range_stale", "no fresh distance", False)
WALL = Stop(0, "obstacle", "a wall", False)
HALT = Stop(0, "wheel_runaway", "left", True)


def state_after(*events):
    """The state after events of (time, wire, message), of a whole run of the pipeline goal."""
    state = RunState(GRAPH)
    wires = list(GRAPH.kinds)
    instants = []
    for time, wire, message in events:
        own = [message._replace(time=time) if each == wire else None for each in wires]
        instants.append((time, *own))
    state.update(EngineUpdate(0, instants, []))
    return state


GATE, GUARD = "gate.stop", "guard.stop"


@pytest.mark.parametrize(
    ("link", "sentence"),
    [
        ("up", "No goal is under way."),
        ("negotiating", "The link to the board is not up (negotiating): no answer."),
    ],
)
def test_a_robot_that_nothing_has_stopped(link, sentence):
    state = state_after((MS, "robot.link", Link(0, link, 0, 0, cause="no answer")))
    assert explain_stop(state, GRAPH).summary.endswith(sentence)


@pytest.mark.parametrize(
    ("events", "explained"),
    [
        # The port is gone: the sensor's silence is noticed after the link's end.
        ([(1, GATE, LOST), (100, GUARD, SILENT)], "gate stopped the robot: link_lost"),
        # The board falls silent: the link is given up last.
        ([(1, GUARD, SILENT), (90, GATE, OLD), (900, GATE, LOST)], "link_lost"),
        ([(1, GATE, OLD), (90, GUARD, SILENT)], "telemetry_stale"),
        # Afterwards: the link is back, and somebody has typed `resume`.
        ([(1, GATE, LOST), (9, GUARD, SILENT), (20, GUARD, NONE), (30, GATE, NONE)], "link_lost"),
        # A wall, long after the link.
        ([(1, GATE, LOST), (20, GATE, NONE), (30, GUARD, WALL)], "guard stopped the robot: obst"),
        ([(1, GATE, LOST), (9, GUARD, SILENT), (20, GATE, NONE), (30, GUARD, WALL)], "obstacle"),
        ([(1, GUARD, WALL), (20, GATE, HALT)], "gate stopped the robot: wheel_runaway"),
    ],
)
def test_the_cause_is_explained(events, explained):
    state = state_after(*((time * MS, wire, message) for time, wire, message in events))
    summary, text = explain_stop(state, GRAPH)
    assert summary.endswith((" again.", "`diffbotctl resume`.", "the cause ends.")), summary
    assert explained in text and text.count("stopped the robot") == 1


@pytest.mark.parametrize(
    ("age", "explanation"),
    [(0.4, "The wheels are still turning."), (1.5, "the last odometry is 1.5 s old")],
)
def test_old_odometry_is_not_taken_for_the_motion_now(age, explanation):
    moving = Odometry(0, 0.0, 0.0, 0.0, linear=0.2, angular=0.0, covariance=COVARIANCE)
    end = SECOND + round(age * SECOND)
    state = state_after((SECOND, "odometry.odometry", moving), (end, GATE, LOST))
    assert explanation in explain_stop(state, GRAPH).text
