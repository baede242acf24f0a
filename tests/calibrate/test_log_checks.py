"""Faults of recorded counts, planted at random places, and drives that have none."""

from random import Random

import numpy as np
import pytest

from diffbotctl.calibrate.dead_reckoning import MOTION_CAPTURE, Geometry, RecordedDrive
from diffbotctl.calibrate.drive_doubts import is_dead, silent_encoder
from diffbotctl.calibrate.log_checks import (
    copied_column,
    count_fault,
    dead_encoder,
    part_fault,
    standing_drive,
    table_fault,
    ticks_gap,
)


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


def test_one_column_in_both_is_named():
    drives = [driven(seed)[1] for seed in range(3)]
    assert copied_column(drives) is None
    copies = [counts[:, [0, 0]] for counts in drives]
    assert "one column written twice" in (copied_column(copies) or "")
    assert copied_column([*copies, drives[0]]) is None  # one drive shows that there are two
    assert copied_column([np.array([[0.0, 0.0], [5.0, 5.0]])]) is None  # too little to tell


@pytest.mark.parametrize("seed", range(6))
@pytest.mark.parametrize("bits", [8, 12, 16])
def test_a_counter_that_wraps_is_named_with_its_wheel(seed, bits):
    times, counts = driven(seed, 3000)
    counts[:, 1] += 2.0**bits - counts[:, 1].max() / 2
    wrapped = counts.copy()
    wrapped[:, 1] %= 2**bits
    fault = count_fault(times, wrapped)
    assert fault is not None and "left wheel" in fault and str(2**bits) in fault


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


def test_one_missing_row_of_ticks_is_a_gap():
    times = 0.05 * np.arange(100)
    assert ticks_gap(times) is None
    assert "from 1.95 s to 2.05 s" in ticks_gap(np.delete(times, 40))


def test_an_encoder_that_never_counts_is_dead():
    assert "left encoder" in dead_encoder(np.array([[400.0, 0.0], [310.0, 1.0]]))
    assert "right encoder" in dead_encoder(np.array([[0.0, 90.0]]))
    assert dead_encoder(np.array([[400.0, 0.0], [310.0, 290.0]])) is None  # one drive: a pivot


def test_a_reset_near_a_power_of_two_is_no_wrap():
    # 30 counts a row up to 30 000: less than 2^15 by more than a wheel turns in some rows.
    times = 0.02 * np.arange(2000)
    counts = np.column_stack([30.0 * np.arange(2000), 30.0 * np.arange(2000)])
    counts[1001:, 0] -= 30000.0
    fault = count_fault(times, counts)
    assert fault is not None and "jump by -29970" in fault


def test_points_between_thousands_are_named():
    counts = np.arange(0.0, 2500.0, 3.0)
    read = np.where(counts < 1000, counts, counts / 1000)  # "1.002" of 1002
    times = 0.02 * np.arange(len(counts))
    fault = count_fault(times, np.column_stack([read, read]))
    assert fault is not None and "no points between thousands" in fault


@pytest.mark.parametrize(
    ("rest", "named"),
    # 100 rows of 20 ms with 5 counts each; rows of rest before and after.
    [((20, 20), None), ((0, 20), "first rows"), ((20, 0), "last rows"), ((3, 10), None)],
)
def test_a_drive_begins_and_ends_at_rest(rest, named):
    counts = np.pad(np.outer(5.0 * np.arange(100), [1, 1]), (rest, (0, 0)), mode="edge")
    fault = part_fault(0.02 * np.arange(len(counts)), counts)
    assert fault is None if named is None else named in fault


def test_drives_in_which_the_robot_stood():
    assert standing_drive(np.array([[400.0, 0.0], [0.0, 3.0]])) is None
    assert standing_drive(np.array([[400.0, 3.0], [0.0, 0.0]]))[0] == 1
    assert "in any drive" in standing_drive(np.zeros((3, 2)))[1]


@pytest.mark.parametrize(
    ("left", "said"),
    # The right wheel counts 10 in each of 100 rows of 0.1 s.
    [
        (10.0 * np.arange(101), None),
        (np.zeros(101), "the left encoder counted 0, the right one 1000"),
        (10.0 * np.minimum(np.arange(101), 40), "nothing after 4.0 s, but the right one 600"),
        (10.0 * np.maximum(np.arange(101), 30), "nothing before 3.0 s, but the right one 300"),
        (10.0 * np.minimum(np.arange(101), 95), None),  # the last turn is around that wheel
    ],
)
def test_an_encoder_that_counts_in_a_part_of_the_drive(left, said):
    counts = np.column_stack([10.0 * np.arange(101), left])
    found = silent_encoder(0.1 * np.arange(101), counts)
    assert found is None if said is None else said in found


def test_whole_seconds_are_no_rows_that_are_written_twice():
    times = np.floor(0.1 * np.arange(100))
    fault = table_fault(np.column_stack([times, np.arange(100), np.arange(100)]))
    assert "more decimals" in fault


@pytest.mark.parametrize(("length", "dead"), [(0.15, False), (0.5, True)])
def test_a_robot_with_one_standing_wheel_stays_near_it(length, dead):
    # One track is 0.15 m. Its middle circles around the left wheel at half of that.
    turns = np.column_stack([np.linspace(0.0, 2.0, 41), np.zeros(41)])
    poses = np.column_stack([np.linspace(0.0, length, 41), np.zeros(41), np.zeros(41)])
    drive = RecordedDrive(
        "one", 0.1 * np.arange(41), turns, np.arange(41), poses, (0.05, 0.05), MOTION_CAPTURE
    )
    assert is_dead(drive, Geometry(0.065, 0.065, 0.15)) is dead
