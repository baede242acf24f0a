"""The infrared sensor: the data sheet's curve, its fold-back, its sampling."""

from math import inf
from random import Random
from statistics import fmean, pstdev

import pytest
from hypothesis import given
from hypothesis import strategies as st

from diffbotctl.plant.range_sensors import (
    MEASURING_PERIOD,
    RESIDUAL_VOLTS,
    SETTLING_TIME,
    Sharp,
    volts,
)


@pytest.mark.parametrize(
    "centimetres, reads",
    [
        (0.0, 0.03),
        (2.0, 2.22),
        (3.0, 3.03),  # the peak
        (4.0, 2.72),
        (4.5, 2.53),  # half-way between 2.72 and 2.34
        (10.0, 1.265),
        (30.0, 0.430),
        # Fold-back: what is too close reads like something far.
        (5.0 + 0.12 / 0.32, 2.22),  # 2 cm: 0.12 V of the 0.32 V between 5 and 6 cm
        (6.0 + 0.17 / 0.255, 1.85),  # 1 cm
        (9.0 + 0.015 / 0.130, 1.38),  # 0.5 cm
        (1.0, 1.85),
        (0.5, 1.38),
        (inf, RESIDUAL_VOLTS),
        (-1.0, 0.03),  # behind the lens is contact
    ],
)
def test_the_curve(centimetres, reads):
    assert volts(centimetres / 100) == pytest.approx(reads, abs=1e-9)


def test_the_tail_joins_the_curve():
    assert volts(0.4) == pytest.approx(0.312, abs=0.005)
    assert volts(5.0) == RESIDUAL_VOLTS


@given(st.floats(0.03, 3.0), st.floats(0.03, 3.0))
def test_beyond_the_peak_farther_never_reads_much_more(a, b):
    near, far = sorted((a, b))
    # Where the tail takes over at 40 cm it may step by the fit's error.
    assert volts(far) <= volts(near) + 0.005


@given(st.floats(0.0, 0.03), st.floats(0.0, 0.03))
def test_before_the_peak_nearer_reads_less(a, b):
    near, far = sorted((a, b))
    assert volts(near) <= volts(far)


def test_the_output_is_constant_between_measurements():
    sensor = Sharp(0.0, 0.0, Random(3))
    first = sensor.due
    assert 0 <= first < MEASURING_PERIOD == 16_500_000
    assert sensor.output(0) == RESIDUAL_VOLTS
    sensor.measure(0.10)
    # The old voltage stands until the measurement has settled, 5 ms after it.
    assert sensor.output(first) == RESIDUAL_VOLTS
    assert sensor.output(first + SETTLING_TIME - 1) == RESIDUAL_VOLTS
    assert sensor.output(first + SETTLING_TIME) == 1.265
    assert sensor.due == first + MEASURING_PERIOD
    assert sensor.output(sensor.due - 1) == 1.265
    sensor.measure(0.20)
    assert sensor.output(first + MEASURING_PERIOD + SETTLING_TIME - 1) == 1.265
    assert sensor.output(first + MEASURING_PERIOD + SETTLING_TIME) == 0.656


def test_noise_and_offset():
    sensor = Sharp(0.010, 0.050, Random(5))
    now = sensor.due + SETTLING_TIME
    sensor.measure(0.10)
    read = [sensor.output(now) for _ in range(4000)]
    # A mean of 4000 scatters by 10 mV / sqrt(4000) = 0.16 mV, their spread by 1.1 %.
    assert fmean(read) == pytest.approx(1.315, abs=0.0007)
    assert pstdev(read) == pytest.approx(0.010, rel=0.05)


def test_a_pin_never_goes_below_ground():
    sensor = Sharp(0.2, 0.0, Random(5))
    assert min(sensor.output(0) for _ in range(200)) == 0.0
