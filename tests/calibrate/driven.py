"""Drives of a robot whose true geometry is known, made step by step from its wheels."""

from math import cos, pi, sin
from random import Random

import numpy as np

from diffbotctl.calibrate.dead_reckoning import (
    MOTION_CAPTURE,
    TAPE_MEASURE,
    Geometry,
    RecordedDrive,
)

STATED = Geometry(0.065, 0.065, 0.140)
STEP = 0.005  # m that a wheel rolls from one row to the next
PERIOD = 0.02  # s


def square(side, track, clockwise):
    """Ways (m) of the right and left wheel, sides and quarter turns, as odometry commands them."""
    straight, turn = round(side / STEP), round(pi / 4 * track / STEP)
    arc = pi / 4 * track / turn * (-1 if clockwise else 1)
    return 4 * ([(side / straight,) * 2] * straight + [(arc, -arc)] * turn)


def wander(seed, steps=1200):
    """Ways of a drive that curves now left, now right."""
    chance = Random(seed)
    ways = []
    while len(ways) < steps:
        right, left = chance.uniform(0.2, 1) * STEP, chance.uniform(0.2, 1) * STEP
        ways += [(right, left)] * 100
    return ways


def drive(name, ways, true, used=STATED, slip=0.0, ticks=None, seed=0, all_poses=False, every=1):
    """The drive as recorded: odometry with `used` rolled `ways`, the robot has geometry `true`.

    `slip` in m per square root of m; `ticks` a turn, none for exact angles; `every`: rows kept.
    """
    chance = Random(seed)
    turns, poses = [(0.0, 0.0)], [(0.0, 0.0, 0.0)]
    for right, left in ways:
        turned = right / pi / used.right, left / pi / used.left
        turns.append((turns[-1][0] + turned[0], turns[-1][1] + turned[1]))
        rolled = [
            each * pi * wheel + chance.gauss(0, slip * abs(each * pi * wheel) ** 0.5)
            for each, wheel in zip(turned, true[:2], strict=True)
        ]
        x, y, heading = poses[-1]
        middle = heading + (rolled[0] - rolled[1]) / true.track / 2
        way = sum(rolled) / 2
        poses.append((x + way * cos(middle), y + way * sin(middle), 2 * middle - heading))
    counted = np.array(turns)
    if ticks:
        counted = np.floor(counted * ticks + chance.random()) / ticks
        counted -= counted[0]
    keep = np.array(sorted({*range(0, len(turns), every), len(turns) - 1}))
    rows = np.arange(len(keep)) if all_poses else np.array([0, len(keep) - 1])
    tick = 1 / (ticks or 1e6)
    return RecordedDrive(
        name,
        keep * PERIOD,
        counted[keep],
        rows,
        np.array(poses)[keep][rows],
        (tick, tick),
        MOTION_CAPTURE if all_poses else TAPE_MEASURE,
    )


def squares(true, used=STATED, side=1.0, each_way=5, **how):
    """Squares both ways round, seen at their ends."""
    return [
        drive(
            f"{'cw' if clockwise else 'ccw'}-{number}",
            square(side, used.track, clockwise),
            true,
            used,
            seed=2 * number + clockwise,
            **how,
        )
        for clockwise in (True, False)
        for number in range(each_way)
    ]
