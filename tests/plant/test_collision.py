"""Distance from a robot's outline to the world, by hand and against many single points."""

from math import cos, inf, pi, sin, sqrt

import pytest
from hypothesis import given
from hypothesis import strategies as st

from diffbotctl.plant.chassis import Pose
from diffbotctl.plant.collision import BodyOutline, clearance
from diffbotctl.plant.world import Pillar, Wall, World

OUTLINE = BodyOutline(0.1, 0.2, 0.1)  # reaches 0.1 ahead, 0.2 back, 0.1 to either side
HERE = Pose()

CASES = [
    (Wall(0.5, -1, 0.5, 1), HERE, 0.4),  # ahead of the front
    (Wall(-0.5, -1, -0.5, 1), HERE, 0.3),  # behind the back
    (Wall(-1, 0.3, 1, 0.3), HERE, 0.2),  # to the left
    (Wall(0.05, 0.05, 0.06, 0.05), HERE, 0.0),  # wholly inside
    (Wall(-1, 0, 1, 0), HERE, 0.0),  # through and through
    (Wall(0.4, 0.5, 0.4, 1), HERE, 0.5),  # its end, off the front left corner: 0.3 and 0.4
    # across the corner (0.1, 0.1): the line x + y = 1 is 0.8 / sqrt 2 away
    (Wall(1, 0, 0, 1), HERE, 0.8 / sqrt(2)),
    # turned left by 90 deg the front looks along y: 0.1 of 0.5 m
    (Wall(-1, 0.5, 1, 0.5), Pose(0, 0, pi / 2), 0.4),
    # and its left side looks along -x
    (Wall(-0.5, -1, -0.5, 1), Pose(0, 0, pi / 2), 0.4),
    (Pillar(0.5, 0, 0.1), HERE, 0.3),
    (Pillar(0.4, 0.5, 0.1), HERE, 0.4),  # 0.3 and 0.4 off the corner, less its radius
    (Pillar(0, 0, 0.05), HERE, 0.0),
    (Pillar(1.5, 2, 0.1), Pose(1, 2, 0), 0.3),
]


@pytest.mark.parametrize(("thing", "pose", "expected"), CASES)
def test_by_hand(thing, pose, expected):
    world = World([thing]) if isinstance(thing, Wall) else World([], [thing])
    assert clearance(OUTLINE, pose, world) == pytest.approx(expected, abs=1e-12)
    assert clearance(OUTLINE, pose, world, within=0.2) == pytest.approx(min(expected, 0.2))


def test_an_empty_world_is_infinitely_far_away():
    assert clearance(OUTLINE, HERE, World()) == inf


@given(*[st.floats(-1, 1)] * 6, st.floats(-4, 4))
def test_no_point_of_a_wall_is_nearer(x1, y1, x2, y2, x, y, heading):
    found = clearance(OUTLINE, Pose(x, y, heading), World([Wall(x1, y1, x2, y2)]))
    parts = [i / 200 for i in range(201)]
    points = [(x1 + part * (x2 - x1) - x, y1 + part * (y2 - y1) - y) for part in parts]
    ahead, aside = cos(heading), sin(heading)
    nearest = min(
        OUTLINE.to_point(px * ahead + py * aside, py * ahead - px * aside) for px, py in points
    )
    assert found <= nearest + 1e-9
    assert nearest - found <= 0.01  # half of the longest wall's two hundredth part, and more
