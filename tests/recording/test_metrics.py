"""Metrics of small runs that were worked out by hand."""

import pytest

from diffbotctl.messages import Goal, GoalState, Odometry, Stop
from diffbotctl.recording.metrics import MetricsAccumulator
from diffbotctl.time import SECOND as S


def at(time, x, y):
    return time, "odometry.odometry", Odometry(time, x, y, 0.0, 0.0, 0.0, (0.0,) * 6)


def goal(time, number, x, y):
    return time, "operator.goal", Goal(time, number, x, y)


def state(time, number, name):
    return time, "follower.state", GoalState(time, number, name, 0.0, 0.0)


def stop(time, code, wire="guard.stop"):
    return time, wire, Stop(time, code, "because", False)


def measured(stops, truth=None):
    measure = MetricsAccumulator()
    for item in stops:
        measure.take(*item)
    return measure.metrics(truth)


@pytest.mark.parametrize(
    "stops, expected",
    [
        # From (0, 0) to (2, 0) by way of (1, 0.3): the bend is 0.3 m beside the line; both legs
        # are sqrt(1.09) m long, the first ends 0.3 m beside it and the second on it, so the mean
        # square over the distance is 0.09 / 2.
        (
            [goal(1, 1, 2.0, 0.0), at(2, 0, 0), at(3, 1, 0.3), at(4, 2, 0)],
            {"cross_track_max": 0.3, "cross_track_rms": (0.09 / 2) ** 0.5, "path": 2 * 1.09**0.5},
        ),
        # The goal's line begins where the robot was when the goal was given: along y = 1 here.
        (
            [at(1, 0, 1), goal(2, 1, 2.0, 1.0), at(3, 1, 1.25), at(4, 2, 1)],
            {"cross_track_max": 0.25, "final_error": 0.0},
        ),
        # A goal at the pose of the robot has no line: the distance from it counts.
        ([at(1, 0, 0), goal(2, 1, 0.0, 0.0), at(3, 0.3, 0.4)], {"cross_track_max": 0.5}),
        # What is driven after the goal was reached belongs to no goal, but to the path.
        (
            [
                goal(1, 1, 1.0, 0.0),
                at(2, 0, 0),
                at(3, 1, 0),
                state(4, 1, "reached"),
                at(5, 1, 9),
            ],
            {"cross_track_max": 0.0, "path": 10.0, "final_error": 9.0},
        ),
        # Two goals: from the first one given at 1 s to the second one reached at 8 s. The states
        # in between, and the second word that goal 1 was reached, count for nothing.
        (
            [
                goal(S, 1, 1.0, 0.0),
                state(2 * S, 1, "driving"),
                state(4 * S, 1, "reached"),
                goal(4 * S + 1, 2, 1.0, 1.0),
                state(5 * S, 1, "reached"),
                state(8 * S, 2, "reached"),
            ],
            {"goals_reached": 2, "time_to_goal": 7.0, "path": None, "cross_track_max": None},
        ),
        # One stop that is repeated, its release, the same again; a driver's report of a stop is
        # repeated by a block, and the operator's is an echo.
        (
            [
                stop(1, "obstacle"),
                stop(2, "obstacle"),
                stop(3, ""),
                stop(4, "obstacle"),
                stop(5, "obstacle", "operator.stop"),
                stop(5, "link_lost", "robot.stop"),
                stop(6, "link_lost", "gate.stop"),
            ],
            {"stops": 3, "time_to_goal": None},
        ),
        # A withdrawn goal (number 0) changes nothing of the line to it.
        (
            [goal(1, 1, 2.0, 0.0), at(2, 0, 0), goal(3, 0, 0.0, 0.0), at(4, 1, 0.1)],
            {"cross_track_max": 0.1},
        ),
        ([], {"goals_reached": 0, "stops": 0, "path": None, "final_error": None}),
    ],
)
def test_metrics(stops, expected):
    result = measured(stops)
    for name, value in expected.items():
        assert getattr(result, name) == (value if value is None else pytest.approx(value)), name


def test_the_true_error_is_measured_from_the_last_goal():
    assert measured([goal(1, 1, 1.0, 1.0)], truth=(0.7, 0.6)).true_error == pytest.approx(0.5)
    assert measured([], truth=(0.7, 0.6)).true_error is None


def test_forget_keeps_the_pose_the_goal_and_the_stops():
    measure = MetricsAccumulator()
    for item in [goal(1, 1, 2.0, 0.0), at(2, 0, 0), at(3, 1, 0.5), stop(4, "obstacle")]:
        measure.take(*item)
    measure.forget()
    for item in [stop(5, "obstacle"), at(6, 1.5, 0.5)]:  # still held: no new stop
        measure.take(*item)
    result = measure.metrics()
    assert (result.stops, result.path) == (0, pytest.approx(0.5))
    assert result.cross_track_rms == pytest.approx(0.5)  # the line still begins at (0, 0)
