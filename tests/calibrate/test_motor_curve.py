"""Motor curves under a sagging battery, and of drivers that open between two pulses."""

from random import Random

import pytest

from diffbotctl.calibrate.motor_curve import USUAL_STALL_DROP, FittedMotor, fit_curves
from diffbotctl.calibrate.motor_fit import fit_line
from tests.sampling import by_day

DUTIES = (0.3, 0.45, 0.6, 0.75, 0.9)
ERRORS = (0.15, -0.15, 0.15, -0.15, 0.15)  # relative; too large to tell one law from another


def points(gain, static, sag, noise=0.0, seed=0):
    rng = Random(seed)
    return [
        (duty, gain * (duty * (1 - sag * duty) - static) * (1 + rng.gauss(0.0, noise)))
        for duty in DUTIES * 2
    ]


def test_exact_points_give_the_curve():
    # gain 10 rad/s, static 0.1: 9 rad/s at full duty without a drop of the voltage.
    curves = fit_curves({"left": points(10.0, 0.10, 0.04), "right": points(12.0, 0.08, 0.04)})
    assert curves["left"].static == pytest.approx(0.10, abs=1e-6)
    assert curves["left"].rated == pytest.approx(9.0, abs=1e-5)
    assert curves["right"].rated == pytest.approx(12.0 * 0.92, abs=1e-5)


def test_a_line_is_wrong_by_what_the_sag_does():
    line = fit_line(points(10.0, 0.10, 0.04))
    assert line.static < 0.093 and line.rated < 8.7


@pytest.mark.nightly
@pytest.mark.parametrize("sag", by_day(1, [0.0, 0.04, 0.12]))
def test_two_standard_deviations_contain_the_truth(sag):
    inside = []
    for seed in range(40):
        rng = Random(seed)
        static = rng.uniform(0.06, 0.14)
        curves = fit_curves(
            {
                "left": points(11.0, static, sag, 0.001, seed),
                "right": points(10.0, 0.1, sag, 0.001, seed + 99),
            }
        )
        left = curves["left"]
        inside.append(abs(left.static - static) <= 2 * left.static_sd)
        inside.append(abs(left.rated - 11.0 * (1 - static)) <= 2 * left.rated_sd)
    assert sum(inside) >= 0.9 * len(inside)


def fast_points(gain, static, viscous, drop=USUAL_STALL_DROP, noise=0.0, seed=0):
    """Two such motors on a battery that loses `drop` of its voltage when both are stalled."""
    rng = Random(seed)
    rows = []
    for duty in DUTIES * 2:
        share = 0.5  # speed over the no-load speed
        for _ in range(20):
            supply = 1 - drop * (static + viscous * share)  # the current balances friction
            share = (duty * supply - static) / (duty + viscous)
        rows.append((duty, gain * share * (1 + rng.gauss(0.0, noise))))
    return rows


@pytest.mark.parametrize("viscous", [0.0, 0.05, 0.1])
def test_exact_points_of_a_fast_decay_give_friction_and_speed(viscous):
    # gain 12 rad/s, static 0.1: 10.8 rad/s over 1 + viscous at full duty.
    rows = fast_points(12.0, 0.1, viscous)
    for curve in fit_curves({"left": rows, "right": rows}).values():
        assert curve.decay == "fast"
        # The battery drops by a little less at low speeds, which the law does not contain.
        assert curve.static == pytest.approx(0.1, abs=1e-3)
        assert curve.rated == pytest.approx(10.8 / (1.0 + viscous), rel=2e-3)
        assert curve.loaded < curve.rated
        assert curve.law().duty(0.0) == pytest.approx(curve.static, abs=1e-6)
        assert curve.law().duty(curve.rated) == pytest.approx(1.0, abs=1e-5)


@pytest.mark.nightly
def test_two_standard_deviations_contain_the_truth_of_a_fast_decay():
    """Of motors with different friction, on batteries that sag by an unknown amount."""
    inside = []
    for seed in range(40):
        rng = Random(seed)
        drop = rng.uniform(0.0, 0.2)
        statics = [rng.uniform(0.04, 0.14) for _ in range(2)]
        viscous = [rng.uniform(0.02, 0.1) for _ in range(2)]
        curves = fit_curves(
            {
                side: fast_points(12.0, statics[side], viscous[side], drop, 0.001, seed + 99 * side)
                for side in range(2)
            }
        )
        for side, curve in curves.items():
            rated = 12.0 * (1 - statics[side]) / (1 + viscous[side])
            inside.append(abs(curve.static - statics[side]) <= 2 * curve.static_sd)
            inside.append(abs(curve.rated - rated) <= 2 * curve.rated_sd)
    assert sum(inside) >= 0.9 * len(inside)


def inductive_points(speeds):
    return list(zip(DUTIES, speeds, strict=True))


def test_a_fast_decay_beyond_the_limit_of_its_law_is_no_line():
    """Speeds (rad/s) of a simulated L298N with 490 Hz and windings of 0.3 ms: breakaway at 0.13 and
    0.14. A line through them would state no friction at all."""
    left = inductive_points((6.27, 7.80, 8.57, 8.97, 9.23))
    right = inductive_points((6.62, 8.16, 8.83, 9.22, 9.44))
    assert fit_line(left).static < 0.0
    curves = fit_curves({"left": left, "right": right})
    assert [curve.decay for curve in curves.values()] == ["fast", "fast"]
    for curve in curves.values():
        assert 0.10 < curve.static < 0.16


def test_the_lag_of_a_fast_decay_is_stated_for_one_duty():
    curve = FittedMotor(0.1, 10.0, 0.0, 0.0, "fast", 0.1)
    assert curve.law().slowness(0.5) == pytest.approx(1.0)
    assert curve.law().slowness(0.3) == pytest.approx(1.5)
    assert curve._replace(decay="slow").law().slowness(0.3) == 1.0


def test_a_slow_decay_is_recognised():
    curves = fit_curves({"left": points(10.0, 0.1, 0.04, 0.003), "right": points(9.0, 0.1, 0.04)})
    assert [curve.decay for curve in curves.values()] == ["slow", "slow"]


def test_speeds_that_both_laws_explain_leave_the_decay_open():
    # Without friction both are proportional to the duty at a large viscous friction.
    rows = [(duty, 10.0 * duty * (1 + error)) for duty, error in zip(DUTIES, ERRORS, strict=True)]
    assert all(curve.decay is None for curve in fit_curves({"left": rows, "right": rows}).values())


def test_motors_of_another_law_are_left_to_the_line():
    # A speed that grows with the square of the duty bends the other way.
    other = [(duty, 12.0 * duty * duty) for duty in DUTIES * 2]
    assert fit_curves({"left": other, "right": other}) == {}


def test_a_bend_that_no_battery_makes_is_an_uncertain_line():
    """Shares of the no-load speed of a motor at the duties of the steps, which an L298N shorts
    between two pulses: its bridge takes 1.4 V of its own, and at full duty the share is 0.857."""
    rows = list(zip((0.302, 0.451, 0.6, 0.749, 0.902), (2.4, 3.78, 5.16, 6.47, 7.57), strict=True))
    assert fit_curves({"left": rows, "right": rows}) == {}
    for curve in fit_curves({"left": rows, "right": rows}, is_shorted=True).values():
        assert curve.decay == "slow"
        assert abs(curve.rated - 8.57) < curve.rated_sd < 0.1 * curve.rated
