"""Flats of chance, mapped while a robot wanders: is its pose right, and are the walls?"""

from __future__ import annotations

import os
import tempfile
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from functools import partial
from math import hypot
from multiprocessing import Pool
from pathlib import Path
from random import Random
from typing import NamedTuple
from unittest.mock import patch

import numpy as np
import yaml

from diffbotctl.config import lookup
from diffbotctl.config.load import load
from diffbotctl.drivers.map_store import map_path
from diffbotctl.geometry.footprint import distance_to_segment
from diffbotctl.mapping.map_file import load_map
from diffbotctl.mapping.plane_pose import Array, transformed
from diffbotctl.messages import MapPose
from diffbotctl.plant.world import Pillar, Wall, World
from diffbotctl.runs.options import RunOptions
from diffbotctl.runs.run import Run
from tests.support.trials.map_runs import WANDER
from tests.support.trials.row import Row
from tests.support.trials.wander import sets_of

SIDES = ((6.0, 9.0), (5.0, 7.5))  # m, of a flat
ROOM_MAX = 3.6  # m; a longer side is divided
DOOR, DOOR_MARGIN = 0.9, 0.35  # m
START_ROOM = 0.6  # m around the start that is left free
LIDARS = {"3.5 m": "lds01", "12 m": "ld19"}
PIECE = 0.5  # m of a wall, for one measurement of where it is
PIECE_POINTS = 30
CORNER = 0.1  # m at each end of a wall that are not measured
NEAR = 0.15  # m; a point that is further from everything is at nothing
MM = 1000.0
RMS_MAX, WORST_MAX, WALL_MAX = 15.0, 60.0, 20.0  # mm
BROKEN = 0.3  # m; a pose or a piece of the map that is further off
ASTRAY_MAX = 0.02  # share of the map's points at nothing
SURE = 9.21  # chi squared of 2 degrees of freedom, 99 %


class MappedFlat(NamedTuple):
    """One drive: errors of the pose in mm, of the pieces of walls in mm, and what was unnoticed."""

    rms: float
    worst: float
    walls: tuple[float, ...]
    astray: float
    """share of the map's points at nothing"""
    rooms: float
    """share of the walls' pieces that are in the map"""
    unnoticed: bool
    """at some time the pose was wrong by more than BROKEN, outside its ellipse, and not stated"""


def flat_of(rng: Random) -> World:
    """A rectangle that walls with doors divide into rooms, with pillars and cupboards.

    The robot starts at the origin, in one of the rooms.
    """
    while True:
        wide, deep = (rng.uniform(*side) for side in SIDES)
        doors: list[tuple[float, float]] = []
        walls = _around(0.0, 0.0, wide, deep)
        rooms = [*_divided(rng, (0.0, 0.0, wide, deep), walls, doors)]
        pillars: list[Pillar] = []
        for left, low, right, high in rooms:
            x, y = rng.uniform(left + 0.3, right - 0.3), rng.uniform(low + 0.3, high - 0.3)
            pillars.append(Pillar(x, y, rng.uniform(0.05, 0.25)))
            x, width = rng.uniform(left, right - 0.8), rng.uniform(0.4, 0.8)
            walls += _around(x, low, width, 0.4)
        left, low, right, high = rng.choice(rooms)
        x, y = 0.5 * (left + right), 0.5 * (low + high)
        places = [(x, y), *doors]
        if all(
            hypot(each.x - a, each.y - b) > each.radius + START_ROOM
            for each in pillars
            for a, b in places
        ) and all(_free(place, walls) for place in places):
            return World(
                [Wall(a - x, b - y, c - x, d - y) for a, b, c, d in walls],
                [Pillar(each.x - x, each.y - y, each.radius) for each in pillars],
            )


def _around(x: float, y: float, width: float, depth: float) -> list[Wall]:
    right, top = x + width, y + depth
    return [
        *(Wall(x, y, right, y), Wall(right, y, right, top)),
        *(Wall(right, top, x, top), Wall(x, top, x, y)),
    ]


def _free(place: tuple[float, float], walls: list[Wall]) -> bool:
    """Whether a robot passes: nothing but the walls beside a door is nearer than its half."""
    return all(distance_to_segment(*place, *wall) > 0.49 * DOOR for wall in walls)


def _divided(
    rng: Random,
    room: tuple[float, float, float, float],
    walls: list[Wall],
    doors: list[tuple[float, float]],
) -> Iterator[tuple[float, float, float, float]]:
    """Rooms whose sides are at most ROOM_MAX; adds the walls between them, and their doors."""
    left, low, right, high = room
    if max(right - left, high - low) <= ROOM_MAX:
        yield room
        return
    if right - left >= high - low:
        at = left + rng.uniform(0.4, 0.6) * (right - left)
        door = rng.uniform(low + DOOR_MARGIN, high - DOOR_MARGIN - DOOR)
        walls += [Wall(at, low, at, door), Wall(at, door + DOOR, at, high)]
        doors.append((at, door + 0.5 * DOOR))
        parts = (left, low, at, high), (at, low, right, high)
    else:
        at = low + rng.uniform(0.4, 0.6) * (high - low)
        door = rng.uniform(left + DOOR_MARGIN, right - DOOR_MARGIN - DOOR)
        walls += [Wall(left, at, door, at), Wall(door + DOOR, at, right, at)]
        doors.append((door + 0.5 * DOOR, at))
        parts = (left, low, right, at), (left, at, right, high)
    for part in parts:
        yield from _divided(rng, part, walls, doors)


def mapped_flat(seed: int, minutes: float, sets: tuple[str, ...]) -> MappedFlat:
    """Drive through the flat that `seed` draws."""
    world = flat_of(Random(f"flat {seed}"))
    with own_maps() as folder:
        errors, unnoticed = _driven(wandering(folder, world, seed, 60.0 * minutes, sets))
        saved = load_map(map_path("autosave"))
    points = np.vstack(
        [transformed(scan.points, at) for scan, at in zip(saved.scans, saved.poses, strict=True)]
    )
    nearest, distance = _nearest(points, world)
    offsets = [
        offset
        for i, wall in enumerate(world.walls)
        for offset in _offsets(points[(nearest == i) & (distance < NEAR)], wall)
    ]
    seen = [offset for offset in offsets if offset is not None]
    return MappedFlat(
        MM * float(np.sqrt(np.mean(np.square(errors)))),
        MM * max(errors),
        tuple(MM * each for each in seen),
        float((distance > NEAR).mean()),
        len(seen) / len(offsets),
        unnoticed,
    )


@contextmanager
def own_maps() -> Iterator[Path]:
    """A folder of which the maps that are saved meanwhile are a part; for one process of a pool."""
    with tempfile.TemporaryDirectory() as name, patch.dict(os.environ, {"XDG_STATE_HOME": name}):
        yield Path(name)


def wandering(
    folder: Path, world: World, seed: int, seconds: float, sets: Sequence[str] = ()
) -> Run:
    """A run of the pipeline `map` that drives by itself through `world`."""
    fields = yaml.safe_load((lookup.folder("pipelines") / "map.yaml").read_text())
    fields["blocks"]["wander"] = WANDER
    fields["blocks"]["mux"]["in"]["autonomous"] = "wander.twist"
    path = folder / "roam.yaml"
    path.write_text(yaml.safe_dump(fields, sort_keys=False))
    setup = load(str(path), None, [*sets_of(world), *sets])
    return Run(setup, RunOptions(fast=True, duration=seconds, seed=seed))


def _driven(run: Run) -> tuple[list[float], bool]:
    """Errors of the pose in map (m), and whether one was wrong and sure."""
    errors: list[float] = []
    unnoticed = False

    def judge(now: int, pose: MapPose) -> None:
        nonlocal unnoticed
        assert run.plant is not None
        truth = run.plant.truth().pose
        x, y = pose.x - truth[0], pose.y - truth[1]
        errors.append(hypot(x, y))
        xx, xy, _, yy, _, _ = pose.covariance
        distance = (yy * x * x - 2 * xy * x * y + xx * y * y) / max(xx * yy - xy * xy, 1e-18)
        unnoticed |= pose.state == "mapping" and errors[-1] > BROKEN and distance > SURE

    run.engine.sinks["slam.pose"] = judge
    run.engine.compiled = run.engine.graph.compile(run.engine.sinks, run.engine.record)
    run.go()
    return errors, unnoticed


def _nearest(points: Array, world: World) -> tuple[Array, Array]:
    """For each point the index of the nearest wall, or a number beyond them for a pillar; and m."""
    distances = []
    for wall in world.walls:
        start, along = np.array(wall[:2]), np.array(wall[2:]) - np.array(wall[:2])
        share = np.clip((points - start) @ along / (along @ along), 0.0, 1.0)
        distances.append(np.hypot(*(points - start - share[:, None] * along).T))
    for each in world.pillars:
        distances.append(np.abs(np.hypot(*(points - (each.x, each.y)).T) - each.radius))
    table = np.array(distances)
    return table.argmin(0), table.min(0)


def _offsets(points: Array, wall: Wall) -> Iterator[float | None]:
    """How far from each piece of a wall its points are, their median in m; None: not seen."""
    start, along = np.array(wall[:2]), np.array(wall[2:]) - np.array(wall[:2])
    length = float(np.hypot(*along))
    along = along / length
    beside = points - start
    place, distance = beside @ along, beside @ np.array([-along[1], along[0]])
    for low in np.arange(CORNER, length - CORNER - PIECE, PIECE):
        part = distance[(place > low) & (place < low + PIECE)]
        yield abs(float(np.median(part))) if len(part) >= PIECE_POINTS else None


def robots() -> dict[str, tuple[str, ...]]:
    """Settings of each robot and lidar."""
    cheap = (
        "robot.simulation.geometry.track_spread=0.04",
        "robot.simulation.geometry.diameter_spread=0.015",
        "robot.simulation.slip=2 mm",
    )
    return {
        f"{name}, lidar {reach}": (*sets, f"robot.sensors.scan.type={lidar}")
        for name, sets in (("Burger", ()), ("cheap robot", cheap))
        for reach, lidar in LIDARS.items()
    }


def rows(seed: int, flats: int, minutes: float) -> Iterator[Row]:
    """Each robot and lidar in `flats` flats."""
    with Pool() as pool:
        for what, sets in robots().items():
            one = partial(mapped_flat, minutes=minutes, sets=sets)
            yield from judged(what, [*pool.imap(one, range(100 * seed, 100 * seed + flats))])


def judged(what: str, drives: list[MappedFlat]) -> Iterator[Row]:
    """The rows of one robot."""
    what = f"{what}, {len(drives)} flats"
    rms, worst = (max(getattr(each, name) for each in drives) for name in ("rms", "worst"))
    yield Row(
        f"{what}: pose in the map",
        f"rms of the worst {rms:.1f} mm, worst {worst:.0f} mm",
        f"<= {RMS_MAX:g} mm, {WORST_MAX:g} mm",
        rms <= RMS_MAX and worst <= WORST_MAX,
    )
    offsets = sorted(offset for each in drives for offset in each.walls)
    wall, p99 = offsets[-1], offsets[int(0.99 * len(offsets))]
    rooms = sum(each.rooms for each in drives) / len(drives)
    yield Row(
        f"{what}: walls, {100 * rooms:.0f} % of them seen",
        f"p99 {p99:.1f} mm, worst {wall:.1f} mm",
        f"<= {WALL_MAX:g} mm",
        wall <= WALL_MAX,
    )
    unnoticed = sum(each.unnoticed or each.astray > ASTRAY_MAX for each in drives)
    yield Row(f"{what}: broken maps unnoticed", str(unnoticed), "0", unnoticed == 0)
