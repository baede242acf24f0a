"""Scans of a turning lidar: their points, moved to the middle of the turn by odometry."""

import cmath
import math
import re

import numpy as np
import pytest

from diffbotctl.config.load import load
from diffbotctl.estimation.scan_alignment import ScanAlignment
from diffbotctl.geometry.deskew import PoseHistory, deskew
from diffbotctl.geometry.footprint import Footprint
from diffbotctl.messages import MapUpdate, Odometry, Scan
from diffbotctl.runs.options import RunOptions
from diffbotctl.runs.run import Run
from diffbotctl.time import SECOND

OUTLINE = Footprint(0.05, 0.05, 0.05)


def ray_length(x, y, bearing):
    """To the walls of a square of 4 m about the origin."""
    c, s = math.cos(bearing), math.sin(bearing)
    ways = [(2 - x) / c, (-2 - x) / c] if c else []
    ways += [(2 - y) / s, (-2 - y) / s] if s else []
    return min(way for way in ways if way > 0)


def pose_at(time, linear, angular):
    turn = angular * time
    if not angular:
        return linear * time, 0.0, 0.0
    return linear / angular * math.sin(turn), linear / angular * (1 - math.cos(turn)), turn


@pytest.mark.parametrize(
    ("linear", "angular", "lag", "rays"),
    [(0.2, 0.0, 0.0, 360), (0.0, 1.5, 0.0, 360), (0.2, -1.5, 0.0, 800), (0.1, 1.5, 0.14, 450)],
)
def test_points_are_where_they_were_seen(linear, angular, lag, rays):
    end, duration = 1.0, 0.2
    mount = (-0.03, 0.01, 0.4)
    step = -2 * math.pi / rays
    distances = []
    for ray in range(rays):
        x, y, heading = pose_at(end - lag - duration * (1 - ray / rays), linear, angular)
        c, s = math.cos(heading), math.sin(heading)
        at = x + c * mount[0] - s * mount[1], y + s * mount[0] + c * mount[1]
        distances.append(ray_length(*at, heading + mount[2] + ray * step))
    history = PoseHistory()
    for frame in range(31):
        time = frame / 30
        x, y, heading = pose_at(time, linear, angular)
        history.add(Odometry(round(time * SECOND), x, y, heading, linear, angular, (0.0,) * 6))
    scan = Scan(SECOND, 0.0, step, tuple(distances), duration)
    found = deskew(scan, round(lag * SECOND), mount, OUTLINE, history, 3.0)
    at = found.at
    points = np.array(found.points).reshape(-1, 2)
    c, s = math.cos(at.heading), math.sin(at.heading)
    seen = points @ np.array([[c, s], [-s, c]]) + (at.x, at.y)
    off = np.abs(np.abs(seen).max(1) - 2.0)
    assert len(points) == rays
    assert off.max() < 1e-3
    assert np.array(found.at[1:4]) == pytest.approx(
        pose_at(end - lag - duration / 2, linear, angular), abs=1e-3
    )


def test_the_robot_itself_and_what_is_too_near_are_left_out():
    history = PoseHistory()
    history.add(Odometry(SECOND, 0.0, 0.0, 0.0, 0.0, 0.0, (0.0,) * 6))
    scan = Scan(SECOND, 0.0, math.pi / 2, (0.04, 0.0, math.inf, 1.0), 0.2)
    found = deskew(scan, 0, (0.0, 0.0, 0.0), OUTLINE, history, 3.0)
    assert found.points == pytest.approx((0.0, -1.0), abs=1e-4)
    assert found.clear == pytest.approx((-3.0, 0.0), abs=1e-4)


def answers(alignment, lag, offset, place, steps, seed):
    """Odometry at each scan, and the map's answer, of a lidar that is late and elsewhere."""
    rng = np.random.default_rng(seed)
    x = y = heading = 0.0
    for number in range(1, steps):
        phase = (number // 20) % 3
        linear, angular = [(0.2, 0.0), (0.0, 1.2), (0.15, -0.7)][phase]
        for _ in range(20):
            heading += angular * 0.01
            x += linear * 0.01 * math.cos(heading)
            y += linear * 0.01 * math.sin(heading)
        at = Odometry(number * SECOND // 5, x, y, heading, linear, angular, (0.0,) * 6)
        late = lag - alignment.lag  # what the scan is not corrected for
        seen = heading - late * angular + rng.normal(0, 0.003)
        shown = complex(x, y) - late * linear * cmath.exp(1j * heading)
        # The map has the pose of what is where the lidar would be, if it were as stated.
        in_map = (shown + (cmath.exp(1j * seen) - 1) * place) * cmath.exp(-1j * offset)
        in_map += complex(rng.normal(0, 0.003), rng.normal(0, 0.003))
        turn = seen - heading
        odom = in_map - cmath.exp(1j * turn) * complex(x, y)
        yield at, MapUpdate(at.time, "mapping", odom.real, odom.imag, turn)


@pytest.mark.parametrize("lag", [0.0, 0.14, -0.05])
@pytest.mark.parametrize(
    ("offset", "place"), [(0.0, 0j), (0.09, 0j), (-0.09, 0.05 - 0.04j), (0.0, -0.1j), (2.5, 0.03j)]
)
def test_lag_direction_and_place_of_the_lidar_are_found(lag, offset, place):
    alignment = ScanAlignment()
    found = []
    for at, update in answers(alignment, lag, offset, place, 400, 7):
        alignment.take(update, at)
        found += alignment.findings((0.1, 0.0, 0.0))
    assert alignment.lag == pytest.approx(lag, abs=0.01)
    mount = alignment.mount.mount()
    assert mount.heading == pytest.approx(offset, abs=0.015)
    assert abs(mount.place - place) < 0.01
    assert any("ms later" in text for text in found) == (abs(lag) > 0.03)
    texts = [text for text in found if "the lidar is at" in text]
    assert bool(texts) == bool(offset or place)
    if texts:
        true = place + cmath.exp(1j * offset) * 0.1
        values = [float(each) for each in re.findall(r": (-?[0-9.]+) (?:cm|deg)", texts[-1])]
        angle = math.degrees(offset)
        assert values[:3] == pytest.approx([100 * true.real, 100 * true.imag, angle], abs=1.5)
        assert values[3:] == [10.0, 0.0, 0.0]


def fitted(points, pose, walls):
    """The pose from which the points lie on the walls: point to line, from a start nearby."""
    pose = np.array(pose)
    for _ in range(12):
        c, s = np.cos(pose[2]), np.sin(pose[2])
        seen = points @ np.array([[c, s], [-s, c]]) + pose[:2]
        off, normals = np.full(len(seen), 9.0), np.zeros((len(seen), 2))
        for x1, y1, x2, y2 in walls:
            along = np.array([x2 - x1, y2 - y1])
            length = np.hypot(*along)
            along /= length
            normal = np.array([-along[1], along[0]])
            way, aside = (seen - (x1, y1)) @ along, (seen - (x1, y1)) @ normal
            nearer = (way > 0) & (way < length) & (np.abs(aside) < np.abs(off))
            off[nearer], normals[nearer] = aside[nearer], normal
        near = np.abs(off) < 0.1
        arm = seen[near] - pose[:2]
        lever = arm[:, 0] * normals[near, 1] - arm[:, 1] * normals[near, 0]
        slope = np.column_stack([normals[near], lever])
        weight = 1 / (1 + (off[near] / 0.03) ** 2)
        pose += np.linalg.lstsq(
            slope * np.sqrt(weight)[:, None], -off[near] * np.sqrt(weight), rcond=None
        )[0]
    return pose


PIPELINE = """
format: 1
kind: pipeline
include: map
blocks:
  wander:
    block: wander
    in: {scan: robot.scan, odometry: odometry.odometry}
    with: {turn_rate: 1.6 rad/s}
  mux: {in: {autonomous: wander.twist}}
"""


@pytest.mark.parametrize("seed", [21, 22])
def test_scans_of_the_simulated_robot_fit_the_walls(tmp_path, monkeypatch, seed):
    """At most 5 mm and 0.3 degrees rms, while it turns at 1.5 rad/s."""
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path))
    path = tmp_path / "turns.yaml"
    path.write_text(PIPELINE)
    configuration = load(str(path), None, ["robot.simulation.geometry.track_spread=0.04"])
    run = Run(configuration, RunOptions(fast=True, duration=40.0, seed=seed, rehearses=True))
    truths, scans = [], []

    def record(instant):
        pose = run.plant.truth().pose
        truths.append((instant[0], pose.x, pose.y, pose.heading))

    run.engine.sinks["slam.points"] = lambda now, points: scans.append(points)
    run.engine.compiled = run.engine.graph.compile(run.engine.sinks, record)
    run.go()
    truth = np.array(truths, float)
    truth[:, 3] = np.unwrap(truth[:, 3])
    walls = [(*wall.start, *wall.end) for wall in configuration.world.walls]
    errors = []
    for scan in scans:
        now, rate = (
            [np.interp(time, truth[:, 0], truth[:, i]) for i in (1, 2, 3)]
            for time in (scan.time, scan.time + 0.05 * SECOND)
        )
        if abs(rate[2] - now[2]) / 0.05 > 1.2:
            pose = fitted(np.array(scan.points).reshape(-1, 2), now, walls)
            errors.append(pose - now)
    errors = np.array(errors)
    assert len(errors) > 8
    assert np.sqrt((errors[:, :2] ** 2).sum(1).mean()) < 0.005
    assert np.degrees(np.sqrt((errors[:, 2] ** 2).mean())) < 0.3
