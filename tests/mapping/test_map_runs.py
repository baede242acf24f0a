"""Runs with a map: the process beside the engine, its answers, replays, and its death."""

import json
import math
import os
import re
import signal
import subprocess
import sys
from itertools import pairwise

import numpy as np
import pytest
from mcap.reader import make_reader
from mcap_ros2.decoder import DecoderFactory

from diffbotctl.config.load import load
from diffbotctl.drivers.map_store import map_path, maps_folder, stored_maps
from diffbotctl.geometry.map_tiles import MapTiles
from diffbotctl.mapping.map_file import load_map, save_map
from diffbotctl.mapping.map_image import load_picture, save_picture
from diffbotctl.mapping.scan_map import Map
from diffbotctl.messages import LogLine, MapPose, MapUpdate, ScanPoints
from diffbotctl.recording.reader import RecordingReader
from diffbotctl.replay.recorded_run import read_run
from diffbotctl.replay.replay import ReplayOptions, replay_run
from diffbotctl.replay.resimulate import resimulate, why_not_resimulable
from diffbotctl.ros2.bag_export import export_bag
from diffbotctl.runs.options import RunOptions
from diffbotctl.runs.run import Run

PIPELINE = """
format: 1
kind: pipeline
include: map
blocks:
  wander: {block: wander, in: {scan: robot.scan, odometry: odometry.odometry}}
  mux: {in: {autonomous: wander.twist}}
"""


@pytest.fixture(autouse=True)
def own_folder(tmp_path, monkeypatch):
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path / "state"))


@pytest.fixture
def pipeline(tmp_path):
    path = tmp_path / "roam.yaml"
    path.write_text(PIPELINE)
    return str(path)


def recorded(pipeline, path, seconds=8.0, sets=(), seed=4):
    options = RunOptions(fast=True, duration=seconds, seed=seed, record=path, digest=True)
    return Run(load(pipeline, None, sets), options).go()


def messages(path, kind):
    return [item.message for item in RecordingReader(path).messages() if type(item.message) is kind]


@pytest.fixture
def drive(pipeline, tmp_path):
    path = tmp_path / "drive.mcap"
    result = recorded(pipeline, path)
    assert result.failure is None
    return path, result


def test_a_simulated_run_is_the_same_each_time_and_its_map_is_whole(drive, pipeline, tmp_path):
    path, first = drive
    again = recorded(pipeline, tmp_path / "again.mcap")
    assert again.digest == first.digest
    tiles = MapTiles()
    updates = messages(path, MapUpdate)
    for update in updates:
        tiles.take(update)
    assert tiles.is_whole
    rows = tiles.rows()
    assert sum(row.count("#") for row in rows.rows) > 300  # cells of walls; 5 cm each
    lost = MapTiles()
    for update in updates[:3] + updates[-1:]:
        lost.take(update)
    assert not lost.is_whole
    with path.open("rb") as stream:
        largest = max(
            (len(message.data), channel.topic)
            for _, channel, message in make_reader(stream).iter_messages()
        )
    assert largest < (100_000, ""), "no message has the whole map"


def test_a_recording_is_replayed_without_the_process(drive, monkeypatch):
    path, result = drive
    monkeypatch.setattr(sys, "executable", "/bin/false")  # the process could not be started
    replayed = replay_run(read_run(path), ReplayOptions(check=True))
    assert replayed.difference is None
    assert replayed.digest == result.digest


def test_a_replay_with_changed_parameters_computes_the_map_again(drive, tmp_path):
    path, _ = drive
    coarse = tmp_path / "coarse.mcap"
    run = read_run(path)
    options = ReplayOptions(sets=("map.resolution=10 cm",), record=coarse)
    replay_run(run, options)
    assert {update.resolution for update in messages(coarse, MapUpdate)} == {0.1}
    assert why_not_resimulable(run) is None
    assert {update.resolution for update in messages(path, MapUpdate)} == {0.05}
    resimulate(run, options._replace(record=tmp_path / "again.mcap", until=3_000_000_000))
    assert messages(tmp_path / "again.mcap", MapUpdate)[-1].resolution == 0.1
    assert [stored.name for stored in stored_maps()] == ["autosave"]  # of the run itself


def test_a_rosbag_has_the_grid_and_the_frames(drive, tmp_path):
    path, _ = drive
    export_bag(path, tmp_path / "bag", None, False)
    (file,) = (tmp_path / "bag").glob("*.mcap")
    with file.open("rb") as stream:
        reader = make_reader(stream, decoder_factories=[DecoderFactory()])
        read = [(channel, each) for _, channel, _, each in reader.iter_decoded_messages()]
    grids = [(channel, each) for channel, each in read if channel.topic == "/map"]
    channel, grid = grids[-1]
    assert "durability: transient_local" in channel.metadata["offered_qos_profiles"] or (
        "durability: 1" in channel.metadata["offered_qos_profiles"]
    )
    assert (grid.header.frame_id, len(grid.data)) == ("map", grid.info.width * grid.info.height)
    assert set(grid.data) == {-1, 0, 100}
    # The wall at y = 1.2 m, above the first room, is where it is.
    column = round((-0.8 - grid.info.origin.position.x) / grid.info.resolution)
    rows = [grid.data[row * grid.info.width + column] for row in range(grid.info.height)]
    ys = [
        grid.info.origin.position.y + (row + 0.5) * grid.info.resolution
        for row, cell in enumerate(rows)
        if cell == 100
    ]
    assert any(abs(y - 1.2) < 0.06 for y in ys)
    frames = {
        (each.header.frame_id, each.child_frame_id)
        for channel, message in read
        if channel.topic == "/tf"
        for each in message.transforms
    }
    assert {("map", "odom"), ("odom", "base_footprint")} <= frames
    assert any(channel.topic == "/pose" for channel, _ in read)


def test_a_process_that_dies_is_started_again_and_stops_nothing(pipeline, tmp_path):
    path = tmp_path / "killed.mcap"
    options = RunOptions(fast=True, duration=8.0, seed=4, record=path)
    run = Run(load(pipeline), options)
    source = run.computed.sources[0]
    record, killed = run.engine.record, []

    def kill(now, message):
        if now > 4e9 and not killed:
            killed.append(source.driver.process.pid)
            os.kill(killed[0], signal.SIGKILL)

    run.engine.sinks["slam.pose"] = kill
    run.engine.compiled = run.engine.graph.compile(run.engine.sinks, record)
    result = run.go()
    assert killed
    assert result.ending.code == 0 and not result.stops
    updates = messages(path, MapUpdate)
    assert len({update.map for update in updates}) == 2
    assert max(update.time for update in updates) > 7.5e9
    poses = messages(path, MapPose)
    jump = max(
        abs(after.x - before.x) + abs(after.y - before.y) for before, after in pairwise(poses)
    )
    assert jump < 0.1, "the map goes on from where the robot was"
    tiles = MapTiles()
    for update in updates:
        tiles.take(update)
    assert (poses[-1].state, tiles.is_whole) == ("mapping", True)
    assert max(x for x, _ in tiles.occupied()) > 4.0, "it grows beyond what had been saved"


OTHER_ROOM = """
world:
  walls:
    - {from: [-1 m, -0.9 m], to: [2 m, -0.7 m]}
    - {from: [2 m, -0.7 m], to: [3 m, 1.7 m]}
    - {from: [3 m, 1.7 m], to: [-1 m, 2.7 m]}
    - {from: [-1 m, 2.7 m], to: [-1 m, -0.9 m]}
  obstacles: []
"""


def test_a_map_of_another_place_is_said_not_to_fit_and_stays_as_it_is(pipeline, tmp_path):
    other = tmp_path / "other.yaml"
    other.write_text(PIPELINE + OTHER_ROOM)
    recorded(str(other), tmp_path / "other.mcap", 15.0)
    saved = map_path("autosave").rename(map_path("other"))
    before = saved.read_bytes()
    path = tmp_path / "here.mcap"
    assert recorded(pipeline, path, 20.0, ("map.load=other",), seed=9).failure is None
    poses = messages(path, MapPose)
    assert {pose.state for pose in poses} <= {"starting", "searching", "lost"}
    assert poses[-1].state == "lost" and "does not fit the map" in poses[-1].cause
    assert saved.read_bytes() == before


@pytest.mark.parametrize(
    ("name", "cause"),
    [("half", "no whole map file"), ("none", "no map 'none'"), ("../x", "no map '../x'")],
)
def test_a_map_that_cannot_be_loaded_is_named_in_the_whole_run(pipeline, tmp_path, name, cause):
    maps_folder().mkdir(parents=True)
    map_path("half").write_bytes(b"PK" + bytes(900))
    path = tmp_path / "run.mcap"
    recorded(pipeline, path, 4.0, (f"map.load={name}",))
    assert all(cause in update.cause for update in messages(path, MapUpdate))


def test_a_robot_is_found_and_followed_in_an_imported_map(pipeline, tmp_path):
    recorded(pipeline, tmp_path / "drive.mcap", 25.0)
    save_picture(load_map(map_path("autosave")).grid(), tmp_path / "flat.yaml")
    grid = load_picture(tmp_path / "flat.yaml")
    save_map(Map(grid.resolution, (), np.zeros((0, 3)), grid), map_path("flat"))
    path = tmp_path / "again.mcap"
    run = Run(
        load(pipeline, None, ("map.load=flat", "map.autosave=false")),
        RunOptions(fast=True, duration=12.0, seed=9, record=path),
    )
    assert run.go().failure is None
    poses = messages(path, MapPose)
    assert poses[-1].state == "localised"
    truth = run.plant.truth().pose
    assert math.hypot(poses[-1].x - truth[0], poses[-1].y - truth[1]) < 0.06
    assert messages(path, MapUpdate)[-1].resolution == grid.resolution


class LateScanner:
    """A lidar each fifth of whose scans is the last but one again."""

    def __init__(self, scanner):
        self.scanner, self.scans = scanner, []

    def __getattr__(self, name):
        return getattr(self.scanner, name)

    def sweep(self, *facts):
        scan = self.scanner.sweep(*facts)
        self.scans += [] if scan is None else [scan]
        is_late = scan is not None and len(self.scans) % 5 == 0
        return self.scans[-3] if is_late else scan


def test_scans_out_of_order_are_left_out_and_named_once(pipeline, tmp_path):
    path = tmp_path / "order.mcap"
    run = Run(load(pipeline), RunOptions(fast=True, duration=8.0, seed=4, record=path))
    mounting, scanner = run.plant._sensors.scanners[0]
    run.plant._sensors.scanners[0] = mounting, LateScanner(scanner)
    assert run.go().failure is None
    lines = [line.text for line in messages(path, LogLine) if "out of order" in line.text]
    assert len(lines) == 1
    times = [scan.time for scan in messages(path, ScanPoints)]
    assert len(times) > 20 and times == sorted(set(times))
    poses = messages(path, MapPose)
    truth = run.plant.truth().pose
    assert poses[-1].state == "mapping"
    assert math.hypot(poses[-1].x - truth[0], poses[-1].y - truth[1]) < 0.05


def test_a_lidar_that_sits_and_points_elsewhere_is_found_by_its_scans(pipeline, tmp_path):
    path = tmp_path / "bent.mcap"
    run = Run(load(pipeline), RunOptions(fast=True, duration=40.0, seed=4, record=path))
    mounting, scanner = run.plant._sensors.scanners[0]
    x, y, heading = mounting.x + 0.05, mounting.y - 0.03, mounting.heading + 0.1
    bent = mounting._replace(x=x, y=y, heading=heading)
    run.plant._sensors.scanners[0] = bent, scanner
    run.go()
    texts = [line.text for line in messages(path, LogLine) if "the lidar is at" in line.text]
    values = [float(each) for each in re.findall(r": (-?[0-9.]+) (?:cm|deg)", texts[-1])]
    assert values[:3] == pytest.approx([100 * x, 100 * y, math.degrees(heading)], abs=1.0)
    assert values[3:] == pytest.approx([100 * mounting.x, 100 * mounting.y, 0.0], abs=0.1)


@pytest.mark.parametrize("has_scans", [True, False], ids=["late process", "dead lidar"])
def test_without_answers_the_covariance_grows(pipeline, tmp_path, has_scans):
    path = tmp_path / "late.mcap"
    run = Run(load(pipeline), RunOptions(fast=True, duration=9.0, seed=4, record=path))
    if has_scans:
        run.computed.sources[0].delay = 60_000_000_000
    else:
        blocked = run.plant._sensors.scanners[0][1]
        run.engine.sinks["robot.scan"] = lambda now, scan: setattr(blocked, "is_blocked", now > 3e9)
        run.engine.compiled = run.engine.graph.compile(run.engine.sinks, run.engine.record)
    result = run.go()
    codes = {stop.code for stop in result.stops if stop.latched}
    assert codes <= {"command_stale"}  # of wander, which needs scans
    poses = messages(path, MapPose)
    growth = [(pose.covariance[0] + pose.covariance[3]) ** 0.5 for pose in poses]
    if has_scans:
        assert poses[-1].state == "starting"
        assert "has not answered for 9 s" in poses[-1].cause
        assert growth[-1] > 2 * growth[len(growth) // 4]
    else:
        assert poses[-1].state == "odometry"
        assert poses[-1].cause == "no scan comes from the lidar"


def test_the_engine_imports_no_numpy(pipeline):
    program = f"""
import sys, json
from diffbotctl.config.load import load
from diffbotctl.runs.options import RunOptions
from diffbotctl.runs.run import Run
result = Run(load({pipeline!r}), RunOptions(fast=True, duration=1.0)).go()
print(json.dumps(["numpy" in sys.modules, result.ending.code]))
"""
    printed = subprocess.run(
        [sys.executable, "-c", program], capture_output=True, text=True, check=True
    ).stdout
    assert json.loads(printed.splitlines()[-1]) == [False, 0]
