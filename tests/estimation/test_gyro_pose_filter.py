"""Dead reckoning with a gyro: where the turns come from, and how well the pose is known."""

from dataclasses import dataclass
from math import hypot, radians, sqrt

import pytest

from diffbotctl.estimation.geometry_deviation import GeometryDeviation
from diffbotctl.estimation.gyro_pose_filter import FAILURE_HEADING_SD, GyroPoseFilter
from diffbotctl.estimation.gyro_turn import TurnStep
from diffbotctl.estimation.pose_filter import PoseFilter
from diffbotctl.time import MILLISECOND

TRACK, SLIP = 0.125, 0.0007
FRAME = 25 * MILLISECOND


@dataclass
class Wheel:
    """A wheel that has travelled 10 mm since the last frame."""

    travel: float = 0.01
    variance: float = 1e-6
    added_variance: float = 0.0
    start_correction: float = 0.0
    end_variance: float = 0.0
    disagreement: float = 0.0
    fault_share: float = 0.0
    coasting_travel: float = 0.0
    speed: float = 0.4


def drive(pose, steps, left=0.01, right=0.01, angle=0.0, start=0, is_driven=True):
    wheels = Wheel(left), Wheel(right)
    for number in range(steps):
        pose.step = TurnStep(angle, 1e-10, 0.025)
        pose.move(*wheels)
        pose.remember((start + number) * FRAME)
        pose.compare_turns(is_driven)
    return wheels


def sd(message, index):
    return sqrt(message.covariance[index])


def test_without_a_step_it_is_the_filter_of_the_wheels():
    one, two = PoseFilter(TRACK, SLIP), GyroPoseFilter(TRACK, SLIP, (), 0.003)
    wheels = Wheel(0.008, start_correction=0.001), Wheel(0.011)
    for _ in range(50):
        one.move(*wheels)
        two.move(*wheels)
    assert one.message(0, *wheels) == two.message(0, *wheels)


@pytest.mark.parametrize("is_calibrated", [True, False])
def test_a_scale_that_is_not_calibrated_is_a_part_of_its_own_of_the_heading(is_calibrated):
    """1.6 rad by both turns; the track is not known at all."""
    pose = GyroPoseFilter(TRACK, SLIP, (GeometryDeviation(track=1.0),), 0.03, is_calibrated)
    message = pose.message(0, *drive(pose, 100, -0.001, 0.001, angle=0.002 / TRACK))
    assert sd(message, 5) == pytest.approx(0.03 * 1.6, rel=0.03)
    assert message.geometry_heading_sd == pytest.approx(0.0 if is_calibrated else 0.048, rel=0.03)


def test_a_calibrated_gyro_decides_beside_wheels_of_which_little_is_known():
    """The track is 2 % off, which the robot file knows: 90 deg by the wheels are 91.8."""
    pose = GyroPoseFilter(TRACK, SLIP, (GeometryDeviation(track=0.05),), 0.003)
    wheels = Wheel(-0.01, variance=0.0), Wheel(0.01, variance=0.0)
    for _ in range(10):
        pose.step = TurnStep(0.02 / TRACK / 1.02, 1e-10, 0.025)
        pose.move(*wheels)
    assert pose.heading == pytest.approx(0.2 / TRACK / 1.02, rel=2e-3)
    assert sd(pose.message(0, *wheels), 5) < 0.005 * pose.heading


def test_the_wheels_decide_beside_a_gyro_of_unknown_scale():
    """1.6 rad at 0.6 rad/s."""
    pose = GyroPoseFilter(TRACK, SLIP, (GeometryDeviation(track=0.005),), 0.03)
    wheels = Wheel(-0.001, variance=0.0), Wheel(0.001, variance=0.0)
    for _ in range(100):
        pose.step = TurnStep(1.03 * 0.002 / TRACK, 1e-10, 0.025)
        pose.move(*wheels)
    assert pose.heading == pytest.approx(0.2 / TRACK, rel=6e-3)


@pytest.mark.parametrize("error", [0.0, 0.04])
def test_a_scale_that_is_not_calibrated_leaves_the_heading_to_wheels_that_are_known_better(error):
    """1.6 rad at 0.6 rad/s; the gyro measures 3 % too much, the track is wrong by `error`."""
    pose = GyroPoseFilter(TRACK, SLIP, (GeometryDeviation(track=0.02),), 0.03)
    wheels = Wheel(-0.001, variance=0.0), Wheel(0.001, variance=0.0)
    for _ in range(100):
        pose.step = TurnStep(1.03 / (1.0 + error) * 0.002 / TRACK, 1e-10, 0.025)
        pose.move(*wheels)
    assert pose.heading == pytest.approx(0.2 / TRACK, rel=6e-3)
    message = pose.message(0, *wheels)
    assert message.geometry_heading_sd == pytest.approx(0.02 * pose.heading, rel=0.1)


def test_a_better_estimate_of_where_a_wheel_began_is_no_error_of_the_gyro():
    """The first edges show that the right wheel has travelled 5 mm more: 2.3 deg."""
    pose = GyroPoseFilter(TRACK, SLIP, (GeometryDeviation(track=0.02),), 0.03)
    turn, late = 0.002 / TRACK, 0.005
    for number in range(100):
        pose.step = TurnStep(turn + (late / TRACK if number == 10 else 0.0), 1e-10, 0.025)
        start = late if number == 10 else 0.0
        pose.move(Wheel(-0.001), Wheel(0.001, start_correction=start))
    assert pose.fusion.errors[0] == pytest.approx(0.0, abs=1e-3)
    assert pose.heading == pytest.approx(100 * turn + late / TRACK, rel=2e-3)


def test_straight_ahead_the_gyro_corrects_unequal_wheels():
    """The right wheel is 0.5 % larger: 2.3 deg a metre by the wheels alone."""
    pose = GyroPoseFilter(TRACK, SLIP, (GeometryDeviation(right=0.005),), 0.03)
    wheels = Wheel(0.01), Wheel(0.01005)
    for _ in range(100):
        pose.step = TurnStep(0.0, 1e-10, 0.025)
        pose.move(*wheels)
    assert abs(pose.heading) < radians(0.4)
    assert abs(pose.heading) < 2.0 * sd(pose.message(0, *wheels), 5)


def test_the_error_of_the_bias_stays_after_a_rest_and_what_was_measured_is_taken_back():
    pose = GyroPoseFilter(TRACK, 0.01, (), 0.0)
    pose.use_gyro(Wheel(variance=0.0), Wheel(variance=0.0), radians(0.1) ** 2)
    for _ in range(40):
        pose.step = TurnStep(radians(0.1) / 40, 1e-12, 0.025)
        pose.move(Wheel(variance=0.0), Wheel(variance=0.0))
    turned = pose.fusion.turn
    assert turned > radians(0.05)
    pose.zeroed(radians(0.1), 1e-10)
    assert abs(pose.fusion.turn) < 0.3 * turned


def test_a_failure_widens_the_covariance_at_once():
    pose = GyroPoseFilter(TRACK, SLIP, (), 0.003)
    wheels = drive(pose, 100)
    before = pose.message(0, *wheels)
    pose.lose_gyro()
    after = pose.message(0, *wheels)
    assert sd(before, 5) < 0.01
    assert sd(after, 5) >= FAILURE_HEADING_SD
    # 0.2 m since half a second ago, at which the heading was still right.
    assert sd(after, 3) >= 0.2 * FAILURE_HEADING_SD


def test_a_failure_takes_back_the_turns_of_the_last_half_second():
    """The gyro is stuck at zero while the robot turns."""
    pose = GyroPoseFilter(TRACK, SLIP, (), 0.003)
    drive(pose, 100)
    drive(pose, 12, -0.005, 0.005, angle=0.0, start=100)
    assert pose.heading == pytest.approx(0.0, abs=0.03)
    pose.lose_gyro()
    assert pose.heading == pytest.approx(12 * 0.01 / TRACK, abs=0.01)
    assert not pose.has_slid


def test_a_wheel_that_slides_does_not_turn_the_robot_and_widens_the_covariance_along_the_way():
    """The right wheel spins in place for 0.2 m: the axle travels 0.1 m less than reported."""
    pose = GyroPoseFilter(TRACK, SLIP, (), 0.003)
    before = sd(pose.message(0, *drive(pose, 20)), 0)
    wheels = drive(pose, 20, 0.0, 0.01, angle=0.0, start=20)
    assert pose.heading == pytest.approx(0.0, abs=0.03)
    assert pose.has_slid and pose.slid_turn == pytest.approx(0.2 / TRACK, rel=0.25)
    assert pose.agreed_path < 0.05
    after = pose.message(0, *wheels)
    assert before < 0.005
    assert sd(after, 0) == pytest.approx(0.1, rel=0.25)
    pose.set_pose(0.0, 0.0, 0.0)
    assert sd(pose.message(0, *wheels), 0) < 0.005 and not pose.has_slid


TURN = 0.02 / TRACK  # of the wheels in a frame, 9.2 deg


def test_a_gyro_with_the_wrong_sign_is_noticed_within_20_deg_and_taken_back():
    """Three frames of 9.2 deg; the heading is that of the wheels afterwards."""
    pose = GyroPoseFilter(TRACK, SLIP, (), 0.003)
    drive(pose, 100)
    drive(pose, 2, -0.01, 0.01, angle=-TURN, start=100)
    assert pose.mounting == "unknown"
    wheels = drive(pose, 1, -0.01, 0.01, angle=-TURN, start=102)
    assert pose.mounting == "opposed"
    pose.lose_gyro()
    assert pose.heading == pytest.approx(3 * TURN)
    by_wheels = sqrt(2 * 1e-6) / TRACK
    expected = hypot(FAILURE_HEADING_SD, by_wheels)
    assert sd(pose.message(0, *wheels), 5) == pytest.approx(expected, rel=0.1)


def test_an_axis_across_is_noticed_within_60_deg_and_the_heading_is_unknown():
    """Seven frames of 9.2 deg: the wheels may have slipped, so half of it is the sd."""
    pose = GyroPoseFilter(TRACK, SLIP, (), 0.003)
    drive(pose, 100)
    drive(pose, 6, -0.01, 0.01, angle=0.2 * TURN, start=100)
    assert pose.mounting == "unknown"
    wheels = drive(pose, 1, -0.01, 0.01, angle=0.2 * TURN, start=106)
    assert pose.mounting == "across"
    pose.lose_gyro()
    assert pose.heading == pytest.approx(7 * TURN)
    assert sd(pose.message(0, *wheels), 5) >= 0.5 * 7 * 0.8 * TURN


@pytest.mark.parametrize(
    ("frames", "turn", "angle", "is_driven"),
    [
        (6, TURN, 0.0, True),  # wheels that slip a little
        (100, 0.0, -TURN, True),  # a robot that is turned by hand, and drives straight
        (100, TURN, -TURN, False),  # one that rolls as a hand turns it: its counts have no sign
        (200, 0.01 * TURN, -0.01 * TURN, True),  # 18 deg in 5 s
    ],
)
def test_what_proves_no_wrong_axis(frames, turn, angle, is_driven):
    pose = GyroPoseFilter(TRACK, SLIP, (), 0.003)
    half = 0.5 * turn * TRACK
    drive(pose, frames, 0.01 - half, 0.01 + half, angle=angle, is_driven=is_driven)
    assert pose.mounting == "unknown"


@pytest.mark.parametrize("later", [-TURN, 0.0])
def test_an_axis_that_was_right_once_stays_so(later):
    """A robot that is pushed around later turns against its wheels, or not with them."""
    pose = GyroPoseFilter(TRACK, SLIP, (), 0.003)
    drive(pose, 10, -0.01, 0.01, angle=0.9 * TURN)
    drive(pose, 100, -0.01, 0.01, angle=later, start=10)
    assert pose.mounting == "right"
