"""Slots from turns by hand, means of repeats, a motor's line and lag, squares: ends are known."""

from math import exp, pi
from random import Random

import pytest

from diffbotctl.calibrate import encoder_fit, motor_fit
from diffbotctl.calibrate.confidence import robust_mean
from diffbotctl.calibrate.motor_lag import SAME_LAG, fit_lags
from diffbotctl.config.load import load_robot
from diffbotctl.config.robot import SIDES
from diffbotctl.messages import Encoders
from diffbotctl.time import SECOND

ROBOT = load_robot("book_2wd").robot  # 20 slots


@pytest.mark.parametrize(
    "rolls, findings, fault",
    [
        ({"left": [200, 201, 200], "right": [199, 200, 200]}, {"left": 20, "right": 20}, ""),
        # 24 slots on both; the third roll of the left wheel was one turn too many
        ({"left": [240, 241, 264], "right": [240, 240, 239]}, {"left": 24, "right": 24}, ""),
        # the right encoder is dead, and its disc is taken to be like the other
        ({"left": [240, 240, 240]}, {"left": 24, "right": 24}, ""),
        ({"left": [240, 240, 240], "right": [200, 200, 200]}, {}, "24 and 20 slots"),
        ({"left": [205, 206, 205]}, {}, "not a whole number"),  # 20.5 a turn
        ({"left": [160, 200, 240]}, {}, "not a whole number"),  # no two agree
        ({"left": [0, 0, 0]}, {}, "not a whole number"),
        ({}, {}, ""),
    ],
)
def test_slots_from_ten_turns_by_hand(rolls, findings, fault):
    slot_count = encoder_fit.count_slots(rolls, 10, ROBOT)
    assert {f.field: f.value for f in slot_count.findings} == {
        f"drive.{side}.encoder.slots": count for side, count in findings.items()
    }
    assert fault in " ".join(slot_count.faults) and bool(fault) == bool(slot_count.faults)


def test_a_stray_roll_is_named():
    report = encoder_fit.count_slots({"left": [240, 241, 264]}, 10, ROBOT).report
    assert "left wheel, time 3 left out: 264 counts instead of 241" in report


def test_a_mean_leaves_out_a_stray_reading():
    fit = robust_mean([0.998, 1.002, 1.000, 0.999, 1.100], sd_min=0.001)
    assert fit.outliers == (4,)
    assert fit.value == pytest.approx(0.99975)
    # four readings, sd 0.0017: 0.00085 of the mean, times t = 3.18 for three degrees of freedom
    assert fit.half_width == pytest.approx(3.18 * 0.000854, rel=0.01)


def test_repeats_that_agree_perfectly_are_not_assumed_to_be_perfect():
    fit = robust_mean([1.0] * 4, sd_min=0.002)
    assert fit.sd == pytest.approx(0.001)  # 0.002 over the root of four


def test_a_line_through_exact_points_is_found_again():
    # duty = 0.1 + 0.08 speed; the wheel that did not turn shows nothing
    fit = motor_fit.fit_line([(0.05, 0.0), (0.3, 2.5), (0.5, 5.0), (0.9, 10.0), (-0.9, -10.0)])
    assert (fit.static, fit.rated) == pytest.approx((0.1, 11.25))  # (1 - 0.1) / 0.08


@pytest.mark.parametrize(
    "duties, speeds, words",
    [
        ([0.3, 0.5, 0.9], [0.0, 0.0, 5.0], "fewer than three"),
        ([0.3, 0.5, 0.9], [9.0, 5.0, 2.0], "did not increase with the duty"),
    ],
)
def test_a_wheel_that_does_not_follow_is_refused(duties, speeds, words):
    with pytest.raises(ValueError, match=words):
        motor_fit.fit_line(list(zip(duties, speeds, strict=True)))


def steps(lag, dead, uneven=0.0, seed=1):
    """Edges of a disc with 20 slots that steps between 3 and 8 rad/s, with `lag` and `dead` s."""
    chance, pitch = Random(seed), 2 * pi / 20
    places = [chance.gauss(0.0, uneven) for _ in range(20)]
    slot_count, angle, speed, now, setpoint, count = [], 0.1, 3.0, 0.0, 3.0, 0
    frames, last, at, up = [], None, 0.0, True
    tick = 0.0005  # s; half a millisecond of a lag of 60 and more
    for number in range(9):
        end = now + 1.6
        target = 8.0 if number % 2 else 3.0
        at, up = now, target > 5.0
        frames = frames[-64:]
        while now < end:
            now += tick
            if now - at > dead:
                setpoint = target
            speed += (setpoint - speed) * (1.0 - exp(-tick / lag))
            angle += speed * tick
            while angle >= (count + 1 + places[(count + 1) % 20]) * pitch:
                count += 1
                over = angle - (count + places[count % 20]) * pitch
                last = round((now - over / speed) * SECOND)
                frames.append(Encoders(round(now * SECOND), count, count, last, last))
        if number:
            slot_count.append(motor_fit.StepResponse(list(frames), at, up))
    return slot_count


@pytest.mark.parametrize(
    "lag, dead, uneven", [(0.06, 0, 0), (0.15, 0, 0), (0.10, 0, 0.03), (0.08, 0.03, 0.01)]
)
def test_a_lag_is_found_again(lag, dead, uneven):
    slots, shares = dict.fromkeys(SIDES, 20), dict.fromkeys(SIDES, SAME_LAG)
    fit = fit_lags(steps(lag, dead, uneven), slots, shares)["left"]
    assert fit.lag + fit.dead_time == pytest.approx(lag + dead, abs=0.003)
    assert fit.lag == pytest.approx(lag, rel=0.1)
    assert fit.dead_time == pytest.approx(dead, abs=0.008)


def test_steps_without_edges_are_refused():
    empty = [motor_fit.StepResponse([Encoders(0, 0, 0, None, None)], 0.0, True)] * 2
    with pytest.raises(ValueError, match="too few edges"):
        fit_lags(empty, {"left": 20}, {"left": SAME_LAG})
