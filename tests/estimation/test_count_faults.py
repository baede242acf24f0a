"""The share of missed and additional edges, from counts drawn with known shares."""

from math import isfinite, pi, sin
from random import Random
from statistics import median

import pytest

from diffbotctl.estimation.count_faults import HIDDEN_SHARE, CountFaults
from tests.sampling import by_day

PERIOD = 0.02  # s, of the frames


WEIGHTS = (1 / 6, -4 / 6, 1, -4 / 6, 1 / 6)


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


@pytest.mark.parametrize("seed", by_day(1, range(5)))
@pytest.mark.parametrize("rate, ripple", [(700.0, 0.1), (150.0, 0.1), (5000.0, 0.2)])
def test_an_encoder_that_works_has_no_warning(seed, rate, ripple):
    faults = counted(seed, rate=rate, ripple=ripple)
    assert faults.share < 0.02 and faults.text == ""


@pytest.mark.parametrize("seed", by_day(1, range(5)))
@pytest.mark.parametrize(
    "missed, doubled, share", [(0.05, 0.0, 0.05), (0.02, 0.0, 0.02), (0.0, 0.05, 0.05)]
)
def test_the_share_is_found(seed, missed, doubled, share):
    # Spans of 14 edges: rounding has a variance of 0.6 +- 0.6, the share times 27.
    assert counted(seed, missed, doubled).share == pytest.approx(share, abs=0.03)


def test_the_share_is_reported():
    assert counted(1).text == ""
    assert "edges are missing or counted twice: about" in counted(1, missed=0.1).text


def test_a_reversal_is_no_fault():
    faults = CountFaults(has_edge_times=False)
    for number in range(400):
        faults.add(PERIOD, 20, 1 if number // 40 % 2 else -1)
    assert faults.share < 1e-4


@pytest.mark.parametrize("rate", [487.0, 501.0, 512.0])
def test_a_few_faults_show_where_rounding_is_small(rate):
    # About ten edges in every frame: without faults nearly all counts are equal.
    turning = {"rate": rate, "ripple": 0.02, "frames": 600}
    healthy = [counted(seed, **turning).share for seed in range(20)]
    faulty = [counted(seed, doubled=0.0125, **turning).share for seed in range(20)]
    assert median(healthy) < 0.001 and median(faulty) > 0.009


@pytest.mark.parametrize("seed", by_day(1, range(4)))
@pytest.mark.parametrize("missed", [0.0, 0.05])
def test_edge_times_show_faults_of_a_slow_wheel(seed, missed):
    # 24 edges/s in frames of 25 ms.
    rng, faults, place, counted_at = Random(seed), CountFaults(has_edge_times=True), 0.0, 0.0
    lost = edges = 0
    for frame in range(400):
        place += 24.0 * 0.025
        if place < 1.0:
            continue
        place -= 1.0
        edges += 1
        edge = 0.025 * (frame + 1) - place / 24.0
        if rng.random() < missed:
            lost += 1
            continue
        faults.add(edge - counted_at, 1, 1)
        counted_at = edge
    assert faults.share == pytest.approx(lost / edges, rel=0.5, abs=1e-3)


def rough(seed, missed, has_edge_times, rate=3000.0):
    """The same of a wheel that turns unevenly, by 0.3 % from frame to frame, and is jolted now and
    then: its speed changes at once by 15 % and comes back."""
    rng, faults = Random(seed), CountFaults(has_edge_times)
    place = time = rest = counted_time = jolt = 0.0
    for frame in range(500):
        if frame % 90 == 45:
            jolt = rng.choice((-0.15, 0.15))
        speed = rate * (1.0 + jolt + rng.gauss(0.0, 0.003))
        place, time, jolt = place + speed * PERIOD, time + PERIOD, 0.6 * jolt
        edges = int(place)
        place -= edges
        lost = sum(rng.random() < missed for _ in range(edges))
        rest = place / speed if has_edge_times else 0.0
        faults.add(time - rest - counted_time, edges - lost, 1)
        counted_time = time - rest
    return faults


@pytest.mark.parametrize("seed", by_day(1, range(3)))
@pytest.mark.parametrize("has_edge_times", [False, True])
def test_jolts_and_an_uneven_motor_are_no_faults_of_the_encoder(seed, has_edge_times):
    faults = rough(seed, 0.0, has_edge_times)
    assert faults.share < 0.004 and faults.text == ""


@pytest.mark.parametrize("seed", by_day(1, range(3)))
@pytest.mark.parametrize("has_edge_times", [False, True])
def test_faults_are_found_in_spite_of_jolts(seed, has_edge_times):
    assert rough(seed, 0.02, has_edge_times).share == pytest.approx(0.02, abs=0.01)


def cogging(seed, missed, amplitude=0.12, slots=82, rate=17.0):
    """The same of a slow wheel with edge times, whose gear cogs twelve times a turn."""
    rng, faults = Random(seed), CountFaults(has_edge_times=True)
    phase, counted_time = rng.random(), 0.0
    time, place, edges, lost, all_lost, all_edges = 0.0, rng.random(), 0, 0, 0, 0
    for step in range(60_000):  # of a millisecond
        time += 0.001
        turned = place / slots
        place += rate * (1.0 + amplitude * sin(2 * pi * (12 * turned + phase))) * 0.001
        if int(place) > edges + lost:
            all_edges += 1
            if rng.random() < missed:
                lost += 1
                all_lost += 1
            else:
                edges += 1
                last = time
        if step % 25 == 24 and edges:
            faults.add(last - counted_time, edges, 1)
            counted_time, edges, place, lost = last, 0, place - edges - lost, 0
            phase += 12 * (turned - place / slots)
    return faults, all_lost / all_edges


@pytest.mark.parametrize("seed", by_day(1, range(3)))
def test_a_gear_that_cogs_is_no_fault_of_the_encoder(seed):
    """By 12 %: 0.3 edges in a span of three. A fault changes a count by a whole one."""
    faults, _ = cogging(seed, 0.0)
    assert faults.share < 0.01 and faults.text == ""


@pytest.mark.parametrize("seed", by_day(1, range(3)))
def test_missed_edges_are_found_in_spite_of_a_gear_that_cogs(seed):
    faults, share = cogging(seed, 0.05, amplitude=0.06)
    assert faults.share == pytest.approx(share, rel=0.5)
    assert "edges are missing or counted twice" in faults.text


def test_where_the_jitter_of_frames_hides_faults_counts_prove_nothing():
    faults = CountFaults(has_edge_times=False, is_hidden=True)
    for edges in (100, 100, 90, 100, 100, 110) * 60:
        faults.add(PERIOD, edges, 1)
    assert faults.share == HIDDEN_SHARE and faults.text == ""


@pytest.mark.parametrize("has_edge_times", [False, True])
def test_edges_that_nothing_explains_have_a_probability(has_edge_times):
    """Interference at a wheel that stands: its edges are hundreds of standard deviations away."""
    faults = CountFaults(has_edge_times)
    for edges in (5, 5, 6, 6, 10_000, 5, 5, 6, 2_000, 5, 5, 5) * 3:
        faults.add(PERIOD, edges, 1)
    assert all(isfinite(value) for value in faults.logs)
