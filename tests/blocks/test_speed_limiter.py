"""Limits of speed and acceleration, with ramps computed by hand."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from diffbotctl.blocks.speed_limiter import SpeedLimiter
from diffbotctl.control.velocity_limits import acceleration_limited, brake_limited
from diffbotctl.messages import Twist
from diffbotctl.time import MILLISECOND as MS

SPEED, TURN_RATE = 0.3, 4.0  # m/s, rad/s


def limiter():
    return SpeedLimiter(
        speed=SPEED, turn_rate=TURN_RATE, acceleration=1.0, braking=1.5, track=0.125
    )


def driven(block, twists):
    """Hands `block` the (time in ms, linear, angular) and returns what comes out of it."""
    return [block.react(t * MS, Twist(t * MS, v, w)) for t, v, w in twists]


@pytest.mark.parametrize(
    "twist, slower",
    [
        ((0.3, 4.0), (0.3, 4.0)),
        ((0.6, 2.0), (0.3, 1.0)),  # half as fast on the same curve
        ((-0.6, 2.0), (-0.3, 1.0)),
        ((0.2, 8.0), (0.1, 4.0)),  # the turn rate asks for half
        ((0.6, 16.0), (0.15, 4.0)),  # the speed asks for a half, the turn rate for a quarter
        ((0.0, -8.0), (0.0, -4.0)),
    ],
)
def test_scaled_as_a_whole(twist, slower):
    assert brake_limited(*twist, SPEED, TURN_RATE) == pytest.approx(slower)


@pytest.mark.parametrize(
    "before, target, after",  # 0.02 a step away from zero, 0.03 towards it
    [
        (0.0, 0.3, 0.02),
        (0.29, 0.3, 0.3),
        (0.3, 0.0, 0.27),
        (0.3, 0.28, 0.28),
        (0.02, 0.0, 0.0),
        (0.1, -0.3, 0.07),
        (0.02, -0.3, 0.0),  # a change of sign takes one step at zero
        (0.0, -0.3, -0.02),
        (-0.3, 0.0, -0.27),
        (-0.01, 0.3, 0.0),
        (-0.1, -0.3, -0.12),
    ],
)
def test_one_step_of_the_ramp(before, target, after):
    assert acceleration_limited(before, target, 0.02, 0.03) == pytest.approx(after)


def test_from_rest_to_the_limit_and_back():
    block = limiter()
    # The first twist counts for 20 ms: 0.02 m/s. Then 0.1 m/s per 100 ms up to the limit, and
    # with 1.5 m/s2 down again: 0.15 m/s per 100 ms.
    out = driven(
        block, [(0, 1, 0), (100, 1, 0), (200, 1, 0), (300, 1, 0), (400, 0, 0), (500, 0, 0)]
    )
    assert [t.linear for t in out] == pytest.approx([0.02, 0.12, 0.22, 0.3, 0.15, 0.0])


def test_turning_is_ramped_by_the_wheels_acceleration():
    # On the spot a wheel's 1 m/s2 at an arm of 62.5 mm is 16 rad/s2: 0.32 rad/s in 20 ms.
    out = driven(limiter(), [(0, 0, 4), (20, 0, 4), (40, 0, 4)])
    assert [t.angular for t in out] == pytest.approx([0.32, 0.64, 0.96])


def test_it_starts_from_rest_after_a_long_silence():
    block = limiter()
    driven(block, [(0, 0.3, 0), (250, 0.3, 0)])
    # 301 ms of silence: the board has stopped by itself, so the ramp begins anew.
    assert driven(block, [(551, 0.3, 0)])[0].linear == pytest.approx(0.02)


def test_it_keeps_its_speed_through_a_short_silence():
    block = limiter()
    driven(block, [(0, 0.3, 0), (250, 0.3, 0)])  # 0.02, then 0.27 m/s
    assert driven(block, [(549, 0.3, 0)])[0].linear == pytest.approx(0.3)


def test_a_single_zero_ends_at_rest():
    # A released key sends one zero. The ramp may take one step, 0.15 of the 0.3 m/s; then it ends.
    block = limiter()
    driven(block, [(0, 0.3, 2.0), (290, 0.3, 2.0), (390, 0.0, 0.0)])
    assert block.linear == pytest.approx(0.15)
    assert block.react(440 * MS, None) == Twist(440 * MS, 0.0, 0.0)
    assert block.react(540 * MS, None) is None, "reported once"
    assert driven(block, [(640, 0.3, 0)])[0].linear == pytest.approx(0.25), "from rest"


def test_a_source_that_falls_silent_in_motion_is_not_stopped_here():
    block = limiter()
    driven(block, [(0, 0.3, 0), (100, 0.3, 0)])
    assert block.react(150 * MS, None) is None  # the mux or the gate stops the robot


def test_no_twist_no_output():
    assert limiter().react(1, None) is None


@given(st.lists(st.tuples(st.integers(1, 290), st.floats(-2, 2), st.floats(-20, 20)), max_size=30))
def test_limits_hold_for_any_commands(steps):
    block, now, linear, angular, first = limiter(), 0, 0.0, 0.0, True
    for step, v, w in steps:
        now += step * MS
        out = block.react(now, Twist(now, v, w))
        seconds, first = (0.02 if first else step / 1000), False
        assert abs(out.linear) <= SPEED + 1e-12 and abs(out.angular) <= TURN_RATE + 1e-12
        assert abs(out.linear) - abs(linear) <= 1.0 * seconds + 1e-12
        assert abs(out.linear - linear) <= 1.5 * seconds + 1e-12
        assert abs(out.angular - angular) <= 1.5 * 16 * seconds + 1e-12
        linear, angular = out.linear, out.angular
