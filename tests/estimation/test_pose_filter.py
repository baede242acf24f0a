"""Pose from wheel travel: the exact arc, corrections of the start, and the covariance."""

from math import cos, hypot, pi, sin
from random import Random
from typing import NamedTuple

import pytest

from diffbotctl.estimation.geometry_deviation import GeometryDeviation, geometry_deviations
from diffbotctl.estimation.pose_filter import PoseFilter, arc

TRACK = 0.125  # m


class Wheel(NamedTuple):
    travel: float
    start_correction: float = 0.0
    speed: float = 0.0
    variance: float = 0.0
    disagreement: float = 0.0
    added_variance: float = 0.0
    end_variance: float = 0.0
    fault_share: float = 0.0


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


def an_l_shaped_path() -> PoseFilter:
    """A metre east, then on the spot to the north, then a metre north: a frame each."""
    pose = PoseFilter(TRACK, slip=0.0)
    pose.move(Wheel(1.0), Wheel(1.0))
    pose.move(Wheel(-pi / 4 * TRACK), Wheel(pi / 4 * TRACK))
    pose.move(Wheel(1.0), Wheel(1.0))
    return pose


SHORT = 0.005 * TRACK  # m; of one wheel back and the other one ahead: 10 mrad


def test_what_the_hypotheses_disagree_about_turns_the_path_about_the_start():
    """1 mm between both wheels, 0.1 m apart, after 1 m ahead: 10 mrad and 10 mm to the side."""
    pose = PoseFilter(0.1, 0.0)
    pose.move(Wheel(1.0), Wheel(1.0))
    covariance = pose.message(0, Wheel(0.0, disagreement=1e-6), Wheel(0.0)).covariance
    assert covariance[5] == pytest.approx(1e-4)
    assert covariance[3] == pytest.approx(1e-4, rel=0.05)


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
    along = 0.25 * 2e-6
    lateral = hh + along  # one metre away
    in_any_direction = 0.2 * 0.2 * lateral
    assert yy == pytest.approx(lateral + in_any_direction)
    assert yh == pytest.approx(hh)
    bend = 0.75 * hh * hh  # (angle^2 / 2)^2 of a normal distribution
    assert xx == pytest.approx(along + bend + in_any_direction)
    assert (xy, xh) == pytest.approx((0.0, 0.0), abs=1e-15)


class Entry(NamedTuple):
    sd: object
    own_sd: object = None


LENGTHS = (TRACK, 0.065, 0.064)  # m: track, left and right diameter


def test_covariance_of_the_geometry_agrees_with_paths_of_a_wrong_geometry():
    """Central differences of whole paths, one for each independent error."""
    errors = geometry_deviations(*LENGTHS, {})
    pose = PoseFilter(TRACK, 0.0, errors)
    for left, right in FRAMES * 3:
        pose.move(Wheel(left), Wheel(right))
    covariance = pose.message(0, Wheel(0.0), Wheel(0.0)).covariance
    entries = [0.0] * 6
    for error in errors:
        high, low = (with_error(error, sign) for sign in (1.0, -1.0))
        x, y, heading = (0.5 * (one - other) for one, other in zip(high, low, strict=True))
        products = (x * x, x * y, x * heading, y * y, y * heading, heading * heading)
        entries = [entry + product for entry, product in zip(entries, products, strict=True)]
    assert covariance == pytest.approx(entries, rel=0.01)
    pose.set_pose(1.0, 2.0, 3.0)
    assert pose.message(0, Wheel(0.0), Wheel(0.0)).covariance == (0.0,) * 6


def with_error(error: GeometryDeviation, sign: float) -> tuple[float, float, float]:
    x = y = heading = 0.0
    for left, right in FRAMES * 3:
        x, y, heading = arc(
            *(x, y, heading),
            left * (1.0 + sign * error.left),
            right * (1.0 + sign * error.right),
            TRACK * (1.0 + sign * error.track),
        )
    return x, y, heading


def test_turns_know_the_track_and_straight_lines_the_diameters():
    calibration = {
        "drive.track": Entry("0.25 mm"),
        "drive.left.wheel.diameter": Entry("65 um"),
        "drive.right.wheel.diameter": Entry(0.000064),
    }
    errors = geometry_deviations(*LENGTHS, calibration)
    diagonal = [(0.002, 0, 0), (0, 0.001, 0), (0, 0, 0.001)]
    assert errors == tuple(pytest.approx(row) for row in diagonal)
    turn, straight = (PoseFilter(TRACK, 0.0, errors) for _ in range(2))
    for _ in range(100):
        turn.move(Wheel(-0.01 * TRACK), Wheel(0.01 * TRACK))  # 2 rad
        straight.move(Wheel(0.01), Wheel(0.01))  # 1 m
    variance = turn.message(0, Wheel(0.0), Wheel(0.0)).covariance[5]
    # 2 rad x 0.2 % for the track; 1 rad x 0.1 % for each wheel.
    assert variance == pytest.approx(0.004**2 + 2 * 0.001**2)
    xx, _, _, yy, _, hh = straight.message(0, Wheel(0.0), Wheel(0.0)).covariance
    assert xx == pytest.approx(2 * 0.0005**2)
    assert hh == pytest.approx(2 * (0.001 / TRACK) ** 2)
    assert yy == pytest.approx(hh / 4)  # the heading error grows evenly along the metre


def test_the_error_of_a_ruler_is_common_to_both_diameters():
    """A straight metre, not calibrated: length 1 mm of 65, heading 0.5 % of each tyre."""
    errors = geometry_deviations(TRACK, 0.065, 0.065, {"drive.track": Entry(None)})
    pose = PoseFilter(TRACK, 0.0, errors)
    pose.move(Wheel(1.0), Wheel(1.0))
    xx, *_, hh = pose.message(0, Wheel(0.0), Wheel(0.0)).covariance
    assert xx == pytest.approx((1 / 65) ** 2 + 2 * 0.0025**2)
    assert hh == pytest.approx(2 * (0.005 / TRACK) ** 2)


def test_the_scale_that_all_lengths_share_changes_the_way_and_no_turn():
    """Squares without a tape: 2 % of the scale; the ratio of the wheels, and the track in wheels,
    are known to 0.01 %."""
    calibration = {
        "drive.track": Entry("2.5 mm", "0.0125 mm"),
        "drive.left.wheel.diameter": Entry("1.3 mm", "0.00325 mm"),
        "drive.right.wheel.diameter": Entry("1.3 mm", "0.00325 mm"),
    }
    errors = geometry_deviations(TRACK, 0.065, 0.065, calibration)
    assert errors == (
        pytest.approx((0.0001, 0, 0)),
        pytest.approx((0, 0.00005, -0.00005)),
        pytest.approx((0.02, 0.02, 0.02), rel=1e-3),
    )
    turn, straight = (PoseFilter(TRACK, 0.0, errors) for _ in range(2))
    for _ in range(100):
        turn.move(Wheel(-0.01 * TRACK), Wheel(0.01 * TRACK))  # 2 rad
        straight.move(Wheel(0.01), Wheel(0.01))  # 1 m
    assert turn.message(0, Wheel(0.0), Wheel(0.0)).covariance[5] == pytest.approx(0.0002**2)
    xx, _, _, _, _, hh = straight.message(0, Wheel(0.0), Wheel(0.0)).covariance
    assert xx == pytest.approx(0.02**2, rel=1e-3)
    assert hh == pytest.approx((0.0001 / TRACK) ** 2)  # what one wheel is larger by, both differ by


def test_a_track_found_in_wheels_that_a_ruler_measured_shares_its_error():
    calibration = {"drive.track": Entry("2.5 mm", "0.0125 mm")}
    errors = geometry_deviations(TRACK, 0.065, 0.065, calibration)
    assert errors[-1] == pytest.approx((1 / 65, 1 / 65, 1 / 65))
    assert errors[0] == pytest.approx((0.0001, 0, 0))


def test_encoders_that_miss_edges_shorten_the_way_together_and_turn_it_apart():
    """A metre with 1 % of the edges of both wheels: in common, and of each by itself."""
    pose = PoseFilter(TRACK, slip=0.0)
    pose.move(Wheel(1.0), Wheel(1.0))
    faulty = Wheel(0.0, fault_share=0.01)
    xx, _, _, _, _, hh = pose.message(0, faulty, faulty).covariance
    assert hh == pytest.approx(2 * (0.01 / TRACK) ** 2)
    lateral = hh / 4  # the heading error grows evenly along the metre
    along = 0.01**2 + 2 * 0.005**2
    assert xx == pytest.approx(along + 0.04 * max(lateral, along))
