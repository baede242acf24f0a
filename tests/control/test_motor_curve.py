"""The law from the duty of a motor to its speed, by hand."""

import pytest

from diffbotctl.control.motor_curve import VISCOUS, MotorCurve

SLOW = MotorCurve(static=0.1, rated=10.0, lag=0.1)
FAST = MotorCurve(static=0.1, rated=10.0, lag=0.1, viscous=VISCOUS)


def test_the_speed_is_linear_beyond_the_dead_band_with_slow_decay():
    assert SLOW.speed(0.55) == pytest.approx(5.0)
    assert SLOW.speed(1.0) == pytest.approx(10.0) and SLOW.speed(0.05) == 0.0


def test_open_windings_between_the_pulses_turn_the_motor_faster_at_a_small_duty():
    """Duty 0.55 settles at 10 x 1.05 / 0.9 x (0.55 - 0.1) / (0.55 + 0.05) = 8.75 rad/s."""
    assert FAST.speed(0.55) == pytest.approx(8.75)
    assert FAST.speed(1.0) == pytest.approx(10.0) and FAST.speed(0.05) == 0.0


def test_friction_stops_a_motor_with_open_windings():
    """From 8 rad/s with lag 0.1 s at 0.6: at duty 0 the damping is 0.05, the lag 1.2 s and the
    friction 10 x 1.05 / 0.9 x 0.1 / 0.05 = 23.3 rad/s against it: 1.2 ln(31.3 / 23.3) = 0.35 s."""
    speed, travel = FAST.moved(8.0, 0.0, 0.34)
    assert 0.0 < speed < 0.4
    assert FAST.moved(8.0, 0.0, 1.0) == (0.0, pytest.approx(travel, abs=0.01))


def test_a_motor_with_slow_decay_follows_with_its_lag():
    """A step to 5 rad/s: after one lag 63.2 %, and 0.0368 lags x 5 behind 0.1 x 5."""
    speed, travel = SLOW.moved(0.0, 0.55, 0.1)
    assert speed == pytest.approx(3.1606, abs=1e-4) and travel == pytest.approx(0.18394, abs=1e-5)
