"""Wander: when it drives and turns, computed by hand; and a sample of random rooms."""

from math import inf, pi

import pytest

from diffbotctl.blocks.wander import Wander, free_distance, freer_side
from diffbotctl.config.load import load_robot
from diffbotctl.messages import Odometry, Scan
from diffbotctl.time import MILLISECOND as MS
from tests.support.trials.wander import START_ROOM, walks, world_of

ROBOT = load_robot("turtlebot3_burger").robot
RADIUS = 0.1354  # m from its axle to its rear corners: hypot(102, 89) mm


def wander():
    return Wander(sensors=ROBOT.sensors, front=0.038, back=0.102, width=0.178, speed=0.22)


def scan(time, **seen):
    """A scan that sees things only at the bearings `ahead`, `left`, `right` (m)."""
    distances = [inf] * 360
    for name, bearing in (("ahead", 0), ("left", 45), ("right", 315)):
        distances[bearing] = seen.get(name, inf)
    return Scan(time, 0.0, 2 * pi / 360, tuple(distances))


def odometry(time, angular=0.0):
    return Odometry(time, 0.0, 0.0, 0.0, 0.0, angular, (0.0,) * 6)


@pytest.mark.parametrize(
    ("points", "expected"),
    [
        ([], inf),
        ([(1.0, 0.0)], 0.9),  # the circle of 0.1 m comes 0.9 m far
        ([(1.0, 0.3)], inf),  # beside the lane of 0.2 m
        ([(1.0, 0.19), (0.6, -0.19)], 0.5),
        ([(-0.5, 0.0)], inf),  # behind
    ],
)
def test_free_distances(points, expected):
    assert free_distance(points, radius=0.1, half=0.2) == pytest.approx(expected)


@pytest.mark.parametrize(
    ("points", "side"),
    [
        ([(0.5, 0.5)], -1),
        ([(0.5, -0.5)], 1),
        ([(0.3, 0.3), (1.0, -1.0)], -1),  # the nearer point decides
        ([(0.3, 0.3), (0.9, -0.9), (0.8, -0.9)], -1),
        ([(-0.5, 0.5), (1.0, -0.5)], 1),  # points behind do not count
        ([], 1),
    ],
)
def test_the_freer_side(points, side):
    assert freer_side(points) == side


def test_it_drives_on_while_the_lane_is_free():
    block = wander()
    twist = block.react(0, scan(0, ahead=2.0), odometry(0))
    assert (twist.linear, twist.angular) == pytest.approx((0.8 * 0.22, 0.0))


def test_it_turns_away_and_keeps_turning_until_there_is_room():
    block = wander()
    # its eye is 32 mm behind the axle: 0.35 m seen is a way of 0.318 - RADIUS, below 0.25 m
    away = block.react(0, scan(0, ahead=0.35, left=0.5), odometry(0))
    assert (away.linear, away.angular) == pytest.approx((0.0, -1.0))
    # 0.7 m seen is a way of 0.53 m: more than it turns at, less than it goes at
    on = block.react(40 * MS, scan(40 * MS, ahead=0.7), odometry(40 * MS, -1.0))
    assert on.angular == pytest.approx(-1.0)
    go = block.react(80 * MS, scan(80 * MS, ahead=0.8), odometry(80 * MS, -1.0))
    assert (go.linear, go.angular) == pytest.approx((0.8 * 0.22, 0.0))


def test_after_a_full_turn_a_smaller_free_distance_is_accepted():
    block = wander()
    block.react(0, scan(0, ahead=0.35), odometry(0))
    for frame in range(1, 180):  # 7.2 s at 1 rad/s: more than a full turn
        now = frame * 40 * MS
        twist = block.react(now, scan(now, ahead=0.7), odometry(now, 1.0))
    assert twist.linear > 0.0


def test_a_blocked_turn_is_reversed():
    block = wander()
    sides = set()
    for frame in range(60):  # 2.4 s without turning
        now = frame * 40 * MS
        twist = block.react(now, scan(now, ahead=0.35, left=0.5), odometry(now, 0.0))
        sides.add(twist.angular)
    assert sides == {-1.0, 1.0}


def test_no_output_without_a_scan():
    assert wander().react(0, None, odometry(0)) is None


def test_random_rooms_leave_the_start_free():
    from random import Random

    for seed in range(20):
        world = world_of(Random(seed))
        seen = [world.distance(0.0, 0.0, ray * 2 * pi / 360) for ray in range(360)]
        assert min(seen) > START_ROOM - 1e-9
        assert len(world.walls) >= 4
        assert len(world.pillars) >= 4


def test_wandering_in_random_rooms_causes_no_contact():
    for each in walks(seed=7, robot=0, minutes=0.4):
        assert each.least > 0.0
        assert each.least > 0.0
        assert each.way > 0.8
