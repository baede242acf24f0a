"""A robot that wanders among walls and pillars of chance: does it ever touch one?

Each walk is a run of trials, which measures the true outline against the world 20 times a second.
"""

from __future__ import annotations

from collections.abc import Iterator
from functools import partial
from math import cos, hypot, pi, sin
from multiprocessing import Pool
from random import Random
from typing import NamedTuple

from diffbotctl.config.load import load
from diffbotctl.geometry.footprint import distance_to_segment
from diffbotctl.plant.world import Pillar, Wall, World
from diffbotctl.trials.plan import Trial
from diffbotctl.trials.sections import Expectation
from diffbotctl.trials.trial_run import TrialRun
from tests.support.trials.row import Row

WORLDS = 3
MINUTES = 10.0
START_ROOM = 0.45  # m around the start that is left free
ROOM = (3.0, 5.0)  # m, sides of the room
PILLARS = (4, 12)
PILLAR = (0.05, 0.25)  # m, radii
PARTITIONS = (0, 4)
PARTITION = (0.3, 1.2)  # m, lengths


class WanderRun(NamedTuple):
    """One run: least distance to anything (m), way driven (m), turning (rad)."""

    least: float
    way: float
    turned: float


def world_of(rng: Random) -> World:
    """A closed room with pillars and partitions, the robot's start free."""
    wide, deep = (0.5 * rng.uniform(*ROOM) for _ in range(2))
    walls = [
        Wall(-wide, -deep, wide, -deep),
        Wall(wide, -deep, wide, deep),
        Wall(wide, deep, -wide, deep),
        Wall(-wide, deep, -wide, -deep),
    ]
    rounds: list[Pillar] = []
    while len(rounds) < PILLARS[0] or (len(rounds) < PILLARS[1] and rng.random() < 0.85):
        x, y, radius = rng.uniform(-wide, wide), rng.uniform(-deep, deep), 0.0
        radius = rng.uniform(*PILLAR)
        if hypot(x, y) - radius > START_ROOM:
            rounds.append(Pillar(x, y, radius))
    for _ in range(rng.randint(*PARTITIONS)):
        x, y = rng.uniform(-wide, wide), rng.uniform(-deep, deep)
        length, bearing = rng.uniform(*PARTITION), rng.uniform(-pi, pi)
        wall = Wall(x, y, x + length * cos(bearing), y + length * sin(bearing))
        if distance_to_segment(0.0, 0.0, *wall) > START_ROOM:
            walls.append(wall)
    return World(walls, rounds)


def sets_of(world: World) -> list[str]:
    """The world as `--set` has it."""
    walls = ", ".join(
        f"{{from: [{w.x1:.6f}, {w.y1:.6f}], to: [{w.x2:.6f}, {w.y2:.6f}]}}" for w in world.walls
    )
    rounds = ", ".join(
        f"{{at: [{r.x:.6f}, {r.y:.6f}], radius: {r.radius:.6f}}}" for r in world.pillars
    )
    return [f"world.walls=[{walls}]", f"world.obstacles=[{rounds}]"]


def walk(world: World, seed: int, minutes: float) -> WanderRun:
    """Let the robot that `seed` draws wander through `world`."""
    setup = load("wander", sets=sets_of(world))
    trial = Trial("wander", "", "", setup, (), seed, "sim", 60.0 * minutes, Expectation())
    run = TrialRun(trial)
    truth = run.go().truth
    assert truth is not None
    return WanderRun(run.clearance, truth.travel, truth.turned)


def walks(seed: int, robot: int, minutes: float) -> list[WanderRun]:
    """A robot in its three worlds."""
    rng = Random(f"{seed} wander {robot}")
    return [walk(world_of(rng), rng.getrandbits(32), minutes) for _ in range(WORLDS)]


def rows(seed: int, seeds: int, minutes: float = MINUTES) -> Iterator[Row]:
    """Contacts and the least distance, and that it did not just stand there."""
    with Pool() as pool:
        robots = pool.imap(partial(walks, seed, minutes=minutes), range(seeds))
        done = [each for robot in robots for each in robot]
    runs = f"{seeds} seeds x {WORLDS} worlds x {minutes:g} min"
    touched = sum(each.least <= 0.0 for each in done)
    yield Row(f"wander: runs with contact, {runs}", str(touched), "0", touched == 0)
    least = min(each.least for each in done) * 1000
    yield Row("wander: least distance to anything", f"{least:.1f} mm", "> 0 mm", least > 0.0)
    ways = sorted(each.way / minutes for each in done)
    figure = f"{ways[0]:.1f}, {ways[len(ways) // 2]:.1f} m/min"
    yield Row("wander: way driven, least and median", figure, ">= 1 m/min", ways[0] >= 1.0)
