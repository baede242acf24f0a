"""Rays against walls and round obstacles, by hand."""

from math import cos, hypot, inf, pi, sin, sqrt

import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from diffbotctl.plant.world import Pillar, Wall, World

AHEAD = Wall(1.0, -1.0, 1.0, 1.0)  # across the x axis, 1 m away


@pytest.mark.parametrize(
    "wall, x, y, degrees, distance",
    [
        (AHEAD, 0.0, 0.0, 0, 1.0),
        (AHEAD, 0.25, 0.5, 0, 0.75),
        (AHEAD, 0.0, 0.0, 44.9, 1 / cos(44.9 * pi / 180)),  # it ends at 45 deg
        (AHEAD, 0.0, 0.0, 45.1, inf),
        (AHEAD, 0.0, 1.01, 0, inf),  # past its end
        (AHEAD, 0.0, 0.0, 180, inf),  # behind
        (AHEAD, 2.0, 0.0, 180, 1.0),  # from the other side
        (AHEAD, 1.0, -2.0, 90, inf),  # along it: no thickness to be seen
        (Wall(0.0, 1.0, 1.0, 0.0), 0.0, 0.0, 45, sqrt(0.5)),  # a slant wall, square on
        (Wall(0.0, 1.0, 1.0, 0.0), 0.0, 0.0, 0, 1.0),
        (Wall(1.0, 1.0, 1.0, -1.0), 0.0, 0.0, 0, 1.0),  # drawn the other way round
        (Wall(-1.0, 2.0, 1.0, 2.0), 0.0, 0.0, 90, 2.0),
    ],
)
def test_walls(wall, x, y, degrees, distance):
    assert World([wall]).distance(x, y, degrees * pi / 180) == pytest.approx(distance)


@pytest.mark.parametrize(
    "x, y, degrees, distance",  # a pole of 0.2 m radius about (1, 0)
    [
        (0.0, 0.0, 0, 0.8),
        # 0.12 m off its middle the pole is sqrt(0.2^2 - 0.12^2) = 0.16 m deep on either side.
        (0.0, 0.12, 0, 0.84),
        (0.0, -0.12, 0, 0.84),
        (0.0, 0.21, 0, inf),
        (0.0, 0.0, 180, inf),
        (2.0, 0.0, 180, 0.8),
        (1.0, -1.0, 90, 0.8),
        (0.9, 0.0, 0, 0.0),  # inside
        (0.9, 0.0, 180, 0.0),
        # Seen from (0, 0) the pole's edge stands at asin 0.2 = 11.54 deg.
        (0.0, 0.0, 11.5, cos(11.5 * pi / 180) - sqrt(0.04 - sin(11.5 * pi / 180) ** 2)),
        (0.0, 0.0, 11.6, inf),
    ],
)
def test_round_obstacles(x, y, degrees, distance):
    world = World(pillars=[Pillar(1.0, 0.0, 0.2)])
    assert world.distance(x, y, degrees * pi / 180) == pytest.approx(distance)


def test_the_nearest_obstacle_counts():
    world = World([AHEAD], [Pillar(0.5, 0.0, 0.1), Pillar(1.5, 0.0, 0.1)])
    assert world.distance(0.0, 0.0, 0.0) == pytest.approx(0.4)
    assert world.distance(0.7, 0.0, 0.0) == pytest.approx(0.3)


def test_an_empty_world():
    assert World().empty and World().distance(0.0, 0.0, 1.0) == inf
    assert not World([AHEAD]).empty


@given(st.floats(-5, 5), st.floats(-5, 5), st.floats(-pi, pi))
def test_a_room_is_closed_and_hits_lie_on_it(x, y, bearing):
    room = World([Wall(-6, -6, 6, -6), Wall(6, -6, 6, 6), Wall(6, 6, -6, 6), Wall(-6, 6, -6, -6)])
    far = room.distance(x, y, bearing)
    hit = max(abs(x + far * cos(bearing)), abs(y + far * sin(bearing)))
    assert hit == pytest.approx(6.0)


@given(
    st.floats(-3, 3),
    st.floats(-3, 3),
    st.floats(-7, 7),
    st.lists(st.tuples(*[st.floats(-4, 4)] * 4), max_size=4),
    st.lists(st.tuples(st.floats(-4, 4), st.floats(-4, 4), st.floats(0.05, 1)), max_size=4),
)
def test_nothing_is_missed_by_what_lies_towards_a_ray(x, y, heading, walls, rounds):
    for x1, y1, x2, y2 in walls:  # an eye on the wall's own line sees neither side of it
        length = hypot(x2 - x1, y2 - y1)
        assume(length > 1e-3)
        assume(abs((x1 - x) * (y2 - y1) - (y1 - y) * (x2 - x1)) / length > 1e-3)
    world = World([Wall(*each) for each in walls], [Pillar(*each) for each in rounds])
    for middle in range(4):
        bearing = heading + middle * pi / 2
        ahead = world.towards(x, y, bearing, pi / 4)
        for share in (-0.99, -0.4, 0.0, 0.5, 0.99):
            ray = bearing + share * pi / 4
            assert ahead.distance(x, y, ray) == world.distance(x, y, ray)


def test_a_field_has_four_walls_and_limits_positions():
    world = World(field=(4.0, 3.0))
    # from (1, 1): right 3, up 2, left 1, down 1
    seen = [world.distance(1.0, 1.0, side * pi / 2) for side in range(4)]
    assert seen == pytest.approx([3.0, 2.0, 1.0, 1.0])
    assert world.kept(5.0, -1.0) == (4.0, 0.0)
    assert world.kept(1.0, 2.0) == (1.0, 2.0)
    assert World().kept(-9.0, 9.0) == (-9.0, 9.0)
