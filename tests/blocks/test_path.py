"""Paths: the square either way round, waypoints, and once more when asked."""

from math import pi

import pytest

from diffbotctl.blocks.path import PathSource
from diffbotctl.messages import Goal

# The first side along x; the second to the left (+y) when it goes counter-clockwise.
COUNTER_CLOCKWISE = [(2.0, 0.0), (2.0, 2.0), (0.0, 2.0), (0.0, 0.0)]
CLOCKWISE = [(2.0, 0.0), (2.0, -2.0), (0.0, -2.0), (0.0, 0.0)]


@pytest.mark.parametrize(
    "values, points, heading",
    [
        ({"side": 2.0}, COUNTER_CLOCKWISE, 0.0),
        ({"side": 2.0, "direction": "clockwise"}, CLOCKWISE, 0.0),
        ({"side": 2.0, "loops": 2}, COUNTER_CLOCKWISE * 2, 0.0),
        # The last leg of these goes straight left, then straight back.
        ({"shape": "waypoints", "waypoints": [(1.0, 0.0), (1.0, 1.0)]}, [(1, 0), (1, 1)], pi / 2),
        ({"shape": "waypoints", "waypoints": [(1.0, 0.5), (0.0, 0.5)]}, [(1, 0.5), (0, 0.5)], pi),
        ({"shape": "waypoints", "waypoints": [(1.0, 0.0)]}, [(1, 0)], None),  # no leg, no heading
        ({"shape": "waypoints"}, [], None),
    ],
)
def test_goals(values, points, heading):
    path = PathSource(**values).react(7, 5)
    assert path.time == 5
    assert [(g.x, g.y) for g in path.goals] == points
    assert [g.number for g in path.goals] == list(range(1, len(points) + 1))
    assert [g.heading for g in path.goals[:-1]] == [None] * max(len(points) - 1, 0)
    if points:
        assert path.goals[-1] == Goal(5, len(points), *points[-1], heading)


def test_it_speaks_once_and_again_when_asked():
    block = PathSource()
    assert block.react(1, None) is None  # not before its timer
    first = block.react(2, 2)
    assert len(first.goals) == 4
    assert block.react(3, 3) is None
    block.again(3)
    assert [g[1:] for g in block.react(4, 4).goals] == [g[1:] for g in first.goals]
    assert block.react(5, 5) is None
