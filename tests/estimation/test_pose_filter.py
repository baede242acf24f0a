"""Pose from wheel travel: the exact arc, corrections of the start, and the covariance."""

from math import cos, hypot, pi, sin
from random import Random
from typing import NamedTuple

import pytest

from diffbotctl.estimation.pose_filter import PoseFilter, arc

TRACK = 0.125  # m


class Wheel(NamedTuple):
    travel: float
    start_correction: float = 0.0
    speed: float = 0.0
    variance: float = 0.0


@pytest.mark.parametrize(
    "left, right, pose",
    [
        (1.0, 1.0, (1.0, 0.0, 0.0)),
        (-0.5, -0.5, (-0.5, 0.0, 0.0)),
        (-pi * TRACK / 4, pi * TRACK / 4, (0.0, 0.0, pi / 2)),  # a quarter turn on the spot
        # A quarter circle to the left about a point 1 m away: outer wheel 1.0625 m, inner 0.9375 m.
        (0.9375 * pi / 2, 1.0625 * pi / 2, (1.0, 1.0, pi / 2)),
        (0.0, TRACK * pi, (0.0, TRACK, pi)),  # half a circle about the left wheel
    ],
)
def test_one_frame_is_one_exact_arc(left, right, pose):
    assert arc(0.0, 0.0, 0.0, left, right, TRACK) == pytest.approx(pose, abs=1e-12)


def test_a_quarter_turn_in_many_frames_is_accurate_to_a_fifth_of_a_millimetre():
    x = y = heading = 0.0
    for _ in range(63):
        step = pi / 2 / 63
        x, y, heading = arc(x, y, heading, 0.9375 * step, 1.0625 * step, TRACK)
    assert hypot(x - 1.0, y - 1.0) < 0.0002


def test_a_correction_of_the_initial_travel_turns_the_path_about_the_start():
    pose = PoseFilter(TRACK, slip=0.0)
    pose.move(Wheel(1.0), Wheel(1.0))
    # The right wheel went 1.25 mm further at the start: 10 mrad to the left, 0.6 mm ahead.
    pose.move(Wheel(0.0), Wheel(0.0, start_correction=0.00125))
    assert pose.heading == pytest.approx(0.01)
    assert (pose.x, pose.y) == pytest.approx((cos(0.01) + 0.000625, sin(0.01)))


def test_a_restarted_board_starts_from_the_present_pose():
    pose = PoseFilter(TRACK, slip=0.0)
    pose.move(Wheel(2.0), Wheel(2.0))
    pose.start()
    pose.move(Wheel(0.0), Wheel(0.0, start_correction=0.00125))
    assert pose.y == 0.0, "what was learnt of the new start turns nothing that came before it"


def test_covariance_of_slip_agrees_with_a_sample_of_robots():
    slip, robots = 0.002, 1500  # m per square root of a metre
    ends = [slipped(slip, Random(seed)) for seed in range(robots)]
    pose = PoseFilter(TRACK, slip)
    for left, right in FRAMES:
        pose.move(Wheel(left), Wheel(right))
    covariance = pose.message(0, Wheel(0.0), Wheel(0.0)).covariance
    means = [sum(end[i] for end in ends) / robots for i in range(3)]
    pairs = [(0, 0), (0, 1), (0, 2), (1, 1), (1, 2), (2, 2)]
    for (i, j), entry in zip(pairs, covariance, strict=True):
        seen = sum((end[i] - means[i]) * (end[j] - means[j]) for end in ends) / robots
        scale = (covariance[pairs.index((i, i))] * covariance[pairs.index((j, j))]) ** 0.5
        # A covariance from 1500 robots is good to about 2.6 % of its scale; four times that.
        assert seen == pytest.approx(entry, abs=0.11 * scale)


FRAMES = [(0.01, 0.01)] * 40 + [(0.01, 0.014)] * 30 + [(0.01, 0.01)] * 40  # m: a bend of 55 deg


def slipped(slip: float, rng: Random) -> tuple[float, float, float]:
    x = y = heading = 0.0
    for left, right in FRAMES:
        left += rng.gauss(0.0, slip * left**0.5)
        right += rng.gauss(0.0, slip * right**0.5)
        x, y, heading = arc(x, y, heading, left, right, TRACK)
    return x, y, heading


def test_variance_of_a_wheel_adds_variance_of_heading_and_lateral_position():
    pose = PoseFilter(TRACK, slip=0.0)
    pose.move(Wheel(1.0), Wheel(1.0))
    doubtful = Wheel(0.0, variance=1e-6)  # 1 mm
    xx, xy, xh, yy, yh, hh = pose.message(0, doubtful, doubtful).covariance
    assert hh == pytest.approx(2e-6 / TRACK**2)
    assert yy == pytest.approx(hh)  # one metre away
    assert yh == pytest.approx(hh)
    assert xx == pytest.approx(0.25 * 2e-6)
    assert (xy, xh) == pytest.approx((0.0, 0.0), abs=1e-15)
