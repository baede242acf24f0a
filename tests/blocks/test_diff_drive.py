"""Body velocity to wheel speeds: the curvature is kept at the limits of the motors."""

from math import pi

import pytest
from hypothesis import given
from hypothesis import strategies as st

from diffbotctl.blocks.diff_drive import DiffDrive, scale_to_rated, wheel_speeds
from diffbotctl.messages import Twist, Wheels

RATED = 10 * pi / 3  # rad/s: 100 rpm
TRACK, DIAMETER = 0.125, 0.065  # m
RADIUS = DIAMETER / 2


def drive(**changes):
    known = {
        "track": TRACK,
        "left_diameter": DIAMETER,
        "right_diameter": DIAMETER,
        "left_rated": RATED,
        "right_rated": RATED,
    }
    return DiffDrive(**{**known, **changes})


@pytest.mark.parametrize(
    "linear, angular, left, right",
    [
        (0.0, 0.0, 0.0, 0.0),
        (0.13, 0.0, 4.0, 4.0),  # 0.13 m/s over a radius of 32.5 mm
        (-0.13, 0.0, -4.0, -4.0),
        # On the spot each tyre runs at 2.08 rad/s x 62.5 mm = 0.13 m/s; to the left the right
        # wheel goes forward (REP-103).
        (0.0, 2.08, -4.0, 4.0),
        (0.0, -2.08, 4.0, -4.0),
        (0.13, 2.08, 0.0, 8.0),  # round the left wheel
        # Arc of radius 0.15 / 0.5 = 0.3 m: tyres at 0.15 -+ 0.5 x 0.0625 = 0.11875, 0.18125 m/s.
        (0.15, 0.5, 0.11875 / RADIUS, 0.18125 / RADIUS),
        # The same arc four times as fast asks 22.3 rad/s of the outer wheel: it gets the rated
        # speed, the inner one (0.3 - 0.0625) / (0.3 + 0.0625) of it.
        (0.6, 2.0, RATED * 0.2375 / 0.3625, RATED),
        (-0.6, -2.0, -RATED * 0.2375 / 0.3625, -RATED),
    ],
)
def test_wheel_speeds(linear, angular, left, right):
    wheels = drive().react(7, Twist(5, linear, angular))
    assert wheels == Wheels(5, pytest.approx(left), pytest.approx(right))


@pytest.mark.parametrize("angular", [0.37, -0.61, 1.7, 2.9])
def test_in_a_turn_about_a_wheel_it_stands(angular):
    """Rounding leaves 1e-16 rad/s of its speed, for which the board would overcome friction."""
    linear = 0.5 * TRACK * abs(angular) * (1.0 + 1e-15)
    wheels = drive().react(1, Twist(1, linear, angular))
    assert min(abs(wheels.left), abs(wheels.right)) == 0.0 < max(wheels[1:])


def test_each_wheel_has_its_own_diameter():
    # 0.12 m/s over radii of 30 mm and 40 mm
    wheels = drive(left_diameter=0.06, right_diameter=0.08).react(1, Twist(1, 0.12, 0.0))
    assert wheels[1:] == pytest.approx((4.0, 3.0))


@pytest.mark.parametrize(
    "rated, linear, left, right",
    [
        ((10.0, 8.0), 0.3, 8.0, 8.0),  # 9.23 rad/s is asked of both: the weaker right one decides
        ((8.0, 10.0), -0.3, -8.0, -8.0),
        ((10.0, 9.5), 0.3, 0.3 / RADIUS, 0.3 / RADIUS),
    ],
)
def test_the_lower_rated_speed_limits_both(rated, linear, left, right):
    block = drive(left_rated=rated[0], right_rated=rated[1])
    assert block.react(1, Twist(1, linear, 0.0))[1:] == pytest.approx((left, right))


def test_no_twist_no_output():
    assert drive().react(1, None) is None


@given(st.floats(-3.0, 3.0), st.floats(-40.0, 40.0))
def test_saturation_keeps_the_curvature(linear, angular):
    asked = wheel_speeds(linear, angular, TRACK, DIAMETER, DIAMETER)
    left, right = scale_to_rated(*asked, RATED, RATED)
    assert max(abs(left), abs(right)) <= RATED * (1 + 1e-12)
    # The way back: body speed and turn rate of what leaves stand in the ratio that was asked.
    speed = (left + right) * RADIUS / 2
    turning = (right - left) * RADIUS / TRACK
    assert speed * angular == pytest.approx(turning * linear, abs=1e-9)
    assert speed * linear >= 0.0 and turning * angular >= -1e-12


@given(st.floats(-RATED, RATED), st.floats(-RATED, RATED))
def test_speeds_within_the_rating_are_unchanged(left, right):
    assert scale_to_rated(left, right, RATED, RATED) == (left, right)
