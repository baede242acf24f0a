"""Squares and waypoints."""

from math import pi

import pytest

from diffbotctl.block import actions
from diffbotctl.blocks.path import PathSource, last_heading, square


def test_the_square_ends_at_its_start():
    assert square(0.5, is_clockwise=False) == [(0.5, 0.0), (0.5, 0.5), (0.0, 0.5), (0.0, 0.0)]
    assert square(0.5, is_clockwise=True) == [(0.5, 0.0), (0.5, -0.5), (0.0, -0.5), (0.0, 0.0)]


@pytest.mark.parametrize(
    "points, heading",
    [
        ([], None),
        ([(1, 0)], None),
        ([(0, 0), (1, 0)], 0.0),
        ([(0, 0), (0, 1)], pi / 2),
        ([(5, 5), (0, 0), (-1, 0)], pi),
    ],
)
def test_the_last_leg_gives_the_heading(points, heading):
    assert last_heading(points) == (None if heading is None else pytest.approx(heading))


def test_the_path_is_sent_once_and_again_on_the_action():
    path = PathSource(side=1.0, loops=2)
    assert path.react(50, None) is None
    given = path.react(100, 100)
    assert [goal.number for goal in given.goals] == [1, 2, 3, 4, 5, 6, 7, 8]
    assert [goal.heading for goal in given.goals] == [None] * 7 + [0.0]
    assert path.react(200, 200) is None
    actions(PathSource)["again"](path, 250)
    assert path.react(300, 300).goals[0] == given.goals[0]._replace(time=300)


def test_waypoints():
    path = PathSource(shape="waypoints", waypoints=[(1.0, 0.0), (1.0, 2.0)])
    goals = path.react(100, 100).goals
    assert [(goal.x, goal.y) for goal in goals] == [(1.0, 0.0), (1.0, 2.0)]
    assert goals[1].heading == pytest.approx(pi / 2)
