"""A sensor's curve through ruler points: near the data sheet's typical part, offset, with noise."""

from dataclasses import replace
from random import Random
from statistics import fmean, pstdev

import pytest
from hypothesis import given, settings
from hypothesis import strategies as some

from diffbotctl.blocks.range_sensor import distance_at, volts_at
from diffbotctl.calibrate.range_fit import (
    RULER_DISTANCES_M,
    RulerPoint,
    error_limit,
    find_misread,
    fit_curve,
)

# The data sheet's typical part on white paper, read from its figure: cm, V.
DATA_SHEET = (
    (4, 2.72),
    (5, 2.34),
    (6, 2.02),
    (7, 1.765),
    (8, 1.56),
    (9, 1.395),
    (10, 1.265),
    (12, 1.06),
    (14, 0.928),
    (16, 0.813),
    (18, 0.735),
    (20, 0.656),
    (25, 0.525),
    (30, 0.430),
)
KNOWN = {cm / 100: volts for cm, volts in DATA_SHEET}


def exact(offset=0.0, distances=RULER_DISTANCES_M):
    return [RulerPoint(each, KNOWN[each] + offset, 0.0, 1) for each in distances]


def noisy(chance, offset, readings):
    """Each point as the step averages it."""
    points = []
    for each in RULER_DISTANCES_M:
        received = [KNOWN[each] + offset + chance.gauss(0.0, 0.010) for _ in range(readings)]
        points.append(RulerPoint(each, fmean(received), pstdev(received), readings))
    return points


def worst(fit, offset):
    """The largest error on all of the data sheet's points, against what is allowed there."""
    return max(
        abs(distance_at(volts + offset, fit.a, fit.b, fit.c) - distance) / error_limit(distance)
        for distance, volts in KNOWN.items()
    )


@pytest.mark.parametrize("offset", [-0.15, 0.0, 0.15])
def test_exact_points_tell_all_others_to_3_mm_or_2_percent(offset):
    assert worst(fit_curve(exact(offset)), offset) <= 1.0


def test_an_offset_is_all_in_c():
    # volts = a / (d + b) + c: what is added to all volts is added to c alone
    plain, shifted = fit_curve(exact()), fit_curve(exact(0.15))
    assert shifted.a == pytest.approx(plain.a, rel=1e-6)
    assert shifted.b == pytest.approx(plain.b, rel=1e-6)
    assert shifted.c - plain.c == pytest.approx(0.15, abs=1e-6)


@given(some.floats(0.10, 0.22), some.floats(0.002, 0.030), some.floats(-0.15, 0.15))
@settings(max_examples=50, deadline=None)
def test_points_of_a_curve_give_that_curve_back(a, b, c):
    points = [RulerPoint(each, volts_at(each, a, b, c), 0.0, 1) for each in RULER_DISTANCES_M]
    fit = fit_curve(points)
    assert (fit.a, fit.b, fit.c) == pytest.approx((a, b, c), rel=1e-3, abs=1e-4)
    assert not fit.bad_points()


@pytest.mark.parametrize("seed", range(20))
def test_10_mv_of_noise_averaged_over_2_seconds_of_telemetry(seed):
    chance = Random(seed)
    offset = chance.uniform(-0.15, 0.15)
    fit = fit_curve(noisy(chance, offset, 80))
    assert worst(fit, offset) <= 1.0
    assert fit.noise == pytest.approx(0.010, rel=0.2)


def test_deviations_are_those_of_many_fits():
    # RULER's 0.5 mm is not in these readings, so what is stated may be larger, never smaller
    fits = [fit_curve(noisy(Random(seed), 0.0, 20)) for seed in range(100)]
    for number, name in enumerate("abc"):
        scatter = pstdev(getattr(each, name) for each in fits)
        stated = fmean(each.sd[number] for each in fits)
        assert scatter <= stated <= 6.0 * scatter


@pytest.mark.parametrize(
    "points, word",
    [
        (exact(distances=(0.04, 0.07, 0.10)), "4 different"),
        # 2 cm instead of 4: 2.22 V there is less than 2.72 V, but still more than at 7 cm; 1 cm
        # instead of 4 is 1.85 V, more than 1.765 V; contact is 0.03 V
        ([RulerPoint(0.04, 0.03, 0.0, 1), *exact()[1:]], "falls again"),
        # 16 and 25 cm exchanged
        ([*exact()[:3], RulerPoint(0.16, 0.525, 0, 1), RulerPoint(0.25, 0.813, 0, 1)], "must fall"),
        ([RulerPoint(each, 1.0, 0.0, 1) for each in RULER_DISTANCES_M], "do not fall"),
    ],
)
def test_points_of_no_such_sensor_are_refused(points, word):
    with pytest.raises(ValueError, match=word):
        fit_curve(points)


def test_a_point_in_the_folded_range_is_off_the_curve():
    # 2 cm read as 4 cm: 2.22 V where the other points ask for 2.72 V
    fit = fit_curve([RulerPoint(0.04, 2.22, 0.0, 1), *exact()[1:]])
    assert fit.bad_points()


@pytest.mark.parametrize("number", range(6))
@pytest.mark.parametrize("ratio", [0.8, 1.2])
def test_the_misread_point_of_six_is_found(number, ratio):
    points = exact()
    points[number] = replace(points[number], distance=ratio * points[number].distance)
    point, fit = find_misread(points)
    assert point is points[number]
    assert fit.distance(point) == pytest.approx(RULER_DISTANCES_M[number], rel=0.1)


def test_two_misread_points_blame_no_third():
    points = exact()
    for number in (1, 4):
        points[number] = replace(points[number], distance=1.2 * points[number].distance)
    found = find_misread(points)
    assert found is None or found[0] in (points[1], points[4])


def test_points_that_fit_blame_none():
    assert find_misread(exact()) is None
