"""Dead reckoning with a gyro: where the turns come from, and how well the pose is known."""

from dataclasses import dataclass
from math import hypot, pi, radians, sqrt

import pytest

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
    variance: float = 9e-6
    added_variance: float = 0.0
    start_correction: float = 0.0
    late_corrections: tuple[float, ...] = ()
    end_variance: float = 0.0
    disagreement: float = 0.0
    disagreement_frames: int = 0
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
    wheels = Wheel(0.008, start_correction=0.001), Wheel(0.011, late_corrections=(-0.002,))
    for _ in range(50):
        one.move(*wheels)
        two.move(*wheels)
    assert one.message(0, *wheels) == two.message(0, *wheels)


@pytest.mark.parametrize("is_calibrated", [True, False])
def test_a_scale_that_is_not_calibrated_is_a_part_of_its_own_of_the_heading(is_calibrated):
    pose = GyroPoseFilter(TRACK, SLIP, (), 0.03, is_calibrated)
    message = pose.message(0, *drive(pose, 100, -0.001, 0.001, angle=0.03))
    assert sd(message, 5) == pytest.approx(0.03 * 3.0, rel=0.01)
    assert message.geometry_heading_sd == pytest.approx(0.0 if is_calibrated else 0.09, rel=0.01)


def test_the_turn_is_the_gyro_s_and_the_way_the_wheels():
    """The wheels would turn the robot by 4.6 deg in each of the frames."""
    pose = GyroPoseFilter(TRACK, SLIP, (), 0.003)
    drive(pose, 100, 0.005, 0.015, angle=0.0)
    assert (pose.x, pose.y, pose.heading) == pytest.approx((1.0, 0.0, 0.0))
    drive(pose, 100, -0.01, 0.01, angle=radians(0.9), start=100)
    assert pose.heading == pytest.approx(pi / 2)


def test_what_is_known_of_the_heading():
    """Hand-worked: 0.3 % of 90 deg, and 0.02 deg/s for 2.5 s; not the wheels' own 2 deg."""
    pose = GyroPoseFilter(TRACK, SLIP, (), 0.003)
    pose.bias_sd = radians(0.02)
    wheels = drive(pose, 100, -0.01, 0.01, angle=radians(0.9))
    expected = hypot(radians(0.27), radians(0.05), sqrt(100 * 1e-10))
    assert sd(pose.message(0, *wheels), 5) == pytest.approx(expected, rel=1e-6)


def test_the_error_of_the_bias_before_a_rest_is_independent_of_that_after_it():
    pose = GyroPoseFilter(TRACK, SLIP, (), 0.0)
    pose.bias_sd = radians(0.1)
    wheels = drive(pose, 40)
    pose.zeroed()
    drive(pose, 40)
    expected = sqrt(2.0) * radians(0.1)  # a second each
    assert sd(pose.message(0, *wheels), 5) == pytest.approx(expected, rel=1e-3)


def test_a_failure_widens_the_covariance_at_once():
    pose = GyroPoseFilter(TRACK, SLIP, (), 0.003)
    wheels = drive(pose, 100)
    before = pose.message(0, *wheels)
    pose.lose_gyro()
    after = pose.message(0, *wheels)
    assert sd(before, 5) < 0.001
    assert sd(after, 5) >= FAILURE_HEADING_SD
    # 0.2 m since half a second ago, at which the heading was still right.
    assert sd(after, 3) >= 0.2 * FAILURE_HEADING_SD


def test_a_failure_takes_back_the_turns_of_the_last_half_second():
    """The gyro is stuck at zero while the robot turns."""
    pose = GyroPoseFilter(TRACK, SLIP, (), 0.003)
    drive(pose, 100)
    drive(pose, 12, -0.005, 0.005, angle=0.0, start=100)
    assert pose.heading == pytest.approx(0.0)
    pose.lose_gyro()
    assert pose.heading == pytest.approx(12 * 0.01 / TRACK)


def test_a_wheel_that_slides_widens_the_covariance_along_the_way():
    """The right wheel spins in place for 0.2 m: the axle travels 0.1 m less than told, or even less
    if the left one slides, too."""
    pose = GyroPoseFilter(TRACK, SLIP, (), 0.003)
    before = sd(pose.message(0, *drive(pose, 20)), 0)
    wheels = drive(pose, 20, 0.0, 0.01, angle=0.0, start=20)
    assert pose.x == pytest.approx(0.3)
    assert pose.find_slide(*wheels) == pytest.approx(0.2 / TRACK)
    after = pose.message(0, *wheels)
    assert pose.x == pytest.approx(0.2)
    assert before < 0.005
    assert sd(after, 0) == pytest.approx(0.1, rel=0.01)
    assert sd(after, 3) < 0.005
    pose.set_pose(0.0, 0.0, 0.0)
    assert sd(pose.message(0, *wheels), 0) < 0.005


@pytest.mark.parametrize(("left", "right"), [(0.0, 0.01), (-0.01, 0.01)])
def test_what_seemed_to_slide_while_the_gyro_failed_did_not(left, right):
    """The pose is that of a filter which did not look for it."""
    ends = []
    for looks in (False, True):
        pose = GyroPoseFilter(TRACK, SLIP, (), 0.003)
        drive(pose, 100)
        pose.slide.compare_from_here()
        wheels = drive(pose, 6, left, right, angle=0.0, start=100)
        if looks:
            assert pose.find_slide(*wheels)
        wheels = drive(pose, 6, left, right, angle=0.0, start=106)
        pose.lose_gyro()
        ends.append(pose.message(0, *wheels))
        assert not pose.slide.has_slid
    assert ends[1][:4] == pytest.approx(ends[0][:4])
    assert ends[1].covariance == pytest.approx(ends[0].covariance)


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
    by_wheels = sqrt(2 * 9e-6) / TRACK
    expected = hypot(FAILURE_HEADING_SD, by_wheels)
    assert sd(pose.message(0, *wheels), 5) == pytest.approx(expected, rel=0.01)


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
