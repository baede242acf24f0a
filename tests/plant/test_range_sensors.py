"""Laser scanner, overhead camera, the start and the field of the simulated robot, by hand."""

from itertools import pairwise
from math import inf, pi
from random import Random

import pytest

from diffbotctl.config.load import load, load_robot
from diffbotctl.drivers.simulated_robot import simulated_robot_driver
from diffbotctl.geometry.lidars import LIDARS
from diffbotctl.messages import Odometry, Scan, Wheels
from diffbotctl.plant.chassis import Pose
from diffbotctl.plant.range_sensors import Scanner
from diffbotctl.plant.robot_parameters import plant_parameters
from diffbotctl.plant.simulated_robot import SimulatedRobot
from diffbotctl.plant.world import Pillar, Wall, World
from diffbotctl.time import MILLISECOND as MS
from diffbotctl.time import SECOND

LDS01 = LIDARS["lds01"]


def robot_of(name, world=None, seed=1):
    robot = load_robot(name).nominal
    return SimulatedRobot(
        "simulated", plant_parameters(robot), robot.simulation, Random(seed), world
    )


def received(plant, until, command=None, every=40 * MS):
    """All (port, message) pairs that arrive until then, with one command per frame."""
    found = []
    for now in range(plant.now + every, until + 1, every):
        plant.advance(now)
        found += plant.deliver()
        if command is not None:
            plant.command(now, Wheels(now, *command))
    return found


def one_turn(scanner, world, pose_at):
    """The scan of one turn; `pose_at` gives the pose of the lidar at a time (ns)."""
    while True:
        now = scanner.due
        scan = scanner.sweep(now, world, pose_at(now))
        if scan is not None:
            return scan


def at_origin(now):
    return Pose()


def test_a_scanner_reports_clear_near_and_measured_rays():
    # four rays, clockwise: 2 m ahead, 5 m right, 0.05 m behind, nothing left
    world = World([Wall(2, -1, 2, 1), Wall(-0.05, -1, -0.05, 1), Wall(-1, -5, 1, -5)])
    scanner = Scanner(LDS01._replace(rays=4, rate=1.0), 0.0, Random(1))
    scan = one_turn(scanner, world, at_origin)
    assert scan.distances == pytest.approx((2.0, inf, 0.0, inf))
    assert (scan.time, scan.duration, scan.step) == (SECOND, 1.0, pytest.approx(-pi / 2))
    assert one_turn(scanner, world, at_origin).time == 2 * SECOND


def test_noise_has_the_stated_spread():
    world = World([], [Pillar(2.0, 0.0, 0.5)])  # 1.5 m ahead
    scanner = Scanner(LDS01._replace(rays=1, rate=50.0), 0.01, Random(1))
    reported = [one_turn(scanner, world, at_origin).distances[0] for _ in range(2000)]
    mean = sum(reported) / len(reported)
    spread = (sum((each - mean) ** 2 for each in reported) / len(reported)) ** 0.5
    assert mean == pytest.approx(1.5, abs=4 * 0.01 / 2000**0.5)
    assert spread == pytest.approx(0.01, rel=0.1)


@pytest.mark.parametrize("upside_down", [False, True])
@pytest.mark.parametrize("kind", ["lds01", "ld19", "rplidar_a1"])
def test_each_ray_is_measured_at_its_own_time(kind, upside_down):
    """The lidar drives at 0.2 m/s and turns by 1.5 rad/s, in a room with a pillar."""
    walls = [Wall(-2, -1, 2, -1), Wall(2, -1, 2, 1.5), Wall(2, 1.5, -2, 1.5), Wall(-2, 1.5, -2, -1)]
    world = World(walls, [Pillar(0.6, 0.3, 0.1)])

    def pose_at(now):
        seconds = now / SECOND
        return Pose(0.2 * seconds, 0.05, 1.5 * seconds)

    model = LIDARS[kind]._replace(reach=9.0)
    scanner = Scanner(model, 0.0, Random(1), upside_down)
    one_turn(scanner, world, pose_at)
    scan = one_turn(scanner, world, pose_at)
    assert scan.duration == pytest.approx(1 / model.rate) and scan.time == 2 * model.period
    sense = 1.0 if upside_down else -1.0
    differing = 0
    for ray, distance in enumerate(scan.distances):
        time = scan.time - round(scan.duration * SECOND * (1 - ray / model.rays))
        x, y, heading = pose_at(time)
        bearing = heading + sense * ray * 2 * pi / model.rays
        differing += distance != pytest.approx(world.distance(x, y, bearing), abs=1e-3)
    assert differing <= 2  # at the edges of the pillar


def test_scans_come_five_times_a_second_and_in_order():
    plant = robot_of("turtlebot3_burger", World([], [Pillar(1.0, 0.0, 0.1)]))
    output = received(plant, 2 * SECOND)
    scans = [message for _, message in output if isinstance(message, Scan)]
    assert len(scans) == 9  # the tenth is still on its way
    assert scans[0].time == 200 * MS
    assert {after.time - before.time for before, after in pairwise(scans)} == {200 * MS}
    times = [message.time for _, message in output]
    assert times == sorted(times)


def test_a_scan_is_measured_from_the_scanner_s_mount():
    # the eye is 32 mm behind the axle, the pillar's skin 0.9 m ahead of the axle
    plant = robot_of("turtlebot3_burger", World([], [Pillar(1.0, 0.0, 0.1)]))
    plant._sensors.scanners[0][1]._spread = 0.0
    (scan, *_) = [m for _, m in received(plant, SECOND // 2) if isinstance(m, Scan)]
    assert scan.distances[0] == pytest.approx(0.932)
    assert scan.distances[180] == inf
    assert scan.step == pytest.approx(-2 * pi / 360)


def test_the_camera_measures_the_true_pose_in_the_world():
    plant = robot_of("turtle")
    poses = [m for _, m in received(plant, SECOND, (2.0, 2.0)) if isinstance(m, Odometry)]
    first, last = poses[0], poses[-1]
    assert (first.x, first.y, first.heading) == pytest.approx((5.544, 5.544, 0.0))
    # 2 rad/s on wheels of 0.2 m: 0.4 m/s straight ahead
    assert last.linear == pytest.approx(0.4, rel=0.02)
    assert last.y == pytest.approx(5.544)
    truth = plant.truth().pose
    assert plant.pose_in_world().x == pytest.approx(5.544 + truth.x)


def test_odom_begins_at_the_start_in_the_world():
    robot = load_robot("turtle").nominal
    start = Pose(1.0, 2.0, pi / 2)
    plant = SimulatedRobot(
        "simulated", plant_parameters(robot), robot.simulation, Random(1), World(), start
    )
    received(plant, SECOND, (2.0, 2.0))
    truth, place = plant.truth().pose, plant.truth_in_world()
    # ahead in odom is up in this world
    assert place == pytest.approx((1.0 - truth.y, 2.0 + truth.x, pi / 2 + truth.heading))
    plant.teleport(4.0, 3.0, 0.0)
    assert plant.truth_in_world() == pytest.approx((4.0, 3.0, 0.0))
    assert plant.truth().pose == pytest.approx((1.0, -3.0, -pi / 2))
    plant.home()
    assert plant.truth_in_world() == pytest.approx(start)


def test_no_robot_leaves_the_field():
    setup = load("turtle")
    driver = simulated_robot_driver(setup, 1)
    plant = driver.robot
    received(plant, 20 * SECOND, (10.0, 10.0))  # 2 m/s would be 40 m
    assert plant.truth_in_world().x == pytest.approx(11.09)
    plant.teleport(-5.0, 99.0, 0.0)
    assert plant.truth_in_world() == pytest.approx((0.0, 11.09, 0.0))


def test_a_hop_is_relative_to_the_robot_s_heading():
    driver = simulated_robot_driver(load("turtle"), 1)
    driver.hop(0, 1.0, pi / 2)  # turn left, then 1 m ahead
    assert driver.robot.truth_in_world() == pytest.approx((5.544, 6.544, pi / 2))
    driver.home(0)
    assert driver.robot.truth_in_world() == pytest.approx((5.544, 5.544, 0.0))
