"""Where the robot is, in runs: put elsewhere while it maps, and in the map of another flat."""

from __future__ import annotations

from collections.abc import Iterator
from functools import partial
from math import hypot, pi
from multiprocessing import Pool
from random import Random
from statistics import median
from typing import NamedTuple

from diffbotctl.drivers.map_store import map_path
from diffbotctl.geometry.footprint import distance_to_segment
from diffbotctl.messages import MapPose
from diffbotctl.plant.world import World
from diffbotctl.runs.run import Run
from tests.support.trials.map_flats import flat_of, own_maps, wandering
from tests.support.trials.row import Row

CARRIED_AT, CARRIED_MIN = 0.6, 1.0  # of the drive; m at least to the place before
FREE = 0.35  # m around the robot where it is put down
WRONG = 0.3  # m
NOTICED = 3.0  # s after the robot was put down, until which a claim may be the one before
CLAIMS = ("mapping", "localised")


class Placed(NamedTuple):
    """One run: whether a place was claimed that was wrong, when right (s), and the last state."""

    wrong: bool
    found: float | None
    state: str


def free_place(world: World, rng: Random, away: tuple[float, float]) -> tuple[float, float]:
    """A place in the flat that is far from walls and pillars, and from `away`."""
    xs = [x for wall in world.walls for x in (wall.x1, wall.x2)]
    ys = [y for wall in world.walls for y in (wall.y1, wall.y2)]
    while True:
        x, y = rng.uniform(min(xs), max(xs)), rng.uniform(min(ys), max(ys))
        if (
            hypot(x - away[0], y - away[1]) > CARRIED_MIN
            and all(distance_to_segment(x, y, *wall) > FREE for wall in world.walls)
            and all(hypot(x - each.x, y - each.y) > each.radius + FREE for each in world.pillars)
        ):
            return x, y


def carried(seed: int, seconds: float) -> Placed:
    """The robot is put elsewhere in its flat while it maps it."""
    world, rng = flat_of(Random(f"flat {seed}")), Random(f"carried {seed}")
    with own_maps() as folder:
        run = wandering(folder, world, seed, seconds)
        return _judged(run, CARRIED_AT * seconds, partial(_carry, run, world, rng))


def elsewhere(seed: int, seconds: float) -> Placed:
    """The robot is switched on in a flat with the map of another one."""
    with own_maps() as folder:
        wandering(folder, flat_of(Random(f"flat {seed}")), seed, seconds).go()
        map_path("autosave").rename(map_path("other"))
        other = flat_of(Random(f"other flat {seed}"))
        run = wandering(folder, other, seed, seconds, ["map.load=other"])
        return _judged(run, 0.0, None)


def _carry(run: Run, world: World, rng: Random) -> None:
    assert run.plant is not None
    place = free_place(world, rng, run.plant.truth().pose[:2])
    run.plant.teleport(*place, rng.uniform(-pi, pi))


def _judged(run: Run, begin: float, change: partial[None] | None) -> Placed:
    """Go, `change` something at `begin`; without a change, every claim is wrong."""
    waiting, wrong, found, last = change, False, None, ""

    def judge(now: int, pose: MapPose) -> None:
        nonlocal waiting, wrong, found, last
        last = pose.state
        time = 1e-9 * now - begin
        if time < 0.0:
            return
        if waiting is not None:
            waiting()
            waiting = None
            return
        assert run.plant is not None
        truth = run.plant.truth().pose
        is_claim = pose.state in CLAIMS
        is_right = change is not None and hypot(pose.x - truth[0], pose.y - truth[1]) < WRONG
        wrong |= is_claim and not is_right and time > NOTICED
        if is_claim and is_right and found is None:
            found = time

    run.engine.sinks["slam.pose"] = judge
    run.engine.compiled = run.engine.graph.compile(run.engine.sinks, run.engine.record)
    run.go()
    return Placed(wrong, found, last)


def rows(seed: int, drives: int, seconds: float) -> Iterator[Row]:
    """Both, `drives` each."""
    seeds = range(100 * seed, 100 * seed + drives)
    with Pool() as pool:
        moved = pool.map(partial(carried, seconds=seconds), seeds)
        others = pool.map(partial(elsewhere, seconds=seconds), seeds)
    found = [each.found for each in moved if each.found is not None and each.state in CLAIMS]
    ended = len(found) + sum(each.state not in CLAIMS for each in moved)
    after = f", after {median(found):.1f} s (median)" if found else ""
    yield Row(
        f"put elsewhere while mapping, {drives} drives: found again, or stated as lost",
        f"{len(found)} found{after}; {ended} of {drives}",
        "all",
        ended == drives,
    )
    for what, runs in (("put elsewhere", moved), ("in the map of another flat", others)):
        wrong = sum(each.wrong for each in runs)
        yield Row(f"{what}, {drives} drives: wrong claims", str(wrong), "0", wrong == 0)
