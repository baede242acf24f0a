"""Faults of recorded counts, planted at random places, and drives that have none."""

from random import Random

import numpy as np
import pytest

from diffbotctl.calibrate.log_checks import count_fault, encoder_fault, part_fault


def driven(seed, rows=600):
    """Times and counts of wheels whose speeds change now and then, also their direction."""
    rng = Random(seed)
    rate = rng.choice([0.3, 1.0, 8.0, 60.0])  # counts a row
    speeds = []
    while len(speeds) < rows:
        pair = [rng.uniform(-1, 1) * rate, rng.uniform(0.2, 1) * rate]
        speeds += [pair] * rng.randint(20, 120)
    counts = np.floor(np.cumsum(speeds[:rows], axis=0))
    period = rng.choice([0.005, 0.025, 0.05])
    times = np.cumsum([period * rng.uniform(0.7, 1.3) for _ in range(rows)])
    return times, counts


@pytest.mark.parametrize("seed", range(12))
def test_counts_without_a_fault(seed):
    assert count_fault(*driven(seed)) is None


@pytest.mark.parametrize("seed", range(6))
@pytest.mark.parametrize("bits", [12, 16])
def test_a_counter_that_wraps_is_named_with_its_wheel(seed, bits):
    times, counts = driven(seed, 3000)
    counts[:, 1] += 2.0**bits - counts[:, 1].max() / 2
    wrapped = counts.copy()
    wrapped[:, 1] %= 2**bits
    fault = count_fault(times, wrapped)
    assert fault is not None and "left wheel jump" in fault


@pytest.mark.parametrize("seed", range(8))
def test_a_counter_that_is_set_back_is_named(seed):
    times, counts = driven(seed)
    row = Random(seed).randint(200, 400)
    jump = 1500.0 + 37 * seed
    counts[row:, 0] -= jump
    fault = count_fault(times, counts)
    assert fault is not None and "right wheel jump" in fault and f"{times[row]:.2f} s" in fault


@pytest.mark.parametrize("seed", range(8))
def test_rows_that_are_missing_while_the_wheels_turn(seed):
    times, counts = driven(seed)
    first, last = 250, 400
    kept = [*range(first), *range(last, len(times))]
    fault = count_fault(times[kept], counts[kept])
    assert (
        fault is not None and f"gap from {times[first - 1]:.2f} s to {times[last]:.2f} s" in fault
    )


def test_a_pause_without_motion_is_no_gap():
    times, counts = driven(3)
    times[300:] += 20.0
    counts[300:] -= counts[300] - counts[299]
    assert count_fault(times, counts) is None


@pytest.mark.parametrize(
    ("rest", "named"),
    # 100 rows of 20 ms with 5 counts each; rows of rest before and after.
    [((20, 20), None), ((0, 20), "first rows"), ((20, 0), "last rows"), ((3, 10), None)],
)
def test_a_drive_begins_and_ends_at_rest(rest, named):
    counts = np.pad(np.outer(5.0 * np.arange(100), [1, 1]), (rest, (0, 0)), mode="edge")
    fault = part_fault(0.02 * np.arange(len(counts)), counts)
    assert fault is None if named is None else named in fault


@pytest.mark.parametrize(
    ("right", "left", "words"),
    [
        (400, 310, None),
        (400, 1, "the left encoder counted 1, the other one 400"),
        (0, 90, "the right encoder counted 0"),
        (0, 0, "neither encoder counted"),
        (400, 400, "one column written twice"),
        (5, 5, None),  # too little to see it
    ],
)
def test_encoders_that_do_not_count_or_count_alike(right, left, words):
    counts = np.round(np.linspace([0, 0], [right, left], 50))
    fault = encoder_fault(counts)
    assert fault is None if words is None else words in (fault or "")
