"""Sweeps of the distance with the simulated sensor, from contact to 60 cm."""

import pytest

from diffbotctl.blocks.range_sensor import REACH, RangeSensor
from diffbotctl.config.load import load
from diffbotctl.messages import Volts
from diffbotctl.plant.range_sensors import volts

SENSORS = load("goal", None, []).nominal.sensors
STEP = 25_000_000  # ns between two frames
# The curve fits the data sheet's points to 1.9 mm. Between points h apart a straight line lies
# outside the hyperbola a / (d + b) by h^2 / 4 (d + b) at most: 2.6 mm between 20 and 25 cm.
FIT = 0.0045  # m


def sensor(**changes):
    return RangeSensor(**{"sensors": SENSORS, "speed": 0.3, **changes})


def swept(block, distances, start=0):
    """The Range at each true distance (m), one frame after the other."""
    return [
        block.react(i * STEP, Volts(i * STEP, volts(d)), None, None)
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
            # A distance below the unambiguous range is never reported.
            assert seen.state == "too_close", true
        elif 0.044 < true < REACH - 0.01:
            assert seen.state == "measured", true
            assert seen.distance == pytest.approx(true, abs=FIT)
        elif true > REACH + 0.01:
            assert (seen.state, seen.distance) == ("clear", REACH)


def test_folded_back_voltages_are_rejected():
    # 1 cm reads like 6.7 cm, 0.5 cm like 9.1 cm.
    block = sensor()
    swept(block, millimetres(100, 20))
    for i, true in enumerate((0.015, 0.01, 0.005), 81):
        seen = block.react(i * STEP, Volts(i * STEP, volts(true)), None, None)
        assert (seen.state, seen.distance) == ("too_close", 0.0)


def test_the_same_voltages_are_accepted_when_nothing_came_close():
    seen = swept(sensor(), [0.02])[0]  # one reading alone is ambiguous
    assert (seen.state, seen.distance) == ("measured", pytest.approx(0.0537, abs=FIT))
