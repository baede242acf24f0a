"""The block `range_sensor` with each type of Sharp sensor, by the curves of the data sheets."""

from types import SimpleNamespace

import pytest

from diffbotctl.blocks.range_sensor import FoldbackDetector, RangeSensor
from diffbotctl.geometry.distance_sensors import SHARPS, paper_volts
from diffbotctl.messages import Volts

PERIOD = 25_000_000  # ns


def block_of(kind):
    facts = SHARPS[kind]
    curve = SimpleNamespace(**dict(zip("abc", facts.curve, strict=True)))
    sensor = SimpleNamespace(type=kind, curve=curve, near=None, reach=None)
    block = RangeSensor(frozen_for=None, sensors={"front": sensor}, speed=0.3)
    block.reset()
    return block


@pytest.mark.parametrize("kind", SHARPS)
def test_distances_are_measured_between_near_and_reach(kind):
    facts, block = SHARPS[kind], block_of(kind)
    now = 0
    for step in range(1, 20):
        distance = facts.reach - step * (facts.reach - facts.near) / 20
        now += PERIOD
        reading = block.react(now, Volts(now, paper_volts(facts, distance)), None, None)
        assert (reading.state, reading.distance) == (
            "measured",
            pytest.approx(distance, rel=0.05),
        )
    now += PERIOD
    reading = block.react(now, Volts(now, paper_volts(facts, 1.2 * facts.reach)), None, None)
    assert reading.state == "clear"


@pytest.mark.parametrize("kind", SHARPS)
def test_closer_than_the_peak_is_never_a_distance(kind):
    """The robot drives at 0.3 m/s until it touches: 7.5 mm a reading."""
    facts, block = SHARPS[kind], block_of(kind)
    now, distance, states = 0, facts.reach, []
    while distance > 0.005:
        now += PERIOD
        distance -= 0.3 * PERIOD * 1e-9
        reading = block.react(now, Volts(now, paper_volts(facts, distance)), None, None)
        if distance < facts.near - 0.01:
            states.append(reading.state)
    assert states and set(states) == {"too_close"}


def test_the_detector_needs_no_facts_for_the_usual_sensor():
    detector = FoldbackDetector(2.66, 0.3)
    assert not detector.is_too_close(0, 1.0)
    assert detector.is_too_close(PERIOD, 2.7)
