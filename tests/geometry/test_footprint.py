"""The outline of the robot and its motion, computed by hand."""

from math import hypot, inf, pi, sqrt

import pytest
from hypothesis import given
from hypothesis import strategies as st

from diffbotctl.geometry.footprint import (
    Footprint,
    PointTracker,
    arc_motion,
    into_frame,
    out_of_frame,
    scan_points,
)

OUTLINE = Footprint(0.1, 0.2, 0.1)


@pytest.mark.parametrize(
    ("x", "y", "expected"),
    [
        (0.0, 0.0, 0.0),  # inside
        (0.1, 0.1, 0.0),  # its corner
        (0.3, 0.0, 0.2),  # ahead of the front
        (-0.5, 0.05, 0.3),  # behind
        (0.0, -0.4, 0.3),  # to the right
        (0.4, 0.5, 0.5),  # off a corner: 0.3 ahead and 0.4 aside
    ],
)
def test_clearance(x, y, expected):
    assert OUTLINE.clearance(x, y) == pytest.approx(expected, abs=1e-12)


def test_reach_is_that_of_the_farthest_corner():
    assert OUTLINE.reach == pytest.approx(hypot(0.2, 0.1))


@pytest.mark.parametrize(
    ("linear", "angular", "seconds", "expected"),
    [
        (0.5, 0.0, 2.0, (1.0, 0.0, 0.0)),
        (0.0, 1.0, 0.5, (0.0, 0.0, 0.5)),
        # a quarter of a circle of radius 1 m, to the left
        (1.0, 1.0, pi / 2, (1.0, 1.0, pi / 2)),
        # and to the right, backwards
        (-1.0, 1.0, pi / 2, (-1.0, -1.0, pi / 2)),
    ],
)
def test_constant_velocity_moves_along_an_arc(linear, angular, seconds, expected):
    assert arc_motion(linear, angular, seconds) == pytest.approx(expected, abs=1e-12)


def test_the_tracker_accumulates_arcs():
    track = PointTracker()
    for quarter in range(5):  # four quarters of a circle lead back
        track.update(quarter * 10**9, 1.0, pi / 2)
    assert (track.x, track.y) == pytest.approx((0.0, 0.0), abs=1e-9)
    assert track.heading == pytest.approx(2 * pi)
    # and a second later it would be on a quarter: radius 2 / pi
    assert track.pose_at(5 * 10**9)[:2] == pytest.approx((2 / pi, 2 / pi))


@given(*[st.floats(-3, 3)] * 5)
def test_frame_transforms_are_inverse(px, py, x, y, heading):
    (back,) = into_frame(out_of_frame([(px, py)], x, y, heading), x, y, heading)
    assert back == pytest.approx((px, py), abs=1e-9)


def test_points_of_a_scan():
    # ahead 1 m; left too close, taken for 0.12 m; behind clear; right too far to matter
    points = scan_points(0.0, pi / 2, (1.0, 0.0, inf, 5.0), nearest=0.12, within=2.0)
    assert [ray for ray, _ in points] == [0, 1]
    assert points[0][1] == pytest.approx((1.0, 0.0), abs=1e-12)
    assert points[1][1] == pytest.approx((0.0, 0.12), abs=1e-12)
    assert scan_points(pi / 4, 1.0, (sqrt(2),), 0.1, 2.0)[0][1] == pytest.approx((1.0, 1.0))
