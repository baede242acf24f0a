"""Shortest times from rest to rest: independently computed values, and properties."""

from math import hypot, pi, radians

import pytest
from hypothesis import given
from hypothesis import strategies as st

from diffbotctl.control.motion_profile import (
    MotionLimits,
    drive_time,
    legs,
    ramp_time,
    rest_to_rest_time,
    shortest_turn,
    stopping_turn,
    turn_time,
)

FREE = 100.0  # rad/s; a turn rate that never bounds: the wheels' speed does


def limits(acceleration):
    return MotionLimits(0.34, FREE, acceleration, acceleration, 0.14)


# Published lower bounds for 0.34 m/s and a track of 0.14 m, best of forwards and backwards. As an
# example the first: 1 m / 0.34 m/s = 2.941 s, and one ramp of 0.34 / a: 0.34 s or 0.68 s more.
# Third: 45 deg, 0.707 m, 135 deg. Wheels roll 70 mm x 0.785 = 55 mm and 165 mm. At 1 m/s2 ramps
# take 0.34^2 = 116 mm, so 2 sqrt(0.055) = 0.469 s, 2.080 + 0.34 s, 0.485 + 0.34 s: 3.71 s.
@pytest.mark.parametrize(
    "x, y, heading, at_1, at_half",
    [
        (1.0, 0.0, 0.0, 3.28, 3.62),
        (1.0, 1.0, 90.0, 5.44, 6.17),
        (0.5, 0.5, 180.0, 3.71, 4.57),
        (-0.3, 0.4, -90.0, 2.74, 3.47),
        (0.0, 0.1, 0.0, 1.96, 2.77),
        (2.0, 1.0, 0.0, 7.64, 8.28),
    ],
)
def test_bounds_of_known_goals(x, y, heading, at_1, at_half):
    for acceleration, seconds in ((1.0, at_1), (0.5, at_half)):
        time = rest_to_rest_time(x, y, radians(heading), limits(acceleration))
        assert time == pytest.approx(seconds, abs=0.01)


@pytest.mark.parametrize(
    "distance, seconds",
    [
        (0.0, 0.0),
        # 0.3 m/s, up with 1 and down with 1.5 m/s2: 0.3 + 0.2 s of ramps over 75 mm.
        (0.075, 0.5),
        (0.375, 1.5),  # 0.3 m more at full speed
        (-0.375, 1.5),
        (0.075 / 4, 0.25),  # a triangle of half the height and half the time
    ],
)
def test_ramp_times(distance, seconds):
    assert ramp_time(distance, 0.3, 1.0, 1.5) == pytest.approx(seconds)


@pytest.mark.parametrize(
    "commanded, turned, lag, acceleration, angle",
    [
        (0.0, 1.0, 0.3, 2.0, 0.3),  # the motors' lag alone
        (1.0, 1.0, 0.0, 2.0, 0.25),  # half a second to 0, at 0.5 rad/s on average
        (1.0, 1.0, 0.3, 2.0, 0.55),
        (-1.0, -1.0, 0.3, 2.0, -0.55),
        (1.0, -0.5, 0.2, 2.0, 0.15),  # it has yet to follow its command
    ],
)
def test_a_turn_goes_on(commanded, turned, lag, acceleration, angle):
    assert stopping_turn(commanded, turned, lag, acceleration) == pytest.approx(angle)


def test_the_turn_rate_limits_a_turn():
    # 2 rad/s at an arm of 70 mm is 0.14 m/s; a wheel rolls pi/2 x 70 mm; ramps of 0.14 s.
    slow = MotionLimits(0.34, 2.0, 1.0, 1.0, 0.14)
    assert turn_time(pi / 2, slow) == pytest.approx(pi / 4 + 0.14)


@pytest.mark.parametrize(
    "angle, turned",
    [(0, 0), (190, -170), (-190, 170), (180, 180), (-180, 180), (540, 180), (720, 0), (-90, -90)],
)
def test_shortest_turn(angle, turned):
    assert shortest_turn(radians(angle)) == pytest.approx(radians(turned), abs=1e-12)


@pytest.mark.parametrize(
    "x, y, heading, backwards, expected",
    [
        (1.0, 0.0, 0.0, False, (0, 1.0, 0)),
        (-1.0, 0.0, 0.0, False, (180, 1.0, 180)),
        (-1.0, 0.0, 0.0, True, (0, -1.0, 0)),
        (0.0, 1.0, None, False, (90, 1.0, 0)),
        (0.0, 1.0, 90.0, True, (-90, -1.0, 180)),
        (0.0, 0.0, 90.0, False, (0, 0.0, 90)),  # on the goal: one turn
    ],
)
def test_legs(x, y, heading, backwards, expected):
    first, way, last = legs(x, y, None if heading is None else radians(heading), backwards)
    assert (first, way, last) == pytest.approx(
        (radians(expected[0]), expected[1], radians(expected[2]))
    )


PLACE = st.floats(-3.0, 3.0)


@given(PLACE, PLACE, st.floats(-pi, pi))
def test_bounds_are_consistent(x, y, heading):
    both = rest_to_rest_time(x, y, heading, limits(1.0))
    assert both <= rest_to_rest_time(x, y, heading, limits(1.0), reverse=False)
    assert both <= rest_to_rest_time(x, y, heading, limits(0.5))
    assert both >= drive_time(hypot(x, y), limits(1.0))
    # Left and right are symmetrical.
    assert both == pytest.approx(rest_to_rest_time(x, -y, -heading, limits(1.0)), abs=1e-6)
