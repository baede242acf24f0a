"""Submaps that are joined in pairs, so that a long drive takes no more memory."""

from itertools import pairwise

import numpy as np
import pytest

from diffbotctl.mapping import map_builder
from diffbotctl.mapping.lidar_scan import MappedScan
from diffbotctl.mapping.mapper import Mapper, MapperParameters, MapperState
from diffbotctl.mapping.plane_pose import between, compose
from diffbotctl.mapping.pose_graph import PoseEdge
from diffbotctl.mapping.submaps import Submaps
from tests.mapping.test_mapper import FLAT, ROUND
from tests.support.rooms import Robot, polyline


@pytest.mark.parametrize("count", [6, 7])
def test_halving_keeps_the_poses_and_what_is_known_of_motions(count):
    random = np.random.default_rng(count)
    submaps = Submaps(random.normal(0, 1, 3))
    for i in range(10 * count):
        if i and i % 10 == 0:
            submaps.begin(random.normal(0, 1, 3), np.diag([0.1, 0.2, 0.05]) ** 2)
        points = random.normal(0, 3, (4, 2))
        scan = MappedScan(i, float(i), points, (0.0, 0.0), np.zeros(3), np.eye(3))
        submaps.add(scan, random.normal(0, 1, 3))
    graph = submaps.graph
    motion = between(graph.poses[1], graph.poses[4])
    wrong = motion + np.array([1.0, 0.0, 0.0])
    for each, weight in ((wrong, 0.2), (motion, 0.9)):
        graph.add_edge(PoseEdge(1, 4, each, np.diag([0.1, 0.2, 0.05]) ** 2, True))
        graph.weights[-1] = weight
    before = submaps.poses()
    submaps.halve()
    assert len(submaps.graph.poses) == -(-count // 2)
    assert submaps.poses() == pytest.approx(before[::2])
    for edge in submaps.graph.edges:
        seen = between(submaps.graph.poses[edge.first], submaps.graph.poses[edge.second])
        assert seen == pytest.approx(edge.motion)
        assert np.linalg.eigvalsh(edge.covariance) == pytest.approx([0.05**2, 0.1**2, 0.2**2])
    assert [edge.is_closure for edge in submaps.graph.edges].count(True) == 1


def test_the_pose_stays_right_while_submaps_are_halved(monkeypatch):
    monkeypatch.setattr(map_builder, "SUBMAPS_MAX", 8)
    robot, mapper = Robot(FLAT, seed=41), Mapper(MapperParameters())
    first, kept = None, []
    for pose in polyline([*ROUND, *reversed(ROUND[:-1]), *ROUND[1:]], 0.03, 0.1):
        first = pose if first is None else first
        correction = mapper.add(robot.scan(pose))
        error = between(between(first, pose), correction.pose)
        assert np.hypot(*error[:2]) < 0.06
        assert correction.state == MapperState.MAPPING
        kept.append(len(mapper.submaps.keyframes))
    assert sum(after < before for before, after in pairwise(kept)) > 1
    finished = mapper.map()
    assert len(finished.scans) == len(finished.poses) <= 100
    assert compose(correction.transform, robot.odometry) == pytest.approx(correction.pose)
