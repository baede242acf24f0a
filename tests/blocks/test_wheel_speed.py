"""Wheel-speed control on the host: feed-forward computed by hand, and the integral."""

from math import pi
from types import SimpleNamespace

import pytest

from diffbotctl.blocks.wheel_speed import INTEGRAL_MAX, KICK_MAX, WheelSpeed, duty
from diffbotctl.messages import Duty, Encoders, Wheels

STEP = 25_000_000  # ns between two instants


def side(static=0.1, rated=10.0, slots=20, speed=None):
    """One side of the drive, as the robot file states it."""
    loop = SimpleNamespace(static=static, speed=speed, proportional=0.0, integral=0.02)
    return SimpleNamespace(
        motor=SimpleNamespace(rated=rated, loop=loop),
        encoder=SimpleNamespace(channels=1, slots=slots, counts=slots),
    )


@pytest.mark.parametrize(
    "target, extra, expected",
    [
        (0.0, 0.2, 0.0),  # at rest the integral is not applied
        (5.0, 0.0, 0.55),  # 0.1 against friction, half of the remaining 0.9
        (-5.0, 0.0, -0.55),
        (10.0, 0.0, 1.0),
        (10.0, 0.1, 1.0),  # limited to full duty
        (5.0, 0.1, 0.65),
        (-5.0, 0.1, -0.65),
        (1.0, -0.5, 0.0),  # 0.19 less 0.5: the sign is the target's, or zero
    ],
)
def test_feed_forward(target, extra, expected):
    assert duty(target, extra, side().motor) == pytest.approx(expected)


def block(left=None, right=None):
    return WheelSpeed(left_side=left or side(), right_side=right or side())


def test_each_side_gets_the_duty_of_its_own_motor():
    controller = block(side(rated=10.472), side(static=0.2, rated=8.0))
    # 0.1 + 5 / 10.472 x 0.9 and 0.2 + 5 / 8 x 0.8, as in calibration
    assert controller.react(9, Wheels(9, 5.0, 5.0), None)[1:] == pytest.approx(
        (0.5297, 0.7), abs=1e-4
    )


def test_a_measured_slope_overrides_the_rated_speed():
    controller = block(side(speed=0.06), side(static=0.2, rated=8.0, speed=0.09))
    # 0.1 + 5 x 0.06 and 0.2 + 5 x 0.09
    assert controller.react(9, Wheels(9, 5.0, -5.0), None)[1:] == pytest.approx((0.4, -0.65))


def test_each_side_counts_the_slots_of_its_own_disc():
    controller = block(side(slots=20), side(slots=40))
    target = 10 * (2 * pi / 20) / 0.6  # ten of 20 slots in each window of 0.6 s, 24 steps
    for i in range(100):
        now = i * STEP
        encoders = Encoders(now, 10 * i // 24, 20 * i // 24)
        out = controller.react(now, Wheels(now, target, target), encoders)
    assert controller.integrals == pytest.approx([0.0, 0.0], abs=1e-9)
    assert out.left == out.right


def steady(counts, instants, target):
    """Drive at `target` (rad/s) with `counts(i)` at instant i; returns the Duty of each instant."""
    controller = block()
    return [
        controller.react(
            i * STEP, Wheels(i * STEP, target, target), Encoders(i * STEP, counts(i), counts(i))
        )
        for i in range(instants)
    ]


def test_the_duty_of_a_wheel_without_edges_rises_once_one_is_overdue():
    out = steady(lambda i: 0, 200, 5.0)
    # The first pitch of 20 slots takes 63 ms at 5 rad/s; a command and its edge take 0.4 s more.
    assert [d.left for d in out[:16]] == pytest.approx([0.55] * 16)
    assert out[24].left > 0.56
    assert out[60].left < 0.55 + KICK_MAX + INTEGRAL_MAX
    assert out[-1].left == 1.0
    assert out[-1].right == out[-1].left


def test_an_edge_ends_the_rise_and_half_of_it_stays():
    out = steady(lambda i: int(i >= 40), 42, 5.0)
    rise = out[39].left - 0.55
    assert rise > 0.1
    assert 0.55 < out[41].left < 0.55 + 0.6 * rise


def test_a_reversal_ends_the_rise():
    controller = block()
    standing = Encoders(0, 0, 0)
    for i in range(60):
        out = controller.react(i * STEP, Wheels(i * STEP, 5.0, 5.0), standing)
    assert out.left > 0.6
    integral = controller.integrals[0]
    out = controller.react(60 * STEP, Wheels(60 * STEP, -5.0, 5.0), standing)
    assert out.left == pytest.approx(-0.55 - integral)
    assert out.right > 0.6


def test_a_wheel_at_its_target_keeps_its_duty():
    target = 10 * (2 * pi / 20) / 0.6  # ten counts in each window of 0.6 s, 24 steps
    out = steady(lambda i: 10 * i // 24, 100, target)
    assert out[-1].left == pytest.approx(out[0].left, abs=1e-9)


def test_a_wheel_that_is_too_fast_gets_less_duty():
    out = steady(lambda i: 2 * i, 60, 5.0)  # 2 counts in 25 ms are 25 rad/s
    assert out[-1].left < out[0].left


def test_the_integral_is_limited():
    out = steady(lambda i: i // 24, 1000, 5.0)  # turns much too slowly
    assert out[-1].left == pytest.approx(0.55 + INTEGRAL_MAX)


def test_a_change_of_speed_starts_a_new_window():
    controller = block()
    for i in range(40):
        target = 5.0 if i < 20 else 8.0
        controller.react(i * STEP, Wheels(i * STEP, target, target), Encoders(i * STEP, 0, 0))
    assert controller.integrals == [0.0, 0.0]  # neither speed was held for 0.6 s


def test_no_command_no_duty():
    assert block().react(9, None, Encoders(9, 1, 1)) == Duty(9, 0.0, 0.0)


def test_without_counts_only_feed_forward():
    assert block().react(9, Wheels(9, 5.0, -5.0), None)[1:] == pytest.approx((0.55, -0.55))
