"""Bounds on the angle of a disc by the level of its encoder's pin."""

from math import sqrt

import pytest

from diffbotctl.estimation.edge_hypothesis import EdgeHypothesis
from diffbotctl.estimation.pin_level import intervals
from diffbotctl.estimation.predicted_wheel import DIAGONAL, Z_Z
from diffbotctl.estimation.wheel_frame import WheelFrame
from diffbotctl.estimation.wheel_kalman import WheelKalman
from diffbotctl.estimation.wheel_side import Priors

FRAME = 20_000_000  # ns
LAG = 0.05  # s
SLOTS = 20
DRIVE, DUTY = 10.0, 0.5  # pitches/s


@pytest.mark.parametrize(
    ("low", "high", "has_counted_level", "expected"),
    [
        (0.0, 1.0, True, [(0.0, 0.5)]),
        (0.0, 1.0, False, [(0.5, 1.0)]),
        (3.0, 4.0, True, [(3.0, 3.5)]),
        # After a reversal: the next edge may be either edge of the slot.
        (2.5, 4.0, True, [(3.0, 3.5)]),
        (2.5, 4.0, False, [(2.5, 3.0), (3.5, 4.0)]),
        # After an edge that was passed backward.
        (-1.5, -0.5, True, [(-1.0, -0.5)]),
        (-1.5, -0.5, False, [(-1.5, -1.0)]),
    ],
)
def test_intervals_of_each_level(low, high, has_counted_level, expected):
    assert intervals(low, high, has_counted_level, 0.5) == expected


def test_intervals_end_at_the_open_share_of_the_disc():
    assert intervals(0.0, 1.0, True, 0.4) == [(0.0, 0.4)]
    assert intervals(0.0, 1.0, False, 0.4) == [(0.4, 1.0)]


def test_the_level_counts_only_where_one_edge_is_counted():
    from diffbotctl.estimation.pin_level import COUNTED_LEVELS

    assert COUNTED_LEVELS == {"rising": 1, "falling": 0}


def hypothesis(**priors):
    return EdgeHypothesis(WheelKalman(Priors(lag=LAG, **priors), SLOTS), 0, 0)


def frame(number, count=0, drive=0.0, level=None, since=0):
    """A frame of a board that does not tell edge times."""
    duty = DUTY if drive > 0.0 else -DUTY if drive < 0.0 else 0.0
    return WheelFrame(number * FRAME, count, None, drive, since, duty, None, False, level)


@pytest.mark.parametrize(("level", "place"), [(True, 0.25), (False, 0.75)])
def test_before_the_first_edge_the_level_halves_the_slot(level, place):
    wheel = hypothesis()
    assert wheel.motion.covariance[Z_Z] == pytest.approx(1 / 12)
    for number in range(1, 20):
        wheel.update(frame(number, level=level))
    # Uniform over half a pitch; known no better by telling it often.
    assert wheel.motion.z == pytest.approx(place)
    assert sqrt(wheel.motion.covariance[Z_Z]) == pytest.approx(0.5 / sqrt(12))


@pytest.mark.parametrize(
    ("level", "direction", "edge_slot"),
    [
        (True, 1, 0),  # between 0 and 0.5; forward, the next edge is that of slot 1
        (False, 1, 0),
        (True, -1, 0),  # backward, the next one is at -0.5: that of slot -1
        (False, -1, 1),  # between 0.5 and 1; the next one is at 0.5: that of slot 0
    ],
)
def test_a_level_at_rest_shows_the_first_edge_in_either_direction(level, direction, edge_slot):
    wheel = hypothesis()
    for number in range(1, 4):
        wheel.update(frame(number, level=level))
    place = wheel.motion.z
    wheel.update(frame(4, drive=direction * DRIVE, since=4 * FRAME))
    assert (wheel.edge_direction, wheel.edge_slot) == (direction, edge_slot)
    assert wheel.motion.z == pytest.approx(place)


def at_rest(level):
    """A wheel that has gone forward past three edges, half a pitch beyond, and rests with that
    level."""
    wheel = hypothesis()
    for number in range(1, 16):
        (wheel,) = wheel.update(frame(number, number // 5, DRIVE))[:1]
    for number in range(16, 45):
        (wheel,) = wheel.update(frame(number, 3, level=level, since=15 * FRAME))[:1]
    assert wheel.motion.speed == 0.0
    return wheel


@pytest.mark.parametrize(
    ("level", "place"),
    [
        (True, 3.5 - 1.0),  # it rests between 3 and 3.5, and comes back to 2.5 first
        (False, 3.5),  # between 3.5 and 4
    ],
)
def test_the_level_at_rest_decides_which_edge_is_first_after_a_reversal(level, place):
    """The edge comes after 0.5 of a pitch by the motor, which may be that of either."""
    wheel = at_rest(level)
    assert wheel.edge_slot == 3
    start = 44 * FRAME
    hypotheses = [wheel]
    for number in range(45, 50):
        count = 3 if number < 49 else 2
        after = [h.update(frame(number, count, -DRIVE, since=start)) for h in hypotheses]
        hypotheses = [each for several in after for each in several]
    best = max(hypotheses, key=lambda each: each.motion.log_likelihood)
    assert best.edge_direction == -1 and best.edge_place == place


def test_a_level_that_cannot_be_does_not_move_a_wheel_at_an_edge():
    """A light barrier that stands on an edge gives either level."""
    wheel = at_rest(True)
    motion = wheel.motion
    motion.z = 3.02
    motion.covariance = tuple(
        0.0004 if entry == Z_Z else 0.0 if entry not in DIAGONAL else value
        for entry, value in enumerate(motion.covariance)
    )
    wheel.update(frame(45, 3, level=False))
    assert wheel.motion.z == pytest.approx(3.02, abs=0.01)


def test_where_a_pulse_is_missing_the_level_is_not_used():
    wheel = at_rest(True)
    wheel.unseen_edges = 1
    before = wheel.motion.z
    wheel.update(frame(45, 3, level=False))
    assert wheel.motion.z == before
