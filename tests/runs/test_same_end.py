"""Simulator and emulated board end alike: a sample of the scenarios that `prove` runs."""

import pytest

from tests.support.trials.same_end import SCENARIOS, compare

SAMPLE = (
    "left wheel blocked",
    "low battery",
    "stop button",
    "silent host",
    "polarity unproven",
    "motors swapped",
)


@pytest.mark.parametrize("name", SAMPLE)
def test_a_scenario_ends_alike(name):
    simulated, emulated = compare(name, 3)
    assert simulated.agrees(emulated), (simulated, emulated)


def test_a_dead_encoder_is_a_fault_and_no_pivot():
    simulated, _ = compare("right encoder dead, pivot", 4)
    assert simulated.stops == ("wheel_fault",)


def test_there_are_thirty_scenarios():
    assert len(SCENARIOS) >= 30
