"""The chassis: exact arcs, and the statistics of slip."""

from math import pi
from random import Random
from statistics import fmean, pstdev

import pytest

from diffbotctl.plant.chassis import Chassis

TRACK, RADIUS = 0.125, 0.0325  # m


def body(slip=0.0, seed=1):
    return Chassis(TRACK, RADIUS, RADIUS, slip, Random(seed))


@pytest.mark.parametrize(
    "left, right, pose",  # ways of the tyres in m
    [
        (1.0, 1.0, (1.0, 0.0, 0.0)),
        (-0.5, -0.5, (-0.5, 0.0, 0.0)),
        # On the spot by a quarter turn to the left: each tyre rolls pi/2 x 62.5 mm.
        (-pi / 32, pi / 32, (0.0, 0.0, pi / 2)),
        # A quarter of a circle of 0.3 m: tyres on 0.2375 m and 0.3625 m.
        (0.2375 * pi / 2, 0.3625 * pi / 2, (0.3, 0.3, pi / 2)),
        (0.3625 * pi / 2, 0.2375 * pi / 2, (0.3, -0.3, -pi / 2)),
        (0.2375 * 2 * pi, 0.3625 * 2 * pi, (0.0, 0.0, 2 * pi)),  # all round, unwrapped
        (0.0, TRACK * pi, (0.0, TRACK, pi)),  # round the left wheel
    ],
)
@pytest.mark.parametrize("steps", [1, 7])
def test_arcs(left, right, pose, steps):
    made = body()
    for k in range(1, steps + 1):
        made.roll(left / RADIUS * k / steps, right / RADIUS * k / steps)
    assert (made.x, made.y, made.heading) == pytest.approx(pose, abs=1e-12)


def test_travel_and_turning_add_up_there_and_back():
    made = body()
    made.roll(10.0, 10.0)
    made.roll(0.0, 0.0)
    assert made.travel == pytest.approx(20 * RADIUS) and made.x == pytest.approx(0.0, abs=1e-12)
    made.roll(-1.0, 1.0)
    made.roll(0.0, 0.0)
    assert made.turned == pytest.approx(4 * RADIUS / TRACK)


def test_slip_has_the_stated_spread():
    # Over 1 m each wheel is off by 0.5 mm: the middle by 0.5 / sqrt(2) mm, the heading by
    # 0.5 sqrt(2) / 125 rad. Spreads of 400 runs scatter by 3.5 %; 12 % are allowed.
    ends = []
    for seed in range(400):
        made = body(0.0005, seed)
        for k in range(1, 334):
            made.roll(0.003 * k / RADIUS, 0.003 * k / RADIUS)
        ends.append(made)
    assert pstdev([b.x for b in ends]) == pytest.approx(0.000354, rel=0.12)
    assert pstdev([b.heading for b in ends]) == pytest.approx(0.005657, rel=0.12)
    assert fmean([b.heading for b in ends]) == pytest.approx(0.0, abs=0.0009)  # three sigma


@pytest.mark.parametrize("cut", [1, 3, 20])  # rolled by 10, 3.3 and 0.5 mm
def test_slip_does_not_depend_on_the_step_size(cut):
    ends = []
    for seed in range(200):
        made = body(0.0005, seed)
        for k in range(1, 50 * cut + 1):
            made.roll(0.01 * k / cut / RADIUS, 0.01 * k / cut / RADIUS)
        ends.append(made.heading)
    # 0.5 m: 0.5 mm x sqrt(0.5) x sqrt(2) / 125 mm = 4 mrad; spreads of 200 runs scatter by 5 %.
    assert pstdev(ends) == pytest.approx(0.004, rel=0.15)


def test_a_robot_at_rest_does_not_slip():
    made = body(0.0005)
    made.roll(3.0, 3.0)
    pose = (made.x, made.y, made.heading)
    for _ in range(100):
        made.roll(3.0, 3.0)
    assert (made.x, made.y, made.heading) == pose
