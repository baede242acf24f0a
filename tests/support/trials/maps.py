"""Maps from scans of real lidars; the logs do not ship: `--slam FOLDER` names their folder."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np

from diffbotctl.estimation.scan_alignment import ScanAlignment
from diffbotctl.mapping.lidar_scan import MappedScan
from diffbotctl.mapping.mapper import Mapper, MapperParameters
from diffbotctl.mapping.plane_pose import Array
from diffbotctl.mapping.pose_graph import KEPT_WEIGHT, PoseEdge
from diffbotctl.messages import MapUpdate, Odometry
from diffbotctl.time import SECOND
from tests.support.slam_logs import UrgLog, all_poses, crisp_cells, read_intel, read_urg
from tests.support.trials.row import NoData, Row

EVERY_SCAN = MapperParameters(range_max=20.0, keyframe_distance=0.0)
MEAN_MAX, SPREAD_MAX, WORST_MAX, TURN_MAX = 0.025, 0.025, 0.2, 0.4  # m, m, m, degrees
SHORT_REACH, SHORT_MEAN_MAX = 3.5, 0.05  # m
FALSE_CLOSURES = 58
FIRST_SUBMAPS = 10  # without false closures
FALSE_SIGMA = (0.03, 0.03, 0.008)
LAG, URG_REACH, CELLS_MAX = 0.14, 4.0, 24_900  # s, m
LAG_TOLERANCE = 0.04  # s
RATE_TIME = 0.1  # s, over which the wheels' ticks give a rate: lines are 10 to 266 ms apart


def rows(folders: Sequence[Path], seed: int) -> Iterator[Row]:
    """Rows for the logs of the Intel Research Lab and of a rover with a URG."""
    found = next((each for each in folders if (each / "intel_scans.csv").is_file()), None)
    if found is None:
        yield NoData("maps of recorded scans", "no data", "needs logs: --slam FOLDER", True)
        return
    yield from _intel(found)
    yield _false_closures(found, seed)
    log = read_urg(found)
    yield _urg(log)
    yield _lag(log)


def mapped(scans: Sequence[MappedScan], parameters: MapperParameters) -> Array:
    """Poses in the finished map of all scans."""
    mapper = Mapper(parameters)
    for scan in scans:
        mapper.add(scan)
    while mapper.work(60):
        pass
    finished = mapper.map()
    return all_poses(finished.scans, finished.poses, scans)


def _intel(folder: Path) -> Iterator[Row]:
    scans, relations = read_intel(folder)
    distance, turn = relations.errors(mapped(scans, EVERY_SCAN))
    mean, spread, worst = distance.mean(), distance.std(), distance.max()
    yield Row(
        f"Intel log, {len(distance)} exact relations",
        f"{mean:.4f} +- {spread:.4f} m, worst {worst:.2f} m, {turn.mean():.2f} deg",
        f"<= {MEAN_MAX} +- {SPREAD_MAX} m, worst {WORST_MAX} m, {TURN_MAX} deg",
        bool(
            mean <= MEAN_MAX
            and spread <= SPREAD_MAX
            and worst <= WORST_MAX
            and turn.mean() <= TURN_MAX
        ),
    )
    scans, relations = read_intel(folder, SHORT_REACH)
    distance, turn = relations.errors(mapped(scans, EVERY_SCAN))
    yield Row(
        f"Intel log, ranges cut to {SHORT_REACH} m",
        f"{distance.mean():.4f} +- {distance.std():.4f} m, worst {distance.max():.2f} m",
        f"<= {SHORT_MEAN_MAX} m",
        bool(distance.mean() <= SHORT_MEAN_MAX),
    )


def _false_closures(folder: Path, seed: int) -> Row:
    """Motions drawn at random between submaps, one for each new submap where that is enough."""
    scans, relations = read_intel(folder)
    random = np.random.default_rng(seed)
    mapper = Mapper(EVERY_SCAN)
    injected: list[PoseEdge] = []
    for scan in scans:
        mapper.add(scan)
        graph = mapper.submaps.graph
        newest = len(graph.poses) - 1
        if len(injected) < min(FALSE_CLOSURES, newest - FIRST_SUBMAPS):
            motion = np.array([*random.uniform(-5, 5, 2), random.uniform(-3, 3)])
            first = int(random.integers(newest - 3))
            edge = PoseEdge(first, newest - 1, motion, np.diag(FALSE_SIGMA) ** 2, True)
            graph.add_edge(edge)
            injected.append(edge)
    while mapper.work(60):
        pass
    graph = mapper.submaps.graph
    kept = sum(
        weight >= KEPT_WEIGHT
        for edge, weight in zip(graph.edges, graph.weights, strict=True)
        if any(edge is each for each in injected)
    )
    finished = mapper.map()
    distance, _ = relations.errors(all_poses(finished.scans, finished.poses, scans))
    return Row(
        f"Intel log, {len(injected)} false closures injected",
        f"{kept} kept, {distance.mean():.4f} +- {distance.std():.4f} m",
        f"{FALSE_CLOSURES} injected, 0 kept, <= {MEAN_MAX} m",
        kept == 0 and len(injected) == FALSE_CLOSURES and bool(distance.mean() <= MEAN_MAX),
    )


def _urg(log: UrgLog) -> Row:
    scans = [log.scan(index, LAG) for index in range(len(log.times))]
    poses = mapped(scans, MapperParameters(range_max=URG_REACH))
    cells = crisp_cells(scans, poses)
    odometry = crisp_cells(scans, np.array([scan.odometry for scan in scans]))
    return Row(
        "URG log, cells of 2 cm hit at least twice",
        f"{cells:,}; by odometry alone {odometry:,}",
        f"<= {CELLS_MAX:,}",
        cells <= CELLS_MAX,
    )


def _lag(log: UrgLog) -> Row:
    """The lag found while the map is built, from none on, each scan corrected with the newest."""
    mapper, alignment = Mapper(MapperParameters(range_max=URG_REACH)), ScanAlignment()
    lags: list[float] = []
    last = -np.inf
    for index in range(len(log.times)):
        scan = log.scan(index, alignment.lag)
        if scan.time > last:
            last = scan.time
            time = round(scan.time * SECOND)
            x, y, heading = scan.odometry.tolist()
            turn = np.diff(log.poses_at(scan.time + np.array([-0.5, 0.5]) * RATE_TIME)[:, 2])
            rate = float(turn[0]) / RATE_TIME
            at = Odometry(time, x, y, heading, 0.0, rate, (0.0,) * 6)
            answer = mapper.add(scan)
            x, y, heading = answer.transform.tolist()
            alignment.take(MapUpdate(time, answer.state.value, x, y, heading), at)
        lags.append(alignment.lag)
    settled = 1e3 * np.array(lags[len(lags) // 3 :])
    return Row(
        "URG log, lag of the scans found while the map is built",
        f"{settled[-1]:.0f} ms at the end, {settled.min():.0f} to {settled.max():.0f} ms after "
        "a third",
        f"{1e3 * LAG:.0f} +- {1e3 * LAG_TOLERANCE:.0f} ms",
        bool((np.abs(settled - 1e3 * LAG) <= 1e3 * LAG_TOLERANCE).all()),
    )
