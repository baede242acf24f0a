"""One wheel: the closed-form exponential, friction, and the times of its encoder edges."""

from itertools import pairwise
from math import exp, log, pi
from random import Random

import pytest
from hypothesis import given
from hypothesis import strategies as st

from diffbotctl.config.simulation import EncoderTruth
from diffbotctl.plant.encoder_disc import EncoderDisc, EncoderPin, PulseFaults, draw_disc
from diffbotctl.plant.wheel import REST_SPEED, MotorModel, WheelModel
from diffbotctl.time import SECOND

SLOTS = 20
PITCH = 2 * pi / SLOTS
# Half of each pitch open: rising flanks at whole pitches, falling ones half a pitch later.
IDEAL = EncoderDisc(tuple(k * PITCH / 2 for k in range(2 * SLOTS)), 0.0, 0.0)
LAG = 0.1  # s
# 10 rad/s at full duty; duty 0.55 is half-way between the keeping 0.1 and 1: 5 rad/s.
MOTOR = MotorModel(speed=10.0, lag=LAG, start=0.12, keep=0.1)
HALF = 0.55


def wheel(disc=IDEAL, **changes):
    return WheelModel(MOTOR._replace(**changes), disc, Random(1))


@pytest.mark.parametrize("sign", [1, -1])
@pytest.mark.parametrize("seconds", [0.003, 0.1, 0.25, 1.0])
def test_a_step_of_duty_is_followed_exponentially(seconds, sign):
    made = wheel()
    made.advance(int(seconds * SECOND), sign * HALF)
    # Speed 5 (1 - e^-t/lag); its integral 5 (t - lag (1 - e^-t/lag)).
    share = 1 - exp(-seconds / LAG)
    assert made.speed == pytest.approx(sign * 5 * share, rel=1e-9)
    assert made.angle == pytest.approx(sign * 5 * (seconds - LAG * share), rel=1e-9)


def test_after_one_lag_by_hand():
    made = wheel()
    made.advance(SECOND // 10, HALF)
    assert made.speed == pytest.approx(3.16060, abs=1e-5)  # 5 x 0.632121
    assert made.angle == pytest.approx(0.183940, abs=1e-6)  # 0.5 x (1 - 0.632121)


@given(st.lists(st.integers(1, 400_000_000), min_size=1, max_size=20))
def test_the_step_size_changes_nothing(steps):
    once, often, now, rises = wheel(ripple=0.02), wheel(ripple=0.02), 0, []
    for step in steps:
        now += step
        rises += often.advance(now, HALF)
    assert list(once.advance(now, HALF)) == pytest.approx(rises, abs=1)  # ns
    assert often.angle == pytest.approx(once.angle, abs=1e-9)
    assert often.speed == pytest.approx(once.speed, abs=1e-9)


@pytest.mark.parametrize("sign, first", [(1, 1.0), (-1, 0.5)])
def test_edge_times_by_hand(sign, first):
    # Two seconds are twenty lags: from then on the angle is 5 (t - lag), to a nanoradian, and the
    # edge at k pitches comes at lag + k PITCH / 5. Backwards it is the slot's far end that opens.
    rises = wheel().advance(3 * SECOND, sign * HALF)
    expected = [LAG + (first + k) * PITCH / 5 for k in range(60)]
    late = [round(t * SECOND) for t in expected if 2.0 < t <= 3.0]
    assert [t for t in rises if t > 2 * SECOND] == pytest.approx(late, abs=2)
    assert len(rises) == sum(t <= 3.0 for t in expected)  # none is lost, none comes twice


@pytest.mark.parametrize("sign, first", [(1, 0.5), (-1, 1.0)])
def test_falling_edges_are_half_a_pitch_later(sign, first):
    made = WheelModel(MOTOR, IDEAL, Random(1), falling=True)
    falls = made.advance(3 * SECOND, sign * HALF)
    # The slot that lies open at the start closes half a pitch ahead, or at its near end behind,
    # which is where the disc stands: that one is a whole pitch away.
    expected = [LAG + (first + k) * PITCH / 5 for k in range(60)]
    late = [round(t * SECOND) for t in expected if 2.0 < t <= 3.0]
    assert [t for t in falls if t > 2 * SECOND] == pytest.approx(late, abs=2)


@pytest.mark.parametrize("sign", [1, -1])
@pytest.mark.parametrize("falling", [False, True])
def test_a_watched_pin_reports_both_edges_of_each_slot(sign, falling):
    # A quarter of each pitch is open.
    flanks = [place * PITCH for k in range(SLOTS) for place in (k, k + 0.25)]
    made = WheelModel(
        MOTOR, EncoderDisc(tuple(flanks), 0.1 * PITCH, 0.0), Random(1), falling=falling
    )
    assert made.level == 1  # it starts within an open slot
    made.watch(True)
    counted = list(made.advance(3 * SECOND, sign * HALF))
    changes = made.changes(3 * SECOND)
    assert [level for _, level in changes[:4]] == [0, 1, 0, 1]
    assert [time for time, level in changes if level != falling] == counted
    # At a steady 5 rad/s a pitch takes PITCH / 5 seconds.
    open_times = [b.time - a.time for a, b in pairwise(changes) if a.level and a.time > 2 * SECOND]
    assert open_times == pytest.approx([PITCH / 20 * SECOND] * len(open_times), abs=2)
    made.watch(False)
    made.advance(4 * SECOND, sign * HALF)
    assert made.changes(4 * SECOND) == []


def test_a_bouncing_pin_returns_between_its_repeated_edges():
    made = wheel(IDEAL._replace(bounce=0.001))
    made.watch(True)
    counted = list(made.advance(SECOND, HALF))
    changes = made.changes(SECOND)
    rises = [time for time, level in changes if level]
    # Of a flank to low the pin chatters too: each time it rises three times more.
    assert set(counted) <= set(rises) and len(rises) - len(counted) >= 3 * len(counted) // 4
    assert [time for time, _ in changes] == sorted(time for time, _ in changes)
    assert all(a.level != b.level for a, b in pairwise(changes))


def test_an_edge_during_acceleration_is_timed_at_its_angle():
    time = wheel().advance(SECOND // 2, HALF)[0] / SECOND
    angle = 5 * (time - LAG * (1 - exp(-time / LAG)))
    assert angle == pytest.approx(PITCH, abs=5e-9)  # a nanosecond at 5 rad/s


def test_jitter_only_delays_edges_and_keeps_their_order():
    disc = IDEAL._replace(jitter=100e-6)
    late, sharp = wheel(disc), wheel()
    times = list(late.advance(20 * SECOND, HALF))
    exact = list(sharp.advance(20 * SECOND, HALF))
    delays = [a - b for a, b in zip(times, exact, strict=False)]
    assert min(delays) >= 0 and times == sorted(times)
    # Half a normal distribution has its mean at 0.798 standard deviations; of 300 delays the mean
    # scatters by 0.603 / sqrt(300) = 3.5 % of one, and four times that is allowed.
    assert sum(delays) / len(delays) == pytest.approx(79_800, abs=14_000)


def test_edges_never_overtake_each_other():
    # Delays of the order of the 63 ms between two edges
    times = list(wheel(IDEAL._replace(jitter=0.05)).advance(20 * SECOND, HALF))
    assert len(times) > 250 and times == sorted(times)


@pytest.mark.parametrize(
    "duty, turns", [(0.12, False), (-0.12, False), (0.121, True), (-0.121, True), (0.0, False)]
)
def test_a_resting_wheel_breaks_loose_above_its_starting_duty(duty, turns):
    made = wheel()
    made.advance(SECOND, duty)
    assert (made.angle != 0.0) is turns


def test_a_turning_wheel_keeps_turning_below_its_starting_duty():
    made = wheel()
    made.advance(SECOND, HALF)
    made.advance(5 * SECOND, 0.11)
    # 10 x (0.11 - 0.1) / (1 - 0.1) rad/s, above what friction alone would hold
    assert made.speed == pytest.approx(0.1111, abs=1e-4)


@pytest.mark.parametrize("duty", [0.1, 0.05, 0.0, -0.05])
def test_below_the_keeping_duty_it_comes_to_rest(duty):
    made = wheel()
    made.advance(SECOND, HALF)
    made.advance(5 * SECOND, duty)
    assert made.speed == 0.0


def test_linear_coasting_decays_exponentially_to_rest():
    made = wheel()
    made.advance(3 * SECOND, HALF)
    before = made.angle
    stops = 3.0 + LAG * log(5 / REST_SPEED)  # 0.391 s later
    made.advance(int((stops - 0.001) * SECOND), 0.0)
    assert made.speed == pytest.approx(REST_SPEED * exp(0.01), rel=1e-3)
    made.advance(int((stops + 0.001) * SECOND), 0.0)
    assert made.speed == 0.0
    assert made.angle - before == pytest.approx((5 - REST_SPEED) * LAG, rel=1e-6)


def test_coulomb_coasting_stops_in_finite_time():
    made = wheel(coulomb=True)
    made.advance(3 * SECOND, HALF)
    before = made.angle
    # Friction pulls towards -10 x 0.1 / 0.9 = -1.111 rad/s; zero is passed when e^-t/lag has come
    # down to 1.111 / 6.111: after lag ln 5.5 = 0.170475 s.
    made.advance(3 * SECOND + 170_000_000, 0.0)
    assert made.speed > 0.0
    made.advance(3 * SECOND + 171_000_000, 0.0)
    assert made.speed == 0.0
    # lag x 5 rad/s less 1.111 x 0.170475 rad
    assert made.angle - before == pytest.approx(0.5 - 0.189416, abs=1e-5)
    made.advance(10 * SECOND, 0.0)
    assert made.angle - before == pytest.approx(0.310584, abs=1e-5)  # it stays


def test_a_reversal_goes_through_rest():
    made = wheel()
    made.advance(3 * SECOND, HALF)
    made.advance(6 * SECOND, -HALF)
    assert made.speed == pytest.approx(-5.0, abs=1e-6)


def test_coulomb_friction_helps_to_brake_a_reversal():
    made = wheel(coulomb=True)
    made.advance(3 * SECOND, -HALF)
    # Turning backwards, friction pushes forward too: towards 10 x (0.55 + 0.1) / 0.9 = 7.222 rad/s.
    # From -5 zero is passed after lag ln(12.222 / 7.222) = 52.6 ms.
    made.advance(3 * SECOND + 52_000_000, HALF)
    assert made.speed < 0.0
    made.advance(3 * SECOND + 53_000_000, HALF)
    assert made.speed > 0.0
    made.advance(6 * SECOND, HALF)
    assert made.speed == pytest.approx(5.0)


def test_ripple_keeps_the_mean_speed():
    made = wheel(ripple=0.02)
    made.advance(3 * SECOND, HALF)
    before = made.angle
    made.advance(33 * SECOND, HALF)
    assert (made.angle - before) / 30 == pytest.approx(5.0, rel=0.005)


def test_a_drawn_disc_has_its_edges_in_order():
    for seed in range(50):
        disc = draw_disc(EncoderTruth(slot_spread=0.15, duty_spread=0.15), SLOTS, Random(seed))
        flanks = [*disc.edges, disc.edges[0] + 2 * pi]
        assert len(disc.edges) == 2 * SLOTS and flanks == sorted(flanks)


@given(st.integers(0, 10_000))
def test_each_turn_has_as_many_edges_as_slots(seed):
    disc = draw_disc(EncoderTruth(), SLOTS, Random(seed))
    made = WheelModel(MOTOR, disc, Random(seed))
    rises = made.advance(10 * SECOND, HALF)
    # Within half a slot: the flanks' places spread by 3 %, at most 12 %, of the pitch.
    assert abs(len(rises) - made.angle / PITCH) < 1.25


@pytest.mark.parametrize("falling", [True, False])
def test_the_level_of_a_pin_is_that_of_the_pulses_that_come(falling):
    """By hand: each pitch has an open half and a dark half; `index` counts the edges passed."""
    pin = EncoderPin(IDEAL, falling, Random(1))
    assert [pin.levels(index)[0] for index in range(6)] == [0, 1, 0, 1, 0, 1]
    pin.set_faults(PulseFaults(halved=True))
    assert [pin.levels(index)[0] for index in range(6)] == [0, 1, 0, 0, 0, 1]
    pin.set_faults(PulseFaults(silent=True))
    assert [pin.levels(index)[0] for index in range(6)] == [0] * 6
    covered = EncoderPin(IDEAL._replace(covered=frozenset({0})), falling, Random(1))
    assert [covered.levels(index)[0] for index in range(6)] == [0, 0, 0, 1, 0, 1]
    missing = EncoderPin(IDEAL._replace(missed=1.0), falling, Random(1))
    for index in range(1, 6):
        missing.record(index, index, True)
    assert {missing.levels(index)[0] for index in range(6)} == {1 if falling else 0}
