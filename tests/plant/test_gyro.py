"""The simulated gyro: its errors, and that it changes nothing else."""

from dataclasses import dataclass
from math import radians
from random import Random

import pytest

from diffbotctl.config.load import load_robot
from diffbotctl.config.simulation import GyroTruth
from diffbotctl.links.diffbot_telemetry import TURN
from diffbotctl.messages import Encoders, Wheels
from diffbotctl.plant.faults import ActiveFaults, Fault
from diffbotctl.plant.gyro import SimulatedGyro
from diffbotctl.plant.imu_mounting import axis_direction, axis_directions
from diffbotctl.plant.simulated_robot import draw_robot
from diffbotctl.time import MILLISECOND, NEVER, SECOND

IDEAL = {
    "scale_spread": 0.0,
    "noise": 0.0,
    "bias": 0.0,
    "drift": 0.0,
    "tilt": 0.0,
    "acceleration_effect": 0.0,
}


@dataclass
class Turntable:
    heading: float = 0.0
    travel: float = 0.0


def truth_of(**values):
    truth = GyroTruth()
    for name, value in {**IDEAL, **values}.items():
        setattr(truth, name, value)
    return truth


def turned(gyro, seconds, rate):
    """Turn at `rate` rad/s; the sum at the end."""
    table = Turntable()
    for time in range(0, round(seconds * SECOND), 10 * MILLISECOND):
        table.heading = rate * time / SECOND
        gyro.measure(time, table)
    return gyro.angle


@pytest.mark.parametrize(
    ("errors", "expected"),
    [
        ({}, 1.98),
        ({"tilt": 0.087}, 1.98 * 0.99622),
        ({"drift": 0.0035}, None),
    ],
)
def test_what_two_seconds_at_1_rad_per_s_give(errors, expected):
    angle = turned(SimulatedGyro(truth_of(**errors), Random(1)), 2.0, 1.0)
    if expected is None:  # the drift has hardly begun: 0.0035 * (1 - exp(-t / 60 s))
        assert 0.0 < abs(angle - 1.98 - 0.01) < 0.011
    else:
        assert angle == pytest.approx(expected + 0.01 * expected / 1.98 - 0.01, abs=0.011)


@pytest.mark.nightly
def test_noise_adds_up_as_a_random_walk():
    """0.005 deg/s/sqrt(Hz) over 16 s: 0.02 deg, from 200 gyros."""
    ends = [
        turned(SimulatedGyro(truth_of(noise=8.7e-5), Random(seed)), 16.0, 0.0)
        for seed in range(200)
    ]
    sd = (sum(end * end for end in ends) / len(ends)) ** 0.5
    assert sd == pytest.approx(4.0 * 8.7e-5, rel=0.2)


def test_the_board_reports_whole_units():
    gyro = SimulatedGyro(truth_of(), Random(1))
    turned(gyro, 2.0, 0.123)
    assert gyro.reported() / TURN == pytest.approx(round(gyro.reported() / TURN))
    assert 0.0 <= gyro.angle - gyro.reported() < TURN


def test_a_failure_is_reported_after_the_board_has_noticed_it():
    gyro = SimulatedGyro(truth_of(), Random(1))
    stuck = Fault("imu_stuck", SECOND, NEVER, (True, True), 0.0)
    gyro.set_faults(SECOND, ActiveFaults([stuck]))
    assert turned(gyro, 2.0, radians(10.0)) == pytest.approx(radians(20.0), abs=0.005)
    assert gyro.fault(SECOND) == ""
    assert gyro.fault(3 * SECOND // 2) == "the rate that the IMU measures does not change"


def test_a_robot_is_the_same_with_and_without_an_imu(tmp_path):
    file = tmp_path / "robot.yaml"
    file.write_text("format: 1\nkind: robot\ninclude: book_2wd\nimu: {type: mpu6050}\n")
    robots = [load_robot(name).nominal for name in ("book_2wd", str(file))]
    frames = []
    for robot in robots:
        plant = draw_robot(robot, robot, 7)
        plant.command(0, Wheels(0, 3.0, 5.0))
        plant.advance(2 * SECOND)
        frames.append([each for _, each in plant.deliver() if isinstance(each, Encoders)])
    without, with_imu = frames
    # A frame has either the turn or the level of a pin.
    assert [each._replace(turn=None) for each in with_imu] == [
        each._replace(left_level=None, right_level=None) for each in without
    ]
    assert all(each.turn is None for each in without)
    assert with_imu[-1].turn is not None and abs(with_imu[-1].turn) > 0.1


@pytest.mark.parametrize(
    ("up", "axis", "expected"),
    [
        ("z", "x", (0.0, 0.3)),  # forward: the left side goes up about it
        ("z", "y", (-0.4, 0.0)),  # to the left: the front goes down about it
        ("-z", "y", (0.4, 0.0)),
        ("-x", "y", (0.0, 0.3)),
        ("-x", "-z", (-0.4, 0.0)),
    ],
)
def test_a_hand_lifts_front_and_left_side(up, axis, expected):
    """The front by 0.4 rad, down again, and the left side by 0.3 rad, read about one axis."""
    gyro, table, sums, now = SimulatedGyro(truth_of(), Random(1)), Turntable(), [], 0
    for front, left in ((0.4, 0.0), (0.0, 0.0), (0.0, 0.3)):
        gyro.lift(now, front, left, 0.5)
        for _ in range(60):
            now += 10 * MILLISECOND
            gyro.measure(now, table, axis_direction(axis, up))
        sums.append(gyro.angle)
    assert sums[0] == pytest.approx(expected[0])
    assert sums[1] == pytest.approx(0.0)
    assert sums[2] == pytest.approx(expected[1])


@pytest.mark.parametrize("up", ["x", "-x", "y", "-y", "z", "-z"])
def test_printed_axes_are_right_handed(up):
    x, y, z = axis_directions(up)
    assert axis_direction(up, up) == (0, 0, 1)
    cross = (x[1] * y[2] - x[2] * y[1], x[2] * y[0] - x[0] * y[2], x[0] * y[1] - x[1] * y[0])
    assert cross == z
