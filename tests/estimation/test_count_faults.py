"""The share of missed and additional edges, from counts drawn with known shares."""

from math import pi, sin
from random import Random

import pytest

from diffbotctl.estimation.count_faults import CountFaults

PERIOD = 0.02  # s, of the frames


def counted(seed, missed=0.0, doubled=0.0, frames=400, rate=700.0, ripple=0.1):
    """Faults learnt from the counts of a wheel with `rate` edges/s and a rippling speed."""
    rng = Random(seed)
    faults = CountFaults(has_edge_times=False)
    place = phase = rng.random()
    passed = int(place)
    for _ in range(frames):
        phase += PERIOD / 0.5  # two turns a second
        place += rate * (1.0 + ripple * sin(2 * pi * phase)) * PERIOD
        edges = int(place) - passed
        passed += edges
        lost = sum(rng.random() < missed for _ in range(edges))
        more = sum(rng.random() < doubled for _ in range(edges))
        faults.add(PERIOD, edges - lost + more, 1)
    return faults


@pytest.mark.parametrize("seed", range(5))
@pytest.mark.parametrize("rate, ripple", [(700.0, 0.1), (150.0, 0.1), (5000.0, 0.2)])
def test_an_encoder_that_works_has_no_warning(seed, rate, ripple):
    faults = counted(seed, rate=rate, ripple=ripple)
    assert faults.share < 0.02 and faults.text == ""


@pytest.mark.parametrize("seed", range(5))
@pytest.mark.parametrize(
    "missed, doubled, share", [(0.05, 0.0, 0.05), (0.02, 0.0, 0.02), (0.0, 0.05, 0.05)]
)
def test_the_share_is_found(seed, missed, doubled, share):
    # Spans of 14 edges: rounding has a variance of 0.6 +- 0.6, the share times 27.
    assert counted(seed, missed, doubled).share == pytest.approx(share, abs=0.03)


def test_the_share_is_told():
    assert counted(1).text == ""
    assert "edges are missing or counted twice: about" in counted(1, missed=0.1).text


def test_a_reversal_is_no_fault():
    faults = CountFaults(has_edge_times=False)
    for number in range(400):
        faults.add(PERIOD, 20, 1 if number // 40 % 2 else -1)
    assert faults.share < 1e-4
