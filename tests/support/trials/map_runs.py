"""Runs with a map: what it costs, and whether its covariance is true where a lidar sees little."""

from __future__ import annotations

import os
import select
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path
from statistics import median
from typing import Any

import yaml

from diffbotctl.config import lookup
from diffbotctl.config.load import load
from diffbotctl.drivers.map_builder import MapSource
from diffbotctl.messages import MapPose, ScanPoints
from diffbotctl.runs.options import RunOptions
from diffbotctl.runs.run import Run
from tests.support.trials.row import Row

WANDER = {"block": "wander", "in": {"scan": "robot.scan", "odometry": "odometry.odometry"}}
BARE = {  # walls 60 m long, whose ends a lidar does not reach
    "a corridor without features": [
        {"from": ["-30 m", f"{y} m"], "to": ["30 m", f"{y} m"]} for y in (-0.9, 0.9)
    ],
    "a hall with one wall": [{"from": ["-30 m", "-1.5 m"], "to": ["30 m", "-1.5 m"]}],
}
WRONG_ODOMETRY = (
    "robot.simulation.geometry.track_spread=0.04",
    "robot.simulation.geometry.diameter_spread=0.015",
)
GLASS = 1  # of the walls of the pipeline's flat
CHAIR = {"at": ["0.5 m", "0 m"], "radius": "15 cm", "path": [["1 m", "0.6 m"]], "begin": "20 s"}
PERSON = {
    "at": ["0 m", "1 m"],
    "radius": "12 cm",
    "path": [["3 m", "1 m"]],
    "speed": "0.8 m/s",
    "repeat": True,
}
CHI_SQUARED_95 = 5.99  # 2 degrees of freedom
RATIO_MAX, DELAY_MAX, SHARE_MAX, MEMORY_MAX, INSIDE_MIN = 1.2, 0.1, 25.0, 60.0, 0.9
CLOCK = os.sysconf("SC_CLK_TCK")


class TimedInstants:
    """A compiled graph; processor time from counts of the wheels to the wheels' command, s."""

    def __init__(self, place: int, send: Any) -> None:
        """`place`: of the counts among the sources. `send`: what takes the command."""
        self.compiled: Any = None
        self.place, self.send = place, send
        self.times: list[float] = []
        self.began: float | None = None

    def __getattr__(self, name: str) -> Any:
        return getattr(self.compiled, name)

    def instant(self, now: int, *values: Any) -> Any:
        self.began = None if values[self.place] is None else time.thread_time()
        return self.compiled.instant(now, *values)

    def on_command(self, now: int, command: Any) -> None:
        """The wheels' command is computed."""
        if self.began is not None:
            self.times.append(time.thread_time() - self.began)
            self.began = None
        self.send(now, command)


def rows(seed: int, seconds: float, drives: int, length: float) -> Iterator[Row]:
    """Cost in real time for `seconds`, and `drives` of `length` s in each bare place."""
    with tempfile.TemporaryDirectory() as name:
        yield from _chain(Path(name), seconds, seed)
        yield from _process(Path(name), seconds, seed)
        worlds = {what: {"walls": walls} for what, walls in BARE.items()}
        worlds["glass, a chair that is moved, a person"] = _changing_flat()
        for what, world in worlds.items():
            yield _inside(Path(name), what, world, range(seed, seed + drives), length)


def _changing_flat() -> dict[str, Any]:
    """The pipeline's flat with a wall of glass, a chair and a person."""
    path = lookup.folder("pipelines") / "map.yaml"
    world: dict[str, Any] = yaml.safe_load(path.read_text())["world"]
    world["walls"][GLASS]["glass"] = True
    world["obstacles"] += [CHAIR, PERSON]
    return world


def _run(folder: Path, options: RunOptions, has_map: bool = True, world: Any = None) -> Run:
    """A run of the pipeline `map` that drives by itself, without a map or in another world."""
    fields = yaml.safe_load((lookup.folder("pipelines") / "map.yaml").read_text())
    fields["blocks"] |= {"wander": WANDER}
    fields["blocks"]["mux"]["in"]["autonomous"] = "wander.twist"
    fields["sources"]["map"]["with"] = {"autosave": False}
    if not has_map:
        del fields["blocks"]["slam"], fields["sources"]
    if world is not None:
        fields["world"] = world
    path = folder / "roam.yaml"
    path.write_text(yaml.safe_dump(fields, sort_keys=False))
    return Run(load(str(path), None, WRONG_ODOMETRY), options)


def _chain(folder: Path, seconds: float, seed: int) -> Iterator[Row]:
    """From the counts of the wheels to their command: with and without, in turns."""
    times: dict[bool, list[float]] = {True: [], False: []}
    for has_map in (True, False, False, True):
        run = _run(folder, RunOptions(duration=seconds / 4, seed=seed), has_map)
        place = list(run.engine.graph.sources).index("robot.encoders")
        engine: Any = run.engine
        timed = TimedInstants(place, engine.sinks["gate.wheels"])
        engine.sinks["gate.wheels"] = timed.on_command
        timed.compiled = engine.graph.compile(engine.sinks, engine.record)
        engine.compiled = timed
        run.go()
        times[has_map] += timed.times
    for what, part in (("p50", 0.5), ("p99", 0.99)):
        with_map, without = (
            sorted(times[each])[int(part * len(times[each]))] for each in (True, False)
        )
        yield Row(
            f"counts to command, {what}, with and without a map",
            f"{1e6 * with_map:.0f} and {1e6 * without:.0f} us",
            f"<= x{RATIO_MAX}",
            with_map <= RATIO_MAX * without,
        )


def _process(folder: Path, seconds: float, seed: int) -> Iterator[Row]:
    """The process alone: each scan sent at its time, until its answer is there."""
    run = _run(folder, RunOptions(fast=True, duration=seconds, seed=seed))
    scans: list[ScanPoints] = []
    run.engine.sinks["slam.points"] = lambda now, scan: scans.append(scan)
    run.engine.compiled = run.engine.graph.compile(run.engine.sinks, run.engine.record)
    run.go()
    source = MapSource(autosave=False)
    channel = source.open()
    assert source.process is not None
    source.write(0, "scan", scans[0])
    source.answer()
    stat, status = (Path(f"/proc/{source.process.pid}/{each}") for each in ("stat", "status"))
    begun, cpu = time.monotonic(), _cpu(stat)
    delays = []
    for scan in scans[1:]:
        while (left := 1e-9 * (scan.time - scans[0].time) + begun - time.monotonic()) > 0:
            time.sleep(left)
        sent = time.monotonic()
        source.write(scan.time, "scan", scan)
        while not source.read(scan.time):
            select.select([channel], [], [], 1.0)
        delays.append(time.monotonic() - sent)
    share = 100 * (_cpu(stat) - cpu) / (time.monotonic() - begun)
    memory = next(line for line in status.read_text().splitlines() if line.startswith("VmHWM"))
    source.close()
    worst, middle = max(delays), median(delays)
    figure = f"p50 {1e3 * middle:.0f} ms, worst {1e3 * worst:.0f} ms"
    yield Row("scan to answer", figure, f"<= {1e3 * DELAY_MAX:.0f} ms", worst <= DELAY_MAX)
    yield Row.at_most("process of the map, of a core", share, SHARE_MAX, "%", ".0f")
    megabytes = int(memory.split()[1]) / 1000
    yield Row.at_most("its memory", megabytes, MEMORY_MAX, "MB", ".0f")


def _cpu(stat: Path) -> float:
    fields = stat.read_text().rpartition(")")[2].split()
    return (int(fields[11]) + int(fields[12])) / CLOCK


def _inside(folder: Path, what: str, world: Any, seeds: range, length: float) -> Row:
    """How often the true position is within the 95 % ellipse of the pose in the map."""
    inside: list[bool] = []
    worst = 0.0
    for seed in seeds:
        run = _run(folder, RunOptions(fast=True, duration=length, seed=seed), world=world)

        def judge(now: int, pose: MapPose, plant: Any = run.plant) -> None:
            nonlocal worst
            truth = plant.truth().pose
            x, y = pose.x - truth[0], pose.y - truth[1]
            xx, xy, _, yy, _, _ = pose.covariance
            determinant = max(xx * yy - xy * xy, 1e-18)
            inside.append((yy * x * x - 2 * xy * x * y + xx * y * y) / determinant < CHI_SQUARED_95)
            worst = max(worst, (x * x + y * y) ** 0.5)

        run.engine.sinks["slam.pose"] = judge
        run.engine.compiled = run.engine.graph.compile(run.engine.sinks, run.engine.record)
        run.go()
    share = sum(inside) / len(inside)
    return Row(
        f"{what}, {len(seeds)} drives: within the 95 % ellipse",
        f"{100 * share:.0f} %, worst error {1e3 * worst:.0f} mm",
        f">= {100 * INSIDE_MIN:.0f} %",
        share >= INSIDE_MIN,
    )
