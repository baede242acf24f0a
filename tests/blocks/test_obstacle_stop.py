"""Obstacle stop: how fast it may go, what stops it, and how it lets go."""

from math import inf

import pytest
from hypothesis import given
from hypothesis import strategies as st

from diffbotctl.blocks.obstacle_stop import (
    ObstacleStop,
    allowed,
    reaction_time,
    slowed,
    stopping_distance,
)
from diffbotctl.config.load import load
from diffbotctl.messages import Range, Resume, Twist

BRAKING = 1.5  # m/s2
# The sensor's 25.2 ms, two frames at 40 Hz, 15 ms to the motor, 100 ms of its lag.
REACTION = 0.0252 + 0.050 + 0.015 + 0.100
# Stops within 50 mm and what 0.05 m/s takes: 0.05^2 / 3 m + 0.05 x 0.1902 m are 10.3 mm.
NEAR, FAR = 0.060, 0.081  # m; just within that, and just beyond its 20 mm more for letting go
AHEAD = Twist(0, 0.3, 0.6)


def guard(**changes):
    sensors = load("goal", None, []).nominal.sensors  # `front`, flush with the robot's front
    known = {
        "braking": BRAKING, "telemetry": 40.0, "command_delay": 0.015, "lag": 0.1,
        "front": 0.08, "sensors": sensors,
    }  # fmt: skip
    return ObstacleStop(**{**known, **changes})


class Driven:
    """Hands a guard one reading after the other, 25 ms apart."""

    def __init__(self, **changes):
        self.block, self.now, self.consent = guard(**changes), 0, None

    def sees(self, distance=0.0, state="measured", twist=AHEAD):
        self.now += 25_000_000
        return self.block.react(self.now, twist, Range(self.now, distance, state), self.consent)

    def codes(self, *distances):
        """The codes of all Stops that came."""
        return [stop.code for d in distances if (stop := self.sees(d)[1]) is not None]


def test_reaction_time():
    assert reaction_time(40.0, 2, 0.015, 0.1) == pytest.approx(REACTION)


@pytest.mark.parametrize(
    "speed, distance",
    [(0.0, 0.0), (0.3, 0.09 / 3 + 0.3 * REACTION), (0.15, 0.0225 / 3 + 0.15 * REACTION)],
)
def test_stopping_distance_and_its_inverse(speed, distance):
    assert stopping_distance(speed, BRAKING, REACTION) == pytest.approx(distance)
    assert allowed(distance, BRAKING, REACTION) == pytest.approx(speed)


@given(st.floats(0.0, 2.0), st.floats(0.1, 5.0), st.floats(0.0, 1.0))
def test_what_is_allowed_stops_in_time(free, braking, reaction):
    speed = allowed(free, braking, reaction)
    assert speed >= 0.0
    assert stopping_distance(speed, braking, reaction) == pytest.approx(free, abs=1e-9)


def test_no_room_no_speed_and_no_end_no_limit():
    assert allowed(-0.01, BRAKING, REACTION) == 0.0
    assert allowed(inf, BRAKING, REACTION) == inf


@pytest.mark.parametrize(
    "linear, angular, limit, out",
    [(0.3, 1.0, 0.15, (0.15, 0.5)), (0.1, 1.0, 0.15, (0.1, 1.0)), (0.3, 1.0, 0.0, (0.0, 0.0))],
)
def test_slowed_on_the_same_curve(linear, angular, limit, out):
    assert slowed(Twist(1, linear, angular), limit, 5) == Twist(5, *map(pytest.approx, out))


def test_a_clear_way_changes_nothing():
    assert Driven().sees(0.3, "clear") == (AHEAD._replace(time=25_000_000), None)


def test_it_slows_down_before_an_obstacle():
    driven = Driven()
    # 0.15 m/s needs 0.0225 / 3 + 0.15 x 0.1902 = 36.03 mm, and 50 mm are left as margin.
    twist, stop = driven.sees(0.05 + 0.03603)
    assert stop is None
    assert twist[1:] == pytest.approx((0.15, 0.30), abs=1e-4)


def test_a_sensor_behind_the_front_sees_the_front_first():
    # The front is 30 mm before the sensor: 86 mm + 30 mm of reading allow the same 0.15 m/s.
    twist, _ = Driven(front=0.11).sees(0.05 + 0.03603 + 0.03)
    assert twist.linear == pytest.approx(0.15, abs=1e-4)


def test_two_near_readings_stop_it_and_two_far_ones_let_it_go():
    driven = Driven()
    assert driven.codes(NEAR) == []
    twist, stop = driven.sees(NEAR)
    assert stop.code == "obstacle" and not stop.latched and "6 cm ahead" in stop.cause
    assert (twist.linear, twist.angular) == (0.0, 0.6)  # turning away stays possible
    # 7 cm would not have stopped it, but is not enough to let it go.
    assert driven.codes(0.07, 0.07, 0.07, FAR) == []
    assert driven.codes(FAR) == [""]
    assert driven.sees(FAR)[0].linear > 0.05


def test_one_near_reading_between_far_ones_does_not_stop_it():
    assert Driven().codes(NEAR, FAR, NEAR, FAR, NEAR) == []


def test_the_same_reading_seen_twice_counts_once():
    block, reading = guard(), Range(5, NEAR, "measured")
    assert [block.react(now, AHEAD, reading, None)[1] for now in (5, 6, 7)] == [None] * 3


@pytest.mark.parametrize("state, code", [("too_close", "too_close"), ("fault", "range_fault")])
def test_a_sensor_in_trouble_stops_at_once(state, code):
    twist, stop = Driven().sees(0.0, state)
    assert stop.code == code and twist.linear == 0.0


def test_no_fresh_distance_stops_at_once_and_one_lets_go():
    block = guard()
    twist, stop = block.react(1, AHEAD, None, None)
    assert stop.code == "range_stale" and twist.linear == 0.0
    twist, stop = block.react(2, AHEAD, Range(2, 0.3, "clear"), None)
    assert stop.code == "" and twist.linear == AHEAD.linear


@pytest.mark.parametrize("away", [Twist(0, -0.2, 0.0), Twist(0, 0.0, 2.0)])
def test_backing_away_and_turning_are_never_held(away):
    driven = Driven()
    driven.codes(NEAR, NEAR)
    twist, _ = driven.sees(NEAR, twist=away)
    assert twist[1:] == away[1:]


def test_when_told_to_wait_only_resume_lets_it_go_and_only_once_the_way_is_clear():
    driven = Driven(resume_by="wait")
    driven.sees(NEAR)
    assert driven.sees(NEAR)[1].latched
    driven.consent = Resume(driven.now)
    assert driven.sees(NEAR)[0].linear == 0.0  # consent while it still stands there counts nothing
    assert driven.codes(0.3, 0.3, 0.3) == []
    assert driven.sees(0.3)[0].linear == 0.0
    driven.consent = Resume(driven.now)
    twist, stop = driven.sees(0.3)
    assert stop.code == "" and twist.linear > 0.0


def test_no_twist_nothing_moves():
    assert guard().react(1, None, Range(1, 0.3, "clear"), None) == (None, None)
