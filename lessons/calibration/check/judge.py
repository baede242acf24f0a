"""Squares of a robot whose track and wheels differ from its robot file, by exact arcs."""

from math import cos, hypot, pi, sin
from random import Random

from diffbotctl.block import Block, Every, In, Out
from diffbotctl.messages import Float64, Odometry, Text
from diffbotctl.params import Param

SIDE, TRACK, DIAMETER = 2.0, 0.125, 0.065  # m
NOMINAL = (TRACK, DIAMETER, DIAMETER)


def true_geometry(seed):
    """Track and diameters of the robot with this seed (m)."""
    rng = Random(seed)
    unlike = rng.choice((-1.0, 1.0)) * rng.uniform(0.002, 0.006)
    track = TRACK * (1.0 + rng.choice((-1.0, 1.0)) * rng.uniform(0.01, 0.04))
    return track, DIAMETER * (1.0 - unlike / 2.0), DIAMETER * (1.0 + unlike / 2.0)


def moved(pose, left, right, track):
    """The pose after the wheels have rolled `left` and `right` (m)."""
    x, y, heading = pose
    forward, turn = (left + right) / 2.0, (right - left) / track
    if abs(turn) < 1e-12:
        return x + forward * cos(heading), y + forward * sin(heading), heading
    radius, end = forward / turn, heading + turn
    return x + radius * (sin(end) - sin(heading)), y - radius * (cos(end) - cos(heading)), end


def end_of_square(true, stated, side):
    """Where a square to one side (1 left, -1 right) ends that is exact by the stated geometry."""
    pose = 0.0, 0.0, 0.0
    left, right = true[1] / stated[1], true[2] / stated[2]
    turn = side * pi / 4.0 * stated[0]
    for _ in range(4):
        pose = moved(pose, SIDE * left, SIDE * right, true[0])
        pose = moved(pose, -turn * left, turn * right, true[0])
    return pose


def farthest(true, stated):
    """The larger distance of both ends from the start (m)."""
    return max(hypot(*end_of_square(true, stated, side)[:2]) for side in (1.0, -1.0))


class Squares(Block):
    """Ends of both squares."""

    seed = Param(int, default=1, help="Seed.")
    tick = Every(0.1)
    left = Out(Odometry)
    right = Out(Odometry)

    def react(self, now, tick):
        true = true_geometry(self.seed)
        ends = [end_of_square(true, NOMINAL, side) for side in (1.0, -1.0)]
        return tuple(Odometry(now, *end, 0.0, 0.0, (0.0,) * 6) for end in ends)


class Judge(Block):
    """With the new geometry both squares end at most half as far away."""

    seed = Param(int, default=1, help="Seed.")
    track = In(Float64)
    left = In(Float64)
    right = In(Float64)
    finding = Out(Text)

    def react(self, now, track, left, right):
        if track is None or left is None or right is None:
            return None
        found, true = (track.data, left.data, right.data), true_geometry(self.seed)
        if min(found) <= 0.0:
            return Text(now, "negative: " + ", ".join(f"{value:g} m" for value in found))
        before, after = farthest(true, NOMINAL), farthest(true, found)
        seen = f"{1000.0 * before:.0f} mm before, {1000.0 * after:.0f} mm with the new values"
        mean = (found[1] + found[2]) / 2.0
        if abs(mean - DIAMETER) > 1e-5:
            return Text(now, f"mean: {1000.0 * mean:.2f} mm")
        if after > before:
            return Text(now, f"worse: {seen}")
        if after > before / 2.0:
            return Text(now, f"half: {seen}")
        return Text(now, "passed")
