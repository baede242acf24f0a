"""Where am I: in the right map, in places that look alike, and in the map of another place."""

import numpy as np
import pytest

from diffbotctl.mapping.mapper import Mapper, MapperParameters, MapperState
from diffbotctl.mapping.plane_pose import between, compose
from diffbotctl.mapping.scan_map import Map
from tests.support.rooms import Robot, box, polyline

ROOMS = [
    *box(0.0, 0.0, 7.0, 5.0),
    (3.0, 0.0, 3.0, 2.0),
    (3.0, 2.9, 3.0, 5.0),
    *box(4.6, 0.1, 0.9, 0.5),
    *box(0.1, 3.6, 0.6, 0.8),
    (5.2, 3.4, 7.0, 3.4),
]
WAY = [(1.0, 1.0), (1.0, 2.45), (4.0, 2.45), (4.2, 4.3), (4.2, 1.2), (6.2, 1.3), (6.2, 2.6)]
ORIGIN = next(polyline(WAY, 0.05, 0.15))  # of the map, whose first pose is that of odom
HALF_TURN = [
    *box(0, 0, 8, 5),
    (3, 0, 3, 2),
    (5, 5, 5, 3),
    *box(1, 1, 0.5, 0.4),
    *box(6.5, 3.6, 0.5, 0.4),
]
QUARTER_TURN = [
    *box(0, 0, 6, 6),
    *(wall for x in (1.5, 4.1) for y in (1.5, 4.1) for wall in box(x, y, 0.4, 0.4)),
]
OTHER = [*box(0, 0, 5.5, 6.2), (0, 2.6, 2.2, 2.6), (3.1, 2.6, 5.5, 2.6), *box(4.4, 5.2, 0.8, 0.6)]


def map_of(walls, way):
    mapper = Mapper(MapperParameters())
    for scan in Robot(walls, seed=3).drive(polyline(way, 0.05, 0.15)):
        mapper.add(scan)
    while mapper.work(60):
        pass
    return mapper.map()


@pytest.fixture(scope="module")
def rooms():
    return map_of(ROOMS, WAY)


def turning(pose, scans, speed=0.015):
    """Gentle motion: an arc at 0.15 m/s and 0.5 rad/s."""
    for _ in range(scans):
        yield pose
        pose = compose(pose, [speed, 0.0, 0.05])


def answers(saved, walls, pose, scans, seed=0):
    """The correction for each scan, and the true pose in the frame of the walls."""
    mapper = Mapper(MapperParameters(), saved)
    robot = Robot(walls, seed=seed)
    return [(mapper.add(robot.scan(each)), each) for each in turning(np.array(pose), scans)]


STARTS = [(1.2, 0.8, 2.0), (1.5, 3.0, -1.0), (3.9, 1.4, 0.5), (6.0, 0.9, 3.0), (4.4, 4.2, -2.5)]


@pytest.mark.parametrize("pose", STARTS)
def test_the_place_is_found_within_three_seconds(rooms, pose):
    found = answers(rooms, ROOMS, pose, 31)
    assert found[-1][0].state == MapperState.LOCALISED
    correction, true = found[-1]
    error = between(between(ORIGIN, true), correction.pose)
    assert np.abs(error) == pytest.approx([0, 0, 0], abs=0.08)


@pytest.mark.parametrize("pose", STARTS[2:4])
def test_the_place_is_found_and_followed_in_a_map_of_cells_alone(rooms, pose):
    grid = rooms.grid()
    cells = Map(grid.resolution, (), np.zeros((0, 3)), grid)
    found = answers(cells, ROOMS, pose, 61)
    assert found[30][0].state == found[-1][0].state == MapperState.LOCALISED
    correction, true = found[-1]
    error = between(between(ORIGIN, true), correction.pose)
    assert np.abs(error) == pytest.approx([0, 0, 0], abs=0.08)


@pytest.mark.parametrize("pose", STARTS[:2])
def test_a_robot_that_stands_makes_no_claim(rooms, pose):
    robot = Robot(ROOMS)
    mapper = Mapper(MapperParameters(), rooms)
    states = {mapper.add(robot.scan(np.array(pose))).state for _ in range(30)}
    assert states == {MapperState.SEARCHING}


@pytest.mark.parametrize(
    ("walls", "way", "count"),
    [
        (
            HALF_TURN,
            [(0.6, 2.5), (4, 2.5), (4, 0.7), (7.2, 0.7), (7.2, 3), (4, 2.6), (4, 4.3), (0.8, 4.3)],
            2,
        ),
        (QUARTER_TURN, [(0.8, 0.8), (5.2, 0.8), (5.2, 5.2), (0.8, 5.2), (0.8, 0.8), (3, 3)], 4),
    ],
    ids=["half_turn", "quarter_turn"],
)
def test_places_that_look_alike_are_listed_and_the_answer_decides(walls, way, count):
    saved = map_of(walls, way)
    start = np.array([2.3, 3.0, 0.4])
    mapper = Mapper(MapperParameters(), saved)
    robot = Robot(walls, seed=9)
    poses = list(turning(start, 40))
    for pose in poses:
        correction = mapper.add(robot.scan(pose))
        assert correction.state in (MapperState.SEARCHING, MapperState.AMBIGUOUS)
    assert correction.state == MapperState.AMBIGUOUS
    assert len(correction.places) == count
    assert correction.covariance[0, 0] > 100
    origin = np.array([*way[0], 0.0])
    true = between(origin, poses[-1])
    assert min(np.abs(between(true, each)).max() for each in correction.places) < 0.1
    mapper.answer(true + np.array([0.4, -0.3, 0.0]), np.diag([0.3, 0.3, 0.4]) ** 2)
    correction = mapper.add(robot.scan(poses[-1]))
    assert correction.state == MapperState.LOCALISED
    assert np.abs(between(true, correction.pose)).max() < 0.05


@pytest.mark.parametrize("pose", [(1.0, 1.2, 0.3), (4.5, 1.0, 2.0), (2.5, 4.5, -1.0)])
def test_nothing_is_claimed_in_the_map_of_another_place(rooms, pose):
    states = [each.state for each, _ in answers(rooms, OTHER, pose, 80)]
    assert MapperState.LOCALISED not in states
    assert states[-1] in (MapperState.LOST, MapperState.AMBIGUOUS)


@pytest.mark.parametrize("is_saved", [True, False])
@pytest.mark.parametrize(("speed", "scans"), [(0.015, 60), (0.06, 30)])
def test_a_robot_that_was_put_elsewhere_notices_and_is_found_again(rooms, is_saved, speed, scans):
    robot = Robot(ROOMS, seed=3)
    mapper = Mapper(MapperParameters(), rooms if is_saved else None)
    for pose in polyline(WAY, 0.05, 0.15):
        correction = mapper.add(robot.scan(pose))
    assert correction.state == (MapperState.LOCALISED if is_saved else MapperState.MAPPING)
    kept = len(mapper.map().scans)
    robot.pose = None  # lifted: the wheels did not turn
    states = []
    for pose in turning(np.array([1.2, 0.8, 2.0]), scans, speed):
        correction = mapper.add(robot.scan(pose))
        states.append(correction.state)
    assert MapperState.LOST in states[:10]
    assert states[-1] == (MapperState.LOCALISED if is_saved else MapperState.MAPPING)
    assert np.abs(between(between(ORIGIN, pose), correction.pose)).max() < 0.08
    assert len(mapper.map().scans) < kept + 12


@pytest.mark.parametrize("turned", [0.0, 1.0, 2.0, 3.1, -2.0])
@pytest.mark.parametrize("place", [each[:2] for each in STARTS])
def test_a_robot_that_was_put_elsewhere_claims_no_wrong_place(rooms, place, turned):
    robot, mapper = Robot(ROOMS, seed=3), Mapper(MapperParameters(), rooms)
    for pose in polyline(WAY, 0.05, 0.15):
        mapper.add(robot.scan(pose))
    robot.pose = None
    for number, pose in enumerate(turning(np.array([*place, turned]), 40)):
        correction = mapper.add(robot.scan(pose))
        far = np.abs(between(between(ORIGIN, pose), correction.pose)).max()
        assert number < 8 or correction.state != MapperState.LOCALISED or far < 0.2


def test_a_lost_robot_that_stands_is_found_where_a_person_points(rooms):
    robot, mapper, put = Robot(ROOMS, seed=3), Mapper(MapperParameters()), np.array([1.2, 0.8, 2.0])
    for pose in polyline(WAY, 0.05, 0.15):
        mapper.add(robot.scan(pose))
    robot.pose = None
    for _ in range(8):
        state = mapper.add(robot.scan(put)).state
    assert state == MapperState.LOST
    true = between(ORIGIN, put)
    any_heading = np.diag([0.2, 0.2, np.pi]) ** 2
    assert not mapper.answer(true + np.array([20.0, 0.0, 0.0]), any_heading)
    assert mapper.add(robot.scan(put)).state == MapperState.LOST
    assert mapper.answer(true + np.array([0.3, -0.3, 2.0]), any_heading)
    correction = mapper.add(robot.scan(put))
    assert correction.state == MapperState.MAPPING
    assert np.abs(between(true, correction.pose)).max() < 0.05


@pytest.mark.parametrize("pose", [(1.0, 1.2, 0.3), (4.5, 1.0, 2.0)])
def test_a_robot_put_where_no_map_is_yet_does_not_spoil_the_map(pose):
    robot = Robot(ROOMS, seed=21)
    mapper = Mapper(MapperParameters())
    for each in polyline(WAY, 0.05, 0.15):
        mapper.add(robot.scan(each))
    kept = len(mapper.map().scans)
    robot.pose, robot.walls = None, OTHER
    states = [mapper.add(robot.scan(each)).state for each in turning(np.array(pose), 80)]
    assert set(states[8:]) == {MapperState.LOST}
    assert len(mapper.map().scans) <= kept + 1
