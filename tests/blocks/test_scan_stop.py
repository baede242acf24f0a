"""Scan stop: allowed velocities computed by hand; random commands cause no contact."""

from math import cos, hypot, inf, nan, pi, sin
from random import Random

import pytest

from diffbotctl.blocks.scan_stop import BLIND, OBSTACLE, STALE, ScanStop, points_around
from diffbotctl.config.load import load_robot
from diffbotctl.geometry.footprint import PointTracker
from diffbotctl.messages import Odometry, Scan, Twist
from diffbotctl.plant.chassis import Pose
from diffbotctl.plant.collision import BodyOutline, clearance
from diffbotctl.plant.world import Pillar, Wall, World
from diffbotctl.time import MILLISECOND as MS
from tests.sampling import by_day

ROBOT = load_robot("turtlebot3_burger").robot
# It reaches 38 mm ahead of its axle, 102 mm back and 89 mm to the sides; its scanner sits 32 mm
# behind the axle. It reacts within 40 + 1 + 50 ms = 91 ms and brakes by 1 m/s2.
FRONT, BACK, HALF, EYE = 0.038, 0.102, 0.089, -0.032
MARGIN = 0.05


def guard(**changes):
    """The block with the values of the robot file."""
    known = {
        "sensors": ROBOT.sensors,
        "front": FRONT,
        "back": BACK,
        "width": 2 * HALF,
        "braking": 1.0,
        "speed": 0.22,
        "track": 0.16,
        "telemetry": 25.0,
        "command_delay": 0.001,
        "lag": 0.05,
    }
    return ScanStop(**{**known, **changes})


def scan_of(world, time=0, x=0.0, y=0.0, heading=0.0):
    """What the scanner sees when base_link is at that pose."""
    x, y = x + EYE * cos(heading), y + EYE * sin(heading)
    seen = [world.distance(x, y, heading + ray * 2 * pi / 360) for ray in range(360)]
    return Scan(time, 0.0, 2 * pi / 360, tuple(seen))


def still(time):
    return Odometry(time, 0.0, 0.0, 0.0, 0.0, 0.0, (0.0,) * 6)


def asked(world, linear, angular, block=None):
    """The allowed velocity of the robot at rest, and the stop code."""
    block = block or guard()
    twist, stop = block.react(MS, Twist(MS, linear, angular), scan_of(world), still(0))
    return twist.linear, twist.angular, stop.code if stop else ""


def across(x):
    """A wall across the way, `x` ahead of the axle."""
    return World([Wall(x, -1.0, x, 1.0)])


FAR = World([Wall(-3.0, -1.0, -3.0, 1.0)])  # seen, and in the way of nothing

# From 0.2 m/s: 91 ms of reaction and 100 ms of braking at half speed, as one at full: 38.2 mm.
# 70 % of it: 0.14 x (0.091 + 0.07) = 22.5 mm.
NEEDED, NEEDED_70 = 0.2 * 0.191, 0.14 * 0.161


@pytest.mark.parametrize(
    ("world", "linear", "angular", "expected"),
    [
        (FAR, 0.2, 0.5, (0.2, 0.5, "")),
        (across(1.0), 0.2, 0.0, (0.2, 0.0, "")),
        (across(FRONT + MARGIN + NEEDED + 0.002), 0.2, 0.0, (0.2, 0.0, "")),
        (across(FRONT + MARGIN + NEEDED - 0.002), 0.2, 0.0, (0.14, 0.0, "")),
        (across(FRONT + MARGIN + NEEDED_70 - 0.002), 0.2, 0.0, (0.1, 0.0, "")),
        (across(FRONT + MARGIN - 0.001), 0.2, 0.0, (0.0, 0.0, OBSTACLE)),
        # motion away from it and standstill are allowed
        (across(FRONT + MARGIN - 0.001), -0.2, 0.0, (-0.2, 0.0, "")),
        (across(FRONT + 0.001), 0.0, 0.0, (0.0, 0.0, "")),
        # a wall behind prevents only driving backwards
        (across(-BACK - MARGIN + 0.001), -0.2, 0.0, (0.0, 0.0, OBSTACLE)),
        (across(-BACK - MARGIN + 0.001), 0.2, 0.0, (0.2, 0.0, "")),
        # a wall at the side: its points ahead come nearer only where that is within the margin
        (World([Wall(-2, HALF + 0.051, 2, HALF + 0.051)]), 0.2, 0.0, (0.2, 0.0, "")),
        (World([Wall(-2, HALF + 0.030, 2, HALF + 0.030)]), 0.2, 0.0, (0.0, 0.0, OBSTACLE)),
        # a pole beside the tail is swept by it when it turns away from the pole
        (World([], [Pillar(-0.09, HALF + 0.03, 0.01)]), 0.0, -1.0, (0.0, 0.0, OBSTACLE)),
    ],
)
def test_allowed_velocities(world, linear, angular, expected):
    assert asked(world, linear, angular) == pytest.approx(expected)


def test_turning_is_allowed_where_driving_is_not():
    # Its skin is 50.5 mm before the front. The slowest drive that is tried, 0.02 m/s for 0.101 s,
    # takes 2 mm of it; the turn by 0.5 rad/s for 0.111 s takes 0.15 m (1 - cos 3.2 deg) = 0.2 mm.
    found = asked(World([], [Pillar(0.15, 0.0, 0.0615)]), 0.2, 0.5)
    assert found == pytest.approx((0.0, 0.5, OBSTACLE))


def test_a_turn_about_a_wheel_becomes_one_on_the_spot():
    # 0.04 m/s at 0.5 rad/s: half the track, 0.08 m, times the rate. It makes way, so it is no stop.
    assert asked(FAR, 0.04, 0.5) == (0.04, 0.5, "")
    found = asked(World([], [Pillar(0.15, 0.0, 0.0615)]), 0.04, 0.5)
    assert found == pytest.approx((0.0, 0.5, ""))


def test_without_a_fresh_scan_it_stops_with_a_code():
    block = guard()

    def at(now, scan=None):
        return block.react(now * MS, Twist(now * MS, 0.2, 0.0), scan, still(0))

    for now in (1, 300, 600):  # a scanner has 0.6 s for its first turn
        assert at(now) == (Twist(now * MS, 0.0, 0.0), None)
    twist, stop = at(601)
    assert (twist.linear, twist.angular, stop.code) == (0.0, 0.0, STALE)
    again, more = at(602)
    assert again.linear == 0.0
    assert more is None  # sent once
    free, reported = at(603, scan_of(FAR, 603 * MS))
    assert free.linear == 0.2
    assert reported.code == ""
    # A sensor that falls silent later is reported at once: the start is over.
    held, stale = at(604)
    assert held.linear == 0.0
    assert stale.code == STALE


def test_points_move_with_the_odometry_between_scans():
    block = guard()
    scan = scan_of(across(FRONT + MARGIN + NEEDED + 0.02))
    speeds = []
    for frame in range(5):  # 0.2 m/s for 40 ms is 8 mm a frame
        now = frame * 40 * MS
        odometry = Odometry(now, 0.008 * frame, 0.0, 0.0, 0.2, 0.0, (0.0,) * 6)
        twist, _ = block.react(now, Twist(now, 0.2, 0.0), scan, odometry)
        speeds.append(twist.linear)
    # 20 mm to spare are gone after two and a half frames
    assert speeds == pytest.approx([0.2, 0.2, 0.2, 0.14, 0.14])


def test_each_ray_of_a_turn_has_its_own_time_and_parts_of_the_robot_are_none():
    """Four rays of a lidar that turns clockwise in 200 ms, at 1 s: the one to the left sees a mast.

    The robot turns by 1 rad/s: what is behind it was seen 0.1 rad ago.
    """
    block = guard()
    scan = Scan(1000 * MS, 0.0, -pi / 2, (0.4, inf, 0.3, 0.05), 0.2)
    around = points_around(scan, block.mount, block.outline, 0.12, 1.0)
    assert [time for time, _ in around] == [800 * MS, 900 * MS]
    assert around[1][1] == pytest.approx((EYE - 0.3, 0.0))
    turning = Odometry(1000 * MS, 0.0, 0.0, 0.0, 0.0, 1.0, (0.0,) * 6)
    block.react(1000 * MS, Twist(1000 * MS, 0.0, 0.1), scan, turning)
    [behind] = block.points
    assert behind == pytest.approx(((EYE - 0.3) * cos(0.1), (EYE - 0.3) * sin(-0.1)))


def test_too_close_to_measure_is_an_obstacle():
    distances = (0.0,) + (inf,) * 359  # straight ahead, nearer than 0.12 m to the scanner
    block = guard()
    scan = Scan(0, 0.0, 2 * pi / 360, distances)
    twist, stop = block.react(MS, Twist(MS, 0.2, 0.0), scan, still(0))
    assert (twist.linear, stop.code) == (0.0, OBSTACLE)


class Guarded:
    """A guard to which a scanner sends `distances` five times a second; commands come at 50 Hz."""

    def __init__(self, **changes):
        self.block = guard(**changes)
        self.now = 0
        self.scan = None
        self.linear = 0.0
        self.stop = ""

    def drive(self, seconds, distances, linear=0.2, angular=0.0):
        """The commands that pass and the code in force, after `seconds`."""
        passed = []
        for _ in range(round(50 * seconds)):
            self.now += 20 * MS
            if self.now % (200 * MS) == 0:
                self.scan = Scan(self.now, 0.0, 2 * pi / len(distances), tuple(distances))
            odometry = still(self.now)._replace(linear=self.linear)
            twist = Twist(self.now, linear, angular)
            safe, stop = self.block.react(self.now, twist, self.scan, odometry)
            self.linear = safe.linear
            self.stop = stop.code if stop is not None else self.stop
            passed.append(safe)
        return passed

    def drive_at(self, seconds, distances, **command):
        """Speed (m/s) at the end, and the code in force."""
        return self.drive(seconds, distances, **command)[-1].linear, self.stop


CLEAR, SEEN = [inf] * 360, [2.0] * 360
# What does not show that the way is free: no return at all, no numbers, all or most of it too close
# to measure, and a cable over the scanner, which is within the outline (32 mm behind the axle).
NOTHING = {
    "inf": CLEAR,
    "nan": [nan] * 360,
    "zeros": [0.0] * 360,
    "covered but for a ray": [0.0] * 359 + [inf],
    "covered, and a wall beside": [0.0] * 181 + [2.0] * 179,
    "-inf": [-inf] * 360,
    "own cable": [inf] * 180 + [0.06] + [inf] * 179,
    "no rays": [inf],
}


@pytest.mark.parametrize("distances", NOTHING.values(), ids=NOTHING)
def test_a_scanner_that_has_never_seen_anything_starts_nothing(distances):
    robot = Guarded()
    assert all(twist.linear == 0.0 for twist in robot.drive(3.0, distances))
    assert robot.stop == BLIND


@pytest.mark.parametrize("distances", NOTHING.values(), ids=NOTHING)
def test_a_scanner_that_goes_blind_stops_the_robot_until_it_sees_again(distances):
    robot = Guarded()
    assert robot.drive_at(1.0, SEEN) == (0.2, "")
    assert robot.drive_at(1.4, distances) == (0.0, BLIND)  # 1 s, and a turn of the scanner
    assert robot.drive_at(5.0, distances) == (0.0, BLIND)
    assert all(twist.angular == 0.0 for twist in robot.drive(0.5, distances, 0.0, 1.0))
    assert robot.drive_at(0.3, SEEN) == (0.2, "")


def test_what_is_too_close_to_measure_within_the_outline_is_no_return():
    """A body so large that all that is too close, below 0.12 m, is inside of it."""
    robot = Guarded(front=0.2, back=0.2, width=0.4)
    assert robot.drive_at(1.0, SEEN) == (0.2, "")
    assert robot.drive_at(2.0, [0.0] * 90 + [inf] * 270) == (0.0, BLIND)
    assert robot.drive_at(0.3, [0.0] * 90 + [2.0] * 270) == (0.2, "")


def test_a_wall_that_was_seen_is_there_while_the_scanner_sees_nothing():
    """0.16 m would be driven in this time, but the wall is 0.11 m before the margin."""
    robot = Guarded()
    robot.drive(0.2, list(scan_of(across(0.2)).distances))
    passed = robot.drive(0.8, CLEAR)
    assert passed[0].linear > 0.1
    driven = 0.02 * sum(twist.linear for twist in passed)
    assert FRONT + driven < 0.2 - MARGIN + 0.005


@pytest.mark.parametrize("distances", [CLEAR, [nan] * 360])
@pytest.mark.parametrize("linear, angular", [(0.22, 0.0), (-0.2, 0.0), (0.0, 2.8), (0.1, 1.0)])
def test_in_a_declared_open_space_each_point_is_slow(distances, linear, angular):
    robot = Guarded(open_space=True)
    assert robot.drive(1.0, distances, linear, angular)[-1][1:] == (0.0, 0.0)  # not before 1 s
    twist = robot.drive(1.0, distances, linear, angular)[-1]
    corner = hypot(BACK, HALF)
    assert abs(twist.linear) + corner * abs(twist.angular) == pytest.approx(0.1)
    assert twist.linear * angular == pytest.approx(twist.angular * linear)  # the same curve
    assert robot.stop == ""


def test_an_open_space_is_guarded():
    robot = Guarded(open_space=True)
    assert robot.drive_at(3.0, CLEAR) == (pytest.approx(0.1), "")
    assert robot.drive_at(0.5, list(scan_of(across(0.08)).distances)) == (0.0, OBSTACLE)
    assert robot.drive_at(0.5, SEEN) == (0.2, "")
    assert robot.drive_at(2.0, [0.0] * 360) == (0.0, OBSTACLE)


def test_a_return_in_each_second_is_enough():
    robot = Guarded()
    for _ in range(5):
        robot.drive(0.2, [inf] * 359 + [3.0])
        assert robot.drive_at(0.6, CLEAR) == (0.2, "")


@pytest.mark.parametrize("seed", by_day(6, range(25)))
def test_random_commands_never_cause_a_contact(seed):
    """A robot that obeys after one frame and ramps as its limits say, driven by rng."""
    rng = Random(seed)
    things = [
        Pillar(rng.uniform(-1, 1), rng.uniform(-1, 1), rng.uniform(0.02, 0.2)) for _ in range(8)
    ]
    things = [each for each in things if each.x**2 + each.y**2 > (each.radius + 0.25) ** 2]
    world = World(
        [Wall(-1, -1, 1, -1), Wall(1, -1, 1, 1), Wall(1, 1, -1, 1), Wall(-1, 1, -1, -1)], things
    )
    outline, block = BodyOutline(FRONT, BACK, HALF), guard()
    body, scan = PointTracker(), None
    allowed = Twist(0, 0.0, 0.0)
    linear = angular = 0.0
    velocity = (0.0, 0.0)
    for frame in range(500):  # 20 s
        now = frame * 40 * MS
        x, y, heading = body.pose_at(now)
        assert clearance(outline, Pose(x, y, heading), world) > 0.0
        linear += min(max(allowed.linear - linear, -0.04), 0.04)  # 1 m/s2
        angular += min(max(allowed.angular - angular, -0.5), 0.5)  # 12.5 rad/s2 at the body
        body.update(now, linear, angular)
        if frame % 5 == 0:
            scan = scan_of(world, now, x, y, heading)
        if frame % 12 == 0:
            velocity = rng.uniform(-0.22, 0.22), rng.uniform(-2.84, 2.84)
        odometry = Odometry(now, x, y, heading, linear, angular, (0.0,) * 6)
        allowed = block.react(now, Twist(now, *velocity), scan, odometry)[0]
