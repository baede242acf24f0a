"""Volts to metres, and what is too close: sweeps along the data sheet's own curve."""

from math import nan

import pytest

from diffbotctl.blocks.range_sensor import (
    REACH,
    RangeSensor,
    distance_at,
    volts_at,
)
from diffbotctl.config.load import load
from diffbotctl.messages import Resume, Volts
from diffbotctl.plant.sharp import volts

SENSORS = load("goal", None, []).nominal.sensors
CURVE = SENSORS["front"].curve
STEP = 25_000_000  # ns between two frames
# The curve fits the data sheet's points to 1.9 mm. Between points h apart a straight line lies
# outside the hyperbola a / (d + b) by h^2 / 4 (d + b) at most: 2.6 mm between 20 and 25 cm.
FIT = 0.0045  # m


def sensor(**changes):
    return RangeSensor(**{"sensors": SENSORS, "speed": 0.3, **changes})


def swept(block, distances, start=0):
    """The Range at each true distance (m), one frame after the other."""
    return [
        block.react(i * STEP, Volts(i * STEP, volts(d)), None)
        for i, d in enumerate(distances, start)
    ]


def millimetres(first, last, step=1):
    way = range(first, last + 1, step) if last >= first else range(first, last - 1, -step)
    return [d / 1000 for d in way]


# 1 mm a frame is 4 cm/s, 7 mm are 0.28 m/s, as fast as the robot drives.
@pytest.mark.parametrize("step", [1, 2, 5, 7])
def test_a_sweep_from_60_cm_to_contact_and_back(step):
    block = sensor()
    inwards = millimetres(600, 0, step)
    both = [*inwards, *inwards[::-1]]
    for true, seen in zip(both, swept(block, both), strict=True):
        if true < 0.037:
            # What is nearer than the certain range is never given out as a distance.
            assert seen.state == "too_close", true
        elif 0.044 < true < REACH - 0.01:
            assert seen.state == "measured", true
            assert seen.distance == pytest.approx(true, abs=FIT)
        elif true > REACH + 0.01:
            assert (seen.state, seen.distance) == ("clear", REACH)


def test_folded_back_voltages_are_not_believed():
    # 1 cm reads like 6.7 cm, 0.5 cm like 9.1 cm.
    block = sensor()
    swept(block, millimetres(100, 20))
    for i, true in enumerate((0.015, 0.01, 0.005), 81):
        seen = block.react(i * STEP, Volts(i * STEP, volts(true)), None)
        assert (seen.state, seen.distance) == ("too_close", 0.0)


def test_the_same_voltages_are_believed_when_nothing_came_close():
    seen = swept(sensor(), [0.02])[0]  # nobody can tell, from one reading alone
    assert (seen.state, seen.distance) == ("measured", pytest.approx(0.0537, abs=FIT))


def test_resume_forgets_what_was_close():
    block = sensor()
    assert swept(block, millimetres(100, 10))[-1].state == "too_close"
    consent = Resume(100 * STEP)
    seen = block.react(100 * STEP, Volts(100 * STEP, volts(0.2)), consent)
    assert seen.state == "measured"


def test_the_same_consent_counts_once():
    block = sensor()
    consent = Resume(0)
    block.react(0, Volts(0, volts(0.2)), consent)
    for i, true in enumerate(millimetres(100, 10), 1):
        seen = block.react(i * STEP, Volts(i * STEP, volts(true)), consent)
    assert seen.state == "too_close"


def test_something_that_goes_away_sideways_is_gone():
    # In front of the robot at 2 cm, then nothing: 0.06 V a frame later, quicker than any drive.
    block = sensor()
    swept(block, [*millimetres(100, 20), 0.025, 0.03, 0.028])
    assert block.react(200 * STEP, Volts(85 * STEP, 0.061), None).state == "clear"


@pytest.mark.parametrize(
    "readings, states",
    [
        ([nan], ["fault"]),
        ([0.0, 0.0], ["clear", "clear"]),  # two zeros may be noise
        ([0.0, 0.0, 0.0], ["clear", "clear", "fault"]),
        ([0.0, 0.0, 0.5, 0.0, 0.0], ["clear", "clear", "measured", "clear", "clear"]),
        ([nan, 0.5], ["fault", "measured"]),
    ],
)
def test_faults(readings, states):
    block = sensor()
    seen = [block.react(i, Volts(i * STEP, v), None).state for i, v in enumerate(readings)]
    assert seen == states


def test_a_frozen_voltage_is_a_fault_after_three_seconds():
    block = sensor()
    seen = [block.react(i, Volts(i * STEP, 0.5), None).state for i in range(122)]
    assert seen == ["measured"] * 120 + ["fault"] * 2  # 120 frames of 25 ms are 3 s
    assert block.react(122, Volts(122 * STEP, 0.51), None).state == "measured"


def test_a_frozen_voltage_may_be_believed():
    block = sensor(frozen_for=None)
    assert {block.react(i, Volts(i * STEP, 0.5), None).state for i in range(400)} == {"measured"}


@pytest.mark.parametrize(
    "distance, reads",
    [
        # a / (d + b) + c with a 0.15 V m, b 10 mm, c 0
        (0.04, 3.0),
        (0.09, 1.5),
        (0.29, 0.5),
    ],
)
def test_the_curve_by_hand(distance, reads):
    assert volts_at(distance, 0.15, 0.01, 0.0) == pytest.approx(reads)
    assert distance_at(reads, 0.15, 0.01, 0.0) == pytest.approx(distance)


def test_a_voltage_below_the_curves_end_is_infinitely_far():
    assert distance_at(-0.05, CURVE.a, CURVE.b, CURVE.c) == float("inf")


def test_no_reading_nothing():
    assert sensor().react(1, None, None) is None
