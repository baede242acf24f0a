"""Duty on the host: feed-forward by hand, and the slow integral on counts."""

from math import pi

import pytest

from diffbotctl.blocks.wheel_speed import MOST_INTEGRAL, WheelSpeed, duty
from diffbotctl.messages import Duty, Encoders, Wheels

STEP = 25_000_000  # ns between two instants
STATIC, RATED = 0.1, 10.0


@pytest.mark.parametrize(
    "target, extra, wanted",
    [
        (0.0, 0.2, 0.0),  # at rest no learnt duty may creep in
        (5.0, 0.0, 0.55),  # 0.1 against friction, half of the remaining 0.9
        (-5.0, 0.0, -0.55),
        (10.0, 0.0, 1.0),
        (10.0, 0.1, 1.0),  # never more than all
        (5.0, 0.1, 0.65),
        (-5.0, 0.1, -0.65),
        (1.0, -0.5, 0.0),  # 0.19 less 0.5: the sign is the target's, or zero
    ],
)
def test_feed_forward(target, extra, wanted):
    assert duty(target, extra, STATIC, RATED) == pytest.approx(wanted)


def block():
    return WheelSpeed(static=STATIC, rated=RATED, slots=20)


def steady(counts, instants, target):
    """Drive at `target` rad/s while `counts(i)` come; returns each instant's Duty."""
    made = block()
    return [
        made.react(
            i * STEP, Wheels(i * STEP, target, target), Encoders(i * STEP, counts(i), counts(i))
        )
        for i in range(instants)
    ]


def test_a_wheel_that_stands_gets_more_once_the_window_is_full():
    out = steady(lambda i: 0, 27, 5.0)
    # 0.6 s are 24 steps. From then each step adds 0.01 duty/rad x 5 rad/s x 0.025 s = 0.00125.
    assert [d.left for d in out[22:]] == pytest.approx([0.55, 0.55, 0.55125, 0.5525, 0.55375])
    assert out[-1].right == out[-1].left


def test_a_wheel_at_its_speed_is_left_alone():
    target = 10 * (2 * pi / 20) / 0.6  # ten counts in each window of 0.6 s, 24 steps
    out = steady(lambda i: 10 * i // 24, 100, target)
    assert out[-1].left == pytest.approx(out[0].left, abs=1e-9)


def test_a_wheel_too_fast_gets_less():
    out = steady(lambda i: 2 * i, 60, 5.0)  # 2 counts in 25 ms are 25 rad/s
    assert out[-1].left < out[0].left


def test_what_is_learnt_is_bounded():
    out = steady(lambda i: 0, 1000, 5.0)
    assert out[-1].left == pytest.approx(0.55 + MOST_INTEGRAL)


def test_a_change_of_speed_starts_a_new_window():
    made = block()
    for i in range(40):
        target = 5.0 if i < 20 else 8.0
        made.react(i * STEP, Wheels(i * STEP, target, target), Encoders(i * STEP, 0, 0))
    assert made.sums == [0.0, 0.0]  # neither speed was held for 0.6 s


def test_without_a_command_the_motors_get_nothing():
    assert block().react(9, None, Encoders(9, 1, 1)) == Duty(9, 0.0, 0.0)


def test_without_counts_it_drives_by_feed_forward():
    assert block().react(9, Wheels(9, 5.0, -5.0), None)[1:] == pytest.approx((0.55, -0.55))
