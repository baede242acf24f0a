"""The mapper in rooms whose walls are known."""

import numpy as np
import pytest

from diffbotctl.mapping.lidar_scan import MappedScan
from diffbotctl.mapping.mapper import Mapper, MapperParameters, MapperState
from diffbotctl.mapping.occupancy_grid import GridBuilder
from diffbotctl.mapping.plane_pose import between, compose
from tests.support.rooms import Robot, box, polyline

FLAT = [
    *box(0.0, 0.0, 6.0, 4.0),
    (2.5, 0.0, 2.5, 1.4),
    (2.5, 2.3, 2.5, 4.0),
    *box(4.0, 1.5, 0.6, 0.4),
    *box(0.3, 3.2, 0.9, 0.5),
]
ROUND = [(1.0, 0.8), (1.8, 1.85), (3.2, 1.85), (3.3, 3.2), (5.2, 3.2), (5.2, 0.8), (3.3, 0.8)]


def errors(mapper, robot, poses):
    """m and rad beside the truth, of each correction, and the corrections."""
    first, found, corrections = None, [], []
    for pose in poses:
        first = pose if first is None else first
        corrections.append(mapper.add(robot.scan(pose)))
        found.append(between(between(first, pose), corrections[-1].pose))
    found = np.array(found)
    return np.hypot(found[:, 0], found[:, 1]), np.abs(found[:, 2]), corrections


@pytest.mark.parametrize("reach", [3.5, 12.0])
@pytest.mark.parametrize("seed", [5, pytest.param(6, marks=pytest.mark.nightly)])
def test_the_pose_is_that_of_the_robot(reach, seed):
    robot = Robot(FLAT, reach=reach, seed=seed)
    way = list(polyline([*ROUND, *reversed(ROUND[:-1])], 0.03, 0.1))
    distance, turn, corrections = errors(Mapper(MapperParameters()), robot, way)
    odometry = between(between(way[0], way[-1]), robot.odometry)
    assert np.hypot(*odometry[:2]) > 0.1  # without scans
    assert np.sqrt((distance**2).mean()) < 0.015
    assert distance.max() < 0.06
    assert np.degrees(turn.max()) < 1.0
    assert {each.state for each in corrections} == {MapperState.MAPPING}


def test_scans_far_apart_are_matched_although_the_odometry_turns_wrongly():
    robot, turns = Robot(FLAT, reach=12.0), np.random.default_rng(4)
    mapper, first = Mapper(MapperParameters(keyframe_distance=0.0)), None
    for pose in polyline([*ROUND, *reversed(ROUND[:-1])], 1.0, 1.2):
        first = pose if first is None else first
        correction = mapper.add(robot.scan(pose, 1.0))
        error = between(between(first, pose), correction.pose)
        assert np.hypot(*error[:2]) < 0.06 and abs(error[2]) < 0.03
        robot.odometry[2] += turns.normal(0.0, 0.2)


def test_the_transform_is_that_of_odom_in_map():
    robot = Robot(FLAT)
    mapper = Mapper(MapperParameters())
    for scan in robot.drive(polyline(ROUND[:3], 0.05, 0.1)):
        correction = mapper.add(scan)
        assert compose(correction.transform, scan.odometry) == pytest.approx(correction.pose)


def test_same_scans_give_the_same_map_bit_for_bit():
    def run():
        mapper = Mapper(MapperParameters())
        corrections = [
            mapper.add(scan) for scan in Robot(FLAT).drive(polyline(ROUND[:4], 0.04, 0.1))
        ]
        return [each.pose.tobytes() for each in corrections], mapper.grid().cells.tobytes()

    assert run() == run()


def test_a_scan_out_of_order_changes_nothing():
    mapper = Mapper(MapperParameters())
    scans = list(Robot(FLAT).drive(polyline(ROUND[:3], 0.05, 0.1)))
    answers = [mapper.add(scan) for scan in scans]
    late = mapper.add(scans[3])
    assert late.version == answers[-1].version + 1
    assert late.pose == pytest.approx(answers[-1].pose)
    assert not late.changed_map


def test_the_grid_shows_the_walls():
    mapper = Mapper(MapperParameters())
    way = list(polyline(ROUND, 0.03, 0.1))
    for scan in Robot(FLAT).drive(way):
        mapper.add(scan)
    grid = mapper.grid()
    rows, columns = np.nonzero(grid.cells >= 65)
    in_map = np.c_[columns + 0.5, rows + 0.5] * grid.resolution + grid.origin
    in_world = np.array([compose(way[0], [*point, 0.0])[:2] for point in in_map])
    walls = np.array(FLAT)
    start, along = walls[:, :2], walls[:, 2:] - walls[:, :2]
    share = ((in_world[:, None] - start) * along).sum(-1) / (along**2).sum(-1)
    foot = start + np.clip(share, 0, 1)[..., None] * along
    beside = np.hypot(*(in_world[:, None] - foot).transpose(2, 0, 1)).min(1)
    assert len(beside) > 300
    assert np.mean(beside < 0.05) > 0.98


@pytest.mark.parametrize(
    ("end", "share"),
    [
        ((2.0, 0.0), 0.0),
        ((1.9, 0.0), 0.0),
        ((1.0, 0.0), 1.0),
        ((3.0, 0.0), 1.0),
        ((-2.0, 0.0), 0.0),
    ],
    ids=["on the wall", "close to it", "where it was free", "behind it", "where nothing is known"],
)
def test_a_ray_contradicts_the_map_through_a_wall_and_among_free_cells(end, share):
    """A wall 2 m ahead, from 1 m on the right to 1 m on the left; a lidar at the origin."""
    grid, known = GridBuilder(0.05), (np.zeros(3), np.zeros((3, 3)))
    wall = np.array([(2.0, y) for y in np.arange(-1.0, 1.01, 0.02)])
    for number in range(3):
        grid.insert(MappedScan(number, 0.1 * number, wall, (0.0, 0.0), *known), np.zeros(3))
    ray = MappedScan(9, 0.9, np.array([end], float), (0.0, 0.0), *known)
    assert grid.contradicted(ray, np.zeros(3)) == share
