"""Driving straight when commanded to: worked examples, and simulated robots."""

from math import pi, radians
from random import Random
from statistics import median

import pytest

from diffbotctl.blocks.heading_hold import HeadingHold
from diffbotctl.log import WARNING, Logbook
from diffbotctl.messages import Odometry, Stop, Twist
from tests.sampling import by_day
from tests.support.trials.straight import straight_drive

STEP = 50_000_000  # ns between two twists
NONE = (0.0,) * 6


class Bench:
    """The block with a robot whose pose and speed the test states."""

    def __init__(self):
        self.block = HeadingHold(track=0.12, lag=0.1, command_delay=0.05)
        self.book = Logbook()
        self.block.log = self.book.source_log("straight")
        self.block.reset()
        self.now = 0

    def step(self, linear=0.2, angular=0.0, heading=0.0, turn=0.0, speed=0.2, **more):
        """The angular velocity for a twist; `heading` and `turn` of the robot in degrees."""
        self.now += STEP
        odometry = Odometry(
            self.now,
            0.0,
            0.0,
            radians(heading),
            speed,
            radians(turn),
            NONE,
            more.get("warning", ""),
        )
        twist = Twist(self.now, linear, angular)
        odometry = None if more.get("silent") else odometry
        held = self.block.react(self.now, twist, odometry, more.get("stop"))
        assert held.linear == linear and held.time == self.now
        return held.angular


def started():
    """A bench on which the robot has begun to drive with heading 0."""
    bench = Bench()
    assert bench.step(speed=0.0) == 0.0
    assert bench.step(speed=0.1) == 0.0
    return bench


# The gain is 0.45 / (0.1 s + 0.05 s) = 3 1/s: 1 degree, 0.01745 rad, gives 0.0524 rad/s.
# The integral adds 0.15 x 3 x 3 x 0.01745 x 0.05 s = 0.0012 rad/s in the first step.
@pytest.mark.parametrize("sign", [1, -1])
def test_a_small_error_is_corrected_against_its_direction(sign):
    assert started().step(heading=sign * 1.0) == pytest.approx(-sign * 0.0536, abs=1e-4)


@pytest.mark.parametrize("linear", [0.2, -0.2, 0.05])
def test_the_correction_is_at_most_a_fifth_of_the_speed(linear):
    bench = Bench()
    bench.step(linear=linear, speed=0.0)
    bench.step(linear=linear, speed=linear)
    # A fifth of 0.2 m/s at the rim, 6 cm from the middle, is 0.667 rad/s.
    assert bench.step(linear=linear, speed=linear, heading=14.0) == pytest.approx(
        -0.2 * abs(linear) / 0.06
    )


def test_a_twist_that_turns_is_passed_and_sets_a_new_heading():
    bench = started()
    assert bench.step(angular=0.5, heading=3.0, turn=30.0) == 0.5
    # 30 deg/s for another 0.15 s turn it by 4.5 degrees: it comes to rest at 7.5.
    assert bench.step(heading=3.0, turn=30.0) > 0.0
    assert bench.step(heading=7.5) == pytest.approx(0.0, abs=0.02)


def test_beyond_15_degrees_it_is_no_longer_held_and_reported_once():
    bench = started()
    assert bench.step(heading=14.0) < 0.0
    assert [bench.step(heading=angle) for angle in (16.0, 10.0, 1.0)] == [0.0, 0.0, 0.0]
    assert [level for level, _, _ in bench.book.lines] == [WARNING]
    bench.step(speed=0.0, heading=16.0)  # standstill
    assert bench.step(heading=16.0) == 0.0
    assert bench.step(heading=17.0) < 0.0, "held again, from where it stood"


def test_at_standstill_the_reference_is_dropped():
    bench = started()
    bench.step(speed=0.0, heading=5.0)  # an obstacle stop holds it, and a person turns it
    assert bench.step(heading=5.0) == 0.0


@pytest.mark.parametrize(
    "more",
    [
        {"warning": "edges are missing"},
        {"silent": True},
        {"stop": Stop(0, "obstacle", "something stands ahead", False)},
        {"linear": 0.0},
    ],
)
def test_it_holds_nothing_where_it_cannot_or_must_not(more):
    assert started().step(heading=5.0, **more) == 0.0


def test_the_reference_of_a_long_arc_wraps():
    bench = Bench()
    bench.step(heading=725.0, speed=0.0)
    bench.step(heading=725.0)
    assert abs(bench.step(heading=725.5)) < 0.05
    assert pi > abs(bench.block.reference - radians(725.0))


@pytest.mark.nightly
@pytest.mark.parametrize("robot", by_day(1, ["book_2wd", "book_2wd_counts"]))
def test_simulated_robots_drive_straight(robot):
    rng = Random("straight")
    drives = [straight_drive(robot, rng.getrandbits(32)) for _ in range(12)]
    # 100 robots: median 0.33 degrees, worst 1.4; without the block 7 to 40.
    assert median(abs(drive.estimated) for drive in drives) <= 1.0
    assert max(abs(drive.estimated) for drive in drives) <= 4.0
    assert median(abs(drive.actual) for drive in drives) <= 1.5


def swings(lag, delay=0.05, seconds=12.0):
    """Largest heading error (degrees) in each quarter of a drive, of a robot that turns with `lag`
    (s) and `delay` (s) after its commands and was turned by 5 degrees; the block assumes 0.1 s."""
    bench = started()
    heading, rate, sent = 5.0, 0.0, [0.0] * round(delay / 0.05)
    largest = [0.0] * 4
    steps = round(seconds / 0.05)
    for step in range(steps):
        sent.append(bench.step(heading=heading, turn=rate))
        rate += (sent.pop(0) * 180 / pi - rate) * 0.05 / lag
        heading += rate * 0.05
        quarter = 4 * step // steps
        largest[quarter] = max(largest[quarter], abs(heading))
    return largest, bench.block.gain_share


def test_a_robot_as_quick_as_stated_does_not_swing():
    largest, share = swings(0.1)
    assert largest[1] < 0.5 and share == 1.0


@pytest.mark.parametrize("delay", [0.3, 0.4])
def test_a_robot_that_is_slower_than_stated_stops_swinging(delay):
    """At the full gain of 3 1/s the swings stay at 4 and at more than 10 degrees."""
    largest, share = swings(0.3, delay)
    assert share < 0.6
    assert largest[3] < 1.0 < largest[0]
