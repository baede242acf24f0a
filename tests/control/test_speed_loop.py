"""The board's wheel-speed loop: feed-forward, PI, reversals and stalls, computed by hand."""

from math import pi

import pytest

from diffbotctl.control.speed_loop import (
    INTEGRAL_MAX,
    LOOP_PERIOD,
    SLEW_MAX,
    SpeedGains,
    WheelSpeedLoop,
)

MS = 1_000_000
# 5 rad/s: 0.1 against friction and 5 x 0.08: duty 0.5.
FORWARD = SpeedGains(0.1, 0.08, 0.0, 0.0)
PITCH = 2 * pi / 20


def loop(gains=FORWARD):
    return WheelSpeedLoop(gains, 20)


@pytest.mark.parametrize(
    "target, duty", [(0.0, 0.0), (5.0, 0.5), (-5.0, -0.5), (50.0, 1.0), (-50.0, -1.0)]
)
def test_feed_forward_is_applied_immediately(target, duty):
    wheel = loop()
    wheel.command(0, target)
    assert wheel.duty == pytest.approx(duty)


def test_speed_is_the_last_period_or_the_age_of_the_last_edge():
    wheel = loop()
    wheel.command(0, 5.0)
    wheel.edge(10 * MS)
    assert wheel.measured(20 * MS) is None  # one edge gives no speed
    wheel.edge(60 * MS)
    assert wheel.measured(70 * MS) == pytest.approx(PITCH / 0.050)
    assert wheel.measured(160 * MS) == pytest.approx(PITCH / 0.100)  # upper limit of the speed
    assert wheel.measured(360 * MS) == pytest.approx(PITCH / 0.300)
    assert wheel.measured(361 * MS) is None


def test_proportional_and_integral_parts():
    wheel = loop(SpeedGains(0.1, 0.08, 0.02, 0.5))
    wheel.command(0, 5.0)
    wheel.edge(0)
    wheel.edge(100 * MS)  # pi rad/s: 1.858 too slow
    error = 5.0 - PITCH / 0.1
    assert wheel.tick(100 * MS) == pytest.approx(0.5 + 0.02 * error)
    # The first tick integrates 0.5 x error x 10 ms.
    assert wheel.tick(110 * MS) == pytest.approx(0.5 + 0.02 * (5 - PITCH / 0.1) + 0.005 * error)


def test_the_integral_is_bounded():
    wheel = loop(SpeedGains(0.1, 0.02, 0.0, 50.0))
    wheel.command(0, 5.0)
    for k in range(20):
        wheel.edge(k * 100 * MS)
        wheel.tick(k * 100 * MS + 10 * MS)
    assert wheel.duty == pytest.approx(0.2 + INTEGRAL_MAX)


def test_a_reversal_is_slewed():
    wheel = loop()
    wheel.command(0, 5.0)
    wheel.command(LOOP_PERIOD, -5.0)
    duties = [wheel.tick(k * LOOP_PERIOD) for k in range(1, 23)]
    # From 0.5 to -0.5 by 0.05 a tick: twenty ticks.
    assert duties[:20] == pytest.approx([0.5 - SLEW_MAX * k for k in range(1, 21)])
    assert duties[20:] == pytest.approx([-0.5, -0.5])
    assert wheel.direction == -1


def test_no_edges_for_half_a_second_is_a_stall():
    wheel = loop()
    wheel.command(0, 5.0)
    for k in range(1, 51):
        assert wheel.tick(k * LOOP_PERIOD) == pytest.approx(0.5)
    assert wheel.tick(51 * LOOP_PERIOD) == 0.0 and wheel.fault
    wheel.command(52 * LOOP_PERIOD, 6.0)
    assert wheel.duty == 0.0  # it stays off until the fault is cleared


def test_a_low_duty_is_not_a_stall():
    wheel = loop()
    wheel.command(0, 2.0)  # 0.26, which may not overcome a stiff gear
    for k in range(1, 200):
        wheel.tick(k * LOOP_PERIOD)
    assert not wheel.fault
