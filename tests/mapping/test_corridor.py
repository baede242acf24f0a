"""Where a lidar sees nothing along one direction, and what moves in a room."""

import numpy as np
import pytest

from diffbotctl.mapping.lidar_scan import MappedScan
from diffbotctl.mapping.mapper import Mapper, MapperParameters, MapperState
from diffbotctl.mapping.plane_pose import between
from tests.support.rooms import Robot, box, polyline

CORRIDOR = [(-40.0, -0.7, 40.0, -0.7), (-40.0, 0.7, 40.0, 0.7)]
CHI_SQUARED_95 = 5.99  # 2 degrees of freedom


@pytest.mark.parametrize("scale", [0.97, 1.0, 1.03])
@pytest.mark.parametrize("seed", [1, pytest.param(2, marks=pytest.mark.nightly)])
def test_along_a_corridor_the_odometry_goes_on_and_the_covariance_grows(scale, seed):
    robot = Robot(CORRIDOR, reach=3.5, distance_scale=scale, slip=0.02, seed=seed)
    mapper = Mapper(MapperParameters())
    inside, along, across = [], [], []
    for pose in polyline([(0.0, 0.0), (20.0, 0.0)], 0.02, 0.1):
        correction = mapper.add(robot.scan(pose))
        error = (correction.pose - pose)[:2]
        covariance = correction.covariance[:2, :2]
        inside.append(
            error @ np.linalg.solve(covariance + 1e-9 * np.eye(2), error) < CHI_SQUARED_95
        )
        along.append(covariance[0, 0])
        across.append(correction.pose[1])
    assert np.mean(inside) >= 0.9
    assert correction.pose[0] == pytest.approx(robot.odometry[0], abs=0.15)
    assert np.abs(across).max() < 0.1
    assert along[-1] > 3 * along[len(along) // 4]


def test_without_a_scan_the_odometry_goes_on():
    robot = Robot(box(0, 0, 4, 3), seed=4)
    mapper = Mapper(MapperParameters())
    sigmas = []
    for i, pose in enumerate(polyline([(0.6, 1.5), (3.0, 1.5)], 0.03, 0.1)):
        scan = robot.scan(pose)
        if i > 10:
            scan = scan._replace(points=np.zeros((0, 2)))
        sigmas.append(np.sqrt(np.trace(mapper.add(scan).covariance[:2, :2])))
    assert (np.diff(sigmas[12:]) > 0).all()


def cell(mapper, at):
    """The most occupied cell of the grid beside a point in map."""
    grid = mapper.grid()
    column, row = np.floor((np.array(at) - grid.origin) / grid.resolution).astype(int)
    return int(grid.cells[row - 1 : row + 2, column - 1 : column + 2].max())


@pytest.mark.parametrize("is_saved", [True, False])
def test_a_chair_that_was_moved_is_gone_after_five_looks(is_saved):
    room, chair = box(0, 0, 5, 4), box(3.0, 1.9, 0.4, 0.4)
    robot = Robot([*room, *chair], seed=2)
    mapper = Mapper(MapperParameters())
    way = list(polyline([(0.6, 0.6), (2.0, 1.0), (1.5, 2.1)], 0.05, 0.2))
    for pose in way:
        correction = mapper.add(robot.scan(pose))
    face = between(way[0], [3.02, 2.1, 0.0])[:2]
    assert cell(mapper, face) >= 65
    if is_saved:
        mapper = Mapper(MapperParameters(), mapper.map())
        mapper.answer(correction.pose, np.diag([0.05, 0.05, 0.05]) ** 2)
    robot.walls = room
    looks = 0
    for _ in range(80):
        correction = mapper.add(robot.scan(pose))
        looks += correction.changed_map
        if cell(mapper, face) < 65:
            break
    assert correction.state in (MapperState.LOCALISED, MapperState.MAPPING)
    assert looks <= 5
    assert cell(mapper, face) < 65


def test_a_standing_robot_keeps_no_more_scans():
    robot = Robot(box(0, 0, 4, 3), seed=5)
    mapper = Mapper(MapperParameters())
    for _ in range(200):
        mapper.add(robot.scan(np.array([1.0, 1.0, 0.3])))
    assert len(mapper.map().scans) <= 6


@pytest.mark.parametrize("points", [0, 1, 3])
def test_scans_of_hardly_any_points_are_taken(points):
    mapper = Mapper(MapperParameters())
    for i in range(30):
        scan = MappedScan(
            *(i, 0.1 * i, np.ones((points, 2)), (0.0, 0.0)),
            *(np.array([0.05 * i, 0.0, 0.0]), np.zeros((3, 3))),
        )
        correction = mapper.add(scan)
    assert correction.pose == pytest.approx(scan.odometry, abs=0.3)
    mapper.grid()
