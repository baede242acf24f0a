"""The board's wheel-speed loop: feed-forward, PI, reversals and stalls, computed by hand."""

from math import pi

import pytest

from diffbotctl.control.speed_loop import (
    FULL_WEIGHT_INTERVAL_S,
    HOLD_PERIODS,
    KICK_SHARE,
    LOOP_PERIOD,
    REFERENCE_GAIN,
    SLEW_MAX,
    SpeedGains,
    WheelSpeedLoop,
    default_gains,
)
from diffbotctl.time import MILLISECOND as MS

# 5 rad/s: 0.1 against friction and 5 x 0.08: duty 0.5.
FORWARD = SpeedGains(0.1, 0.08, 0.0, 0.0)
PI_GAINS = SpeedGains(0.1, 0.08, 0.02, 0.5)
SLOTS = 20
PITCH = 2 * pi / SLOTS


def loop(gains=FORWARD, slots=SLOTS, lag=None):
    return WheelSpeedLoop(gains, slots, lag)


def turn(wheel, speed, seconds, start=0):
    """Tick while the wheel turns at `speed` (rad/s), from an edge on. Integral after each tick."""
    angle, end, integrals = 0.0, start + round(seconds * 1e9), []
    while start < end:
        angle += speed * 0.010
        start += LOOP_PERIOD
        while angle >= wheel.pitch:
            angle -= wheel.pitch
            wheel.edge(start - round(angle / speed * 1e9))
        wheel.tick(start)
        integrals.append(wheel.integral)
    return integrals


@pytest.mark.parametrize(
    "target, duty", [(0.0, 0.0), (5.0, 0.5), (-5.0, -0.5), (50.0, 1.0), (-50.0, -1.0)]
)
def test_feed_forward_is_applied_immediately(target, duty):
    wheel = loop()
    wheel.command(0, target)
    assert wheel.duty == pytest.approx(duty)


def test_default_gains_follow_from_the_slope():
    assert default_gains(0.08) == pytest.approx((0.08, 0.8))
    assert default_gains(2.0) == (0.75, 4.5)  # what a board takes at most


def loop_after_two_edges(target: float) -> tuple[WheelSpeedLoop, float]:
    """A loop with edges after 5 and 53 ms; the angle of its reference model in that time."""
    wheel = loop(PI_GAINS)
    wheel.command(0, target)
    wheel.edge(5 * MS)
    wheel.tick(10 * MS)
    reference = target * REFERENCE_GAIN
    assert wheel.error == 0.0  # one edge gives no speed
    angle = reference * 0.005  # since that edge
    for k in range(2, 6):
        wheel.tick(k * 10 * MS)
        reference += (target - reference) * REFERENCE_GAIN
        angle += reference * 0.010
    wheel.edge(53 * MS)
    reference += (target - reference) * REFERENCE_GAIN
    wheel.tick(60 * MS)
    return wheel, angle + reference * 0.003


WEIGHT = FULL_WEIGHT_INTERVAL_S / 0.048  # of a measurement over 48 ms


def test_the_error_is_the_angle_that_the_reference_model_is_ahead_over_the_time():
    wheel, angle = loop_after_two_edges(30.0)
    assert angle > PITCH
    assert wheel.error == pytest.approx((angle - PITCH) / 0.048 * WEIGHT)
    assert wheel.duty == 1.0


@pytest.mark.parametrize(("target", "error"), [(8.0, 0.0), (6.0, (6.0 - PITCH / 0.048) * WEIGHT)])
def test_a_wheel_between_reference_model_and_target_has_no_error(target, error):
    wheel, angle = loop_after_two_edges(target)
    assert angle < PITCH  # a motor that is quicker than the model
    assert wheel.error == pytest.approx(error)


def test_the_integral_of_the_error():
    wheel, _ = loop_after_two_edges(5.0)
    integral = 0.5 * wheel.error * 0.010
    assert wheel.integral == pytest.approx(integral)
    assert wheel.duty == pytest.approx(0.5 + 0.02 * wheel.error + integral)


def test_a_measurement_is_integrated_for_a_few_periods_only():
    wheel = loop(PI_GAINS)
    wheel.command(0, 1.0)
    turn(wheel, 1.0, 2.0)
    end = 2000 * MS
    wheel.edge(end + 1)  # early: the wheel is faster than the reference model
    wheel.tick(end + LOOP_PERIOD)
    changes = []
    for k in range(2, 12):
        before = wheel.integral
        wheel.tick(end + k * LOOP_PERIOD)
        changes.append(wheel.integral != before)
    assert changes == [True] * (HOLD_PERIODS - 1) + [False] * (11 - HOLD_PERIODS)


@pytest.mark.parametrize("sign", [1, -1])
@pytest.mark.parametrize("slots", [8, 20, 4096])
def test_a_wheel_that_follows_its_target_has_no_error(slots, sign):
    wheel = loop(PI_GAINS, slots)
    wheel.command(0, sign * 5.0)
    integrals = turn(wheel, 5.0, 6.0)
    assert integrals[300:] == pytest.approx([integrals[300]] * 300, abs=1e-3)
    assert wheel.error == pytest.approx(0.0, abs=0.05)


@pytest.mark.parametrize(("speed", "duty"), [(3.0, 1.0), (8.0, 0.0)])
def test_the_integral_is_bounded_by_the_duty(speed, duty):
    wheel = loop(SpeedGains(0.1, 0.08, 0.0, 4.0))
    wheel.command(0, 5.0)
    integrals = turn(wheel, speed, 8.0)
    assert wheel.duty == pytest.approx(duty)
    assert max(map(abs, integrals)) <= 1.0
    assert max(map(abs, integrals[400:])) < 0.8  # 0.5 from the limit of the duty, and one kick


def test_a_wheel_that_does_not_start_gets_the_full_duty_within_its_time():
    wheel = loop(SpeedGains(0.1, 0.08, *default_gains(0.08)))
    wheel.command(0, 0.5)
    duties = [wheel.tick(k * LOOP_PERIOD) for k in range(1, 145)]
    assert duties[62] < 0.2  # it may be up to a pitch away from the first edge
    assert duties[-1] == 1.0
    assert not wheel.fault


def test_a_wheel_that_broke_loose_keeps_half_of_the_integral():
    wheel = loop(FORWARD)
    wheel.command(0, 5.0)
    for k in range(1, 60):
        wheel.tick(k * LOOP_PERIOD)
    integral = wheel.integral
    assert integral > 0.3
    wheel.edge(591 * MS)
    wheel.tick(600 * MS)
    assert wheel.integral == pytest.approx(KICK_SHARE * integral)


def test_a_reversal_is_slewed():
    wheel = loop()
    wheel.command(0, 5.0)
    wheel.command(LOOP_PERIOD, -5.0)
    duties = [wheel.tick(k * LOOP_PERIOD) for k in range(1, 15)]
    assert duties == pytest.approx([0.5 - SLEW_MAX * k for k in range(1, 15)])
    assert wheel.direction == -1


@pytest.mark.parametrize(
    ("slots", "target", "lag", "seconds"),
    [
        (20, 3.0, 0.05, 0.95),  # 2.2 pitches take 0.23 s
        (20, 5.0, 0.02, 0.63),  # as long as 10 pitches
        (20, 8.0, 0.01, 0.61),  # 0.6 and the lag
        (20, 8.0, 0.2, 0.80),
        (20, 8.0, None, 0.90),
        (20, 8.0, 2.0, 0.90),
        (20, 0.5, None, 1.64),  # 2.2 x 0.314 / 0.5 = 1.38, and 0.25
        (20, 0.5, 0.2, 1.84),  # and the lag
        (8, -0.5, 0.4, 4.01),  # 2.2 x 0.785 / 0.5 = 3.46, and 0.25, and 0.3
        (4096, 0.5, 0.1, 0.70),
    ],
)
def test_a_wheel_without_edges_is_a_stall(slots, target, lag, seconds):
    wheel = loop(slots=slots, lag=lag)
    wheel.command(0, target)
    ticks = 0
    while not wheel.fault:
        ticks += 1
        wheel.tick(ticks * LOOP_PERIOD)
    assert ticks * 0.010 == pytest.approx(seconds, abs=0.011)
    assert wheel.duty == 0.0
    wheel.command(ticks * LOOP_PERIOD, 6.0)
    assert wheel.duty == 0.0  # it stays off until the fault is cleared
    wheel.clear_fault()
    wheel.command(ticks * LOOP_PERIOD, 6.0)
    assert wheel.duty == pytest.approx(0.58)


@pytest.mark.parametrize(
    ("edges", "seconds"),
    [
        (1, 0.95),  # it may have rested just before a slot
        (2, 0.65),
        (30, 0.65),
    ],
)
def test_a_wheel_that_was_turning_stalls_sooner(edges, seconds):
    wheel = loop(lag=0.05)
    wheel.command(0, 3.0)
    ticks = 0
    for _ in range(edges):  # a pitch takes 105 ms
        for _ in range(10):
            ticks += 1
            wheel.tick(ticks * LOOP_PERIOD)
        wheel.edge(ticks * LOOP_PERIOD)
    last = ticks
    while not wheel.fault:
        ticks += 1
        wheel.tick(ticks * LOOP_PERIOD)
    assert (ticks - last) * 0.010 == pytest.approx(seconds, abs=0.011)


def test_an_edge_in_time_is_no_stall():
    wheel = loop()
    wheel.command(0, 1.0)
    for k in range(1, 400):
        if k % 90 == 0:
            wheel.edge(k * LOOP_PERIOD)
        wheel.tick(k * LOOP_PERIOD)
    assert not wheel.fault


@pytest.mark.parametrize(("duty", "is_stall"), [(0.25, False), (0.5, True), (-1.0, True)])
def test_a_stall_at_raw_duty(duty, is_stall):
    wheel = loop()
    wheel.set_duty(duty)
    for _ in range(150):
        wheel.tick_duty()
    assert wheel.fault is is_stall
    assert wheel.duty == (0.0 if is_stall else duty)


@pytest.mark.parametrize(("slots", "share"), [(4096, 1.0), (20, 0.5)])
def test_an_edge_of_a_fine_encoder_does_not_end_the_rise_of_the_duty(slots, share):
    wheel = loop(SpeedGains(0.1, 0.08, 0.0, 0.0), slots)
    wheel.command(0, 5.0)
    for k in range(1, 40):
        if k == 3:
            wheel.edge(3 * LOOP_PERIOD - MS)
        wheel.tick(k * LOOP_PERIOD)
    risen = wheel.integral
    assert risen > 0.1
    wheel.edge(40 * LOOP_PERIOD - MS)  # far later than at the target: it sticks
    wheel.tick(40 * LOOP_PERIOD)
    assert wheel.integral == pytest.approx(share * risen, rel=0.05)
