"""Figures of the distance sensors: curves, timing, echoes."""

import pytest

from diffbotctl.geometry.distance_sensors import (
    ECHOES,
    SHARPS,
    echo_distance,
    further_sensors,
    paper_volts,
    sensor_facts,
    sensor_timing,
    volts_at,
)

A41, A21, A02 = SHARPS
HC = ECHOES["hc_sr04"]


@pytest.mark.parametrize("kind", SHARPS)
def test_the_formula_follows_the_points_within_4_percent(kind):
    facts = SHARPS[kind]
    a, b, c = facts.curve
    for distance, volts in facts.points:
        if facts.near <= distance <= facts.reach:
            assert a / (volts - c) - b == pytest.approx(distance, rel=0.04)


@pytest.mark.parametrize("kind", SHARPS)
def test_the_fold(kind):
    """The voltage falls from `near` on, and exceeds the peak's ratio over the stated width only."""
    facts = SHARPS[kind]
    beyond = [volts for distance, volts in facts.points if distance >= facts.near]
    assert beyond == sorted(beyond, reverse=True)
    near_volts = volts_at(facts.near, *facts.curve)
    steps = [index / 10_000 for index in range(round(facts.near * 10_000))]
    peak = [at for at in steps if paper_volts(facts, at) >= facts.fold.peak_ratio * near_volts]
    assert peak[-1] - peak[0] == pytest.approx(facts.fold.peak_width, rel=0.25)


@pytest.mark.parametrize(
    ("seconds", "distance", "state"),
    [
        (0.0001, 0.0, "too_close"),  # 1.7 cm
        (0.001, 0.1716, "measured"),
        (0.02, 3.432, "measured"),
        (0.024, 4.0, "clear"),
    ],
)
def test_an_echo(seconds, distance, state):
    assert echo_distance(seconds, HC) == (pytest.approx(distance), state)


@pytest.mark.parametrize(
    ("kinds", "further"),
    [
        ([A41], []),
        (["hc_sr04"], ["0"]),
        ([A41, A21, A02], ["1", "2"]),
        (["hc_sr04", A21, "hc_sr04", A41], ["0", "2", "3"]),
        (["lds01", A41], []),
    ],
)
def test_all_but_the_first_analog_sensor_are_measured_in_turn(kinds, further):
    assert further_sensors({str(index): kind for index, kind in enumerate(kinds)}) == further


@pytest.mark.parametrize(
    ("kinds", "name", "period", "measuring"),
    [
        ({"a": A41}, "a", 0.025, 0.0252),
        ({"a": A02}, "a", 0.025, 0.0529),
        ({"a": "hc_sr04"}, "a", 0.051, 0.0233),
        ({"a": "hc_sr04", "b": "hc_sr04", "c": A41}, "b", 0.102, 0.0233),
        ({"a": "hc_sr04", "b": "hc_sr04", "c": A41}, "c", 0.025, 0.0252),
    ],
)
def test_timing(kinds, name, period, measuring):
    timing = sensor_timing(kinds, name, 40.0)
    assert timing == (pytest.approx(period), pytest.approx(measuring, abs=1e-4))


def test_a_custom_sensor_keeps_the_proportions_of_the_fold():
    facts = sensor_facts("sharp_custom", 0.084, 0.6)
    assert (facts.near, facts.reach) == (0.084, 0.6)
    assert facts.fold.peak_width == pytest.approx(0.018)
