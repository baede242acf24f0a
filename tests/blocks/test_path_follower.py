"""The path follower: its target, its arcs, and the end of the path."""

from math import pi

import pytest

from diffbotctl.blocks.path_follower import PathFollower, ahead_of, arc_to, in_body_frame
from diffbotctl.messages import Goal, Odometry, Path

STANDING = (0.0, 0.0)


def pose(x, y, heading=0.0):
    return Odometry(1, x, y, heading, 0.0, 0.0, (0.0,) * 6)


@pytest.fixture
def follower():
    return PathFollower(speed_max=0.3, turn_rate=4.0)


def path(*points, time=0):
    return Path(time, tuple(Goal(time, n, x, y) for n, (x, y) in enumerate(points, 1)))


@pytest.mark.parametrize(
    ("ahead", "left", "expected"),
    [
        (0.1, 0.0, (0.15, 0.0)),
        (0.1, 0.1, (0.15, 0.15 * 2 * 0.1 / 0.02)),  # a quarter of a circle with radius 0.1 m
        (0.1, -0.1, (0.15, -1.5)),
        (0.0, 0.1, (0.0, 2.0)),  # beside the robot: turn on the spot, at half the turn rate
        (-0.1, -0.01, (0.0, -2.0)),
        (0.01, 0.019, (4.0 / (0.038 / 0.000461), 4.0)),  # so tight that the turn rate limits it
    ],
)
def test_the_arc_leads_to_the_target(ahead, left, expected):
    assert arc_to(ahead, left, 0.15, 4.0) == pytest.approx(expected)


def test_the_target_moves_along_the_path_and_never_back():
    points = [(0.0, 0.0), (0.2, 0.0), (0.2, 0.2)]
    first, *rest = ahead_of((0.0, 0.0), points, 0.1)
    assert first == pytest.approx((0.1, 0.0), abs=0.006) and rest == points[1:]
    first, *rest = ahead_of((0.19, 0.0), [first, *rest], 0.1)
    assert first == pytest.approx((0.2, 0.1), abs=0.006) and rest == points[2:]
    assert ahead_of((0.0, 0.0), [first, *rest], 0.1) == [first, *rest]
    assert ahead_of((0.2, 0.15), [first, *rest], 0.1) == [(0.2, 0.2)]


def test_a_point_in_the_frame_of_the_robot():
    assert in_body_frame((1.0, 3.0), pose(1.0, 2.0, pi / 2)) == pytest.approx((1.0, 0.0))
    assert in_body_frame((0.0, 2.0), pose(1.0, 2.0, pi / 2)) == pytest.approx((0.0, 1.0))


def test_it_stands_at_the_end_until_another_path_comes(follower):
    first = path((1.0, 0.0))
    assert follower.react(0, None, pose(0.0, 0.0)) is None
    for x in range(0, 90, 10):
        assert follower.react(0, first, pose(x / 100, 0.0))[1:] == (0.15, 0.0)
    slow = follower.react(0, first, pose(0.96, 0.0))
    assert slow.linear == pytest.approx(0.08)
    assert follower.react(0, first, pose(0.985, 0.0))[1:] == STANDING
    assert follower.react(0, first, pose(0.5, 0.0))[1:] == STANDING  # it does not go back
    assert follower.react(0, path((1.0, 0.0), time=1), pose(0.5, 0.0))[1:] == (0.15, 0.0)
    assert follower.react(0, path(time=2), pose(0.5, 0.0))[1:] == STANDING  # an empty path
