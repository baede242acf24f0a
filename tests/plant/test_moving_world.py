"""Glass, and what moves: chairs that are put elsewhere, people that walk."""

from math import inf, pi, radians

import pytest

from diffbotctl.config.configuration import ObstacleEntry, WallEntry, WorldEntry
from diffbotctl.plant.world import MovingPillar, Wall, World, build_world

PANE = Wall(1.0, -5.0, 1.0, 5.0)
BEHIND = Wall(3.0, -50.0, 3.0, 50.0)


@pytest.mark.parametrize(
    ("degrees", "light", "sound"),
    [(0, 1.0, 1.0), (14, 1.031, 1.031), (16, 3.121, 1.040), (-40, 3.916, 1.305), (180, inf, inf)],
)
def test_light_passes_glass_but_near_its_normal(degrees, light, sound):
    world = World([PANE, BEHIND], glass=[PANE])
    bearing = radians(degrees)
    assert world.distance(0.0, 0.0, bearing) == pytest.approx(light, abs=1e-3)
    assert world.distance(0.0, 0.0, bearing, is_light=False) == pytest.approx(sound, abs=1e-3)
    near = world.towards(0.0, 0.0, bearing, 0.1)
    assert near.distance(0.0, 0.0, bearing) == pytest.approx(light, abs=1e-3)


CHAIR = MovingPillar(0.2, ((1.0, 0.0), (1.0, 2.0)), 10.0, 0.5, False)
PERSON = MovingPillar(0.2, ((0.0, 1.0), (3.0, 1.0)), 2.0, 1.0, True)


@pytest.mark.parametrize(
    ("pillar", "time", "place"),
    [
        (CHAIR, 0.0, (1.0, 0.0)),
        (CHAIR, 12.0, (1.0, 1.0)),
        (CHAIR, 100.0, (1.0, 2.0)),
        (PERSON, 1.0, (0.0, 1.0)),
        (PERSON, 4.0, (2.0, 1.0)),
        (PERSON, 6.0, (2.0, 1.0)),
        (PERSON, 10.0, (2.0, 1.0)),
    ],
)
def test_what_moves_is_where_it_is_then(pillar, time, place):
    assert pillar.at(time)[:2] == pytest.approx(place)
    world = World(moving=[pillar])
    assert not world.empty
    x, y = place
    assert world.at(time).distance(x - 1.0, y, 0.0) == pytest.approx(0.8)
    assert world.at(time).distance(x, y - 1.0, pi / 2) == pytest.approx(0.8)


def test_a_file_states_glass_and_what_moves():
    entry = WorldEntry(
        walls=[
            WallEntry(start=(1.0, -5.0), end=(1.0, 5.0), glass=True),
            WallEntry(start=(3.0, -50.0), end=(3.0, 50.0)),
        ],
        obstacles=[ObstacleEntry(at=(0.0, 1.0), radius=0.2, path=[(0.0, 3.0)], begin=5.0)],
    )
    world = build_world(entry)
    assert world.at(0.0).distance(0.0, 0.0, pi / 2) == pytest.approx(0.8)
    assert world.at(60.0).distance(0.0, 0.0, pi / 2) == pytest.approx(2.8)
    assert world.distance(0.0, 0.0, radians(40)) == pytest.approx(3.916, abs=1e-3)
