"""Obstacle stop: safe speeds, uncertain readings, and motions that stay allowed."""

from math import inf, pi

import pytest
from hypothesis import given
from hypothesis import strategies as st

from diffbotctl.blocks.obstacle_stop import (
    FAULT,
    STALE,
    TOO_CLOSE,
    ObstacleStop,
    guard_reaction,
    limit_to,
    max_safe_speed,
    stopping_distance,
)
from diffbotctl.config.load import load_robot
from diffbotctl.config.robot import MountSection, SensorSection
from diffbotctl.messages import Range, Resume, Twist
from diffbotctl.time import MILLISECOND as MS

FORWARD = (0.3, 0.6)  # m/s, rad/s


def guard(setback=0.0, heading=0.0, **values):
    """A guard with its sensor `setback` m behind the front of the robot, looking `heading` (rad)
    aside; braking 1.5 m/s2."""
    at = MountSection(x=0.08 - setback, heading=heading)
    sensor = SensorSection(type="sharp_gp2y0a41sk0f", pin="A0", at=at)
    return ObstacleStop(
        **{"margin": 0.05, "reaction": 0.2, **values},
        braking=1.5,
        telemetry=40.0,
        command_delay=0.015,
        lag=0.1,
        front=0.08,
        track=0.125,
        sensors={"front": sensor},
    )


class Course:
    """Gives a guard one range and one twist every 25 ms; keeps the last output."""

    def __init__(self, block):
        self.block = block
        self.now = 0
        self.stops = []

    def see(self, state, distance=0.0, velocity=FORWARD, resume=None):
        self.now += 25 * MS
        seen = None if state is None else Range(self.now, distance, state)
        return self._react(seen, velocity, resume)

    def _react(self, seen, velocity, resume):
        twist, stop = self.block.react(self.now, Twist(self.now, *velocity), seen, resume)
        if stop is not None:
            self.stops.append((stop.code, stop.latched))
        return twist.linear, twist.angular


# By hand, braking 1.5 m/s2 and 0.2 s to react.
@pytest.mark.parametrize(
    "speed, distance",
    [
        (0.0, 0.0),
        (0.3, 0.09),  # 0.3^2 / 3 + 0.3 * 0.2 = 0.03 + 0.06
        (0.6, 0.24),  # 0.12 + 0.12
    ],
)
def test_stopping_distance(speed, distance):
    assert stopping_distance(speed, 1.5, 0.2) == pytest.approx(distance)
    assert max_safe_speed(distance, 1.5, 0.2) == pytest.approx(speed)


@given(st.floats(0.0, 5.0), st.floats(0.1, 10.0), st.floats(0.0, 2.0))
def test_the_safe_speed_stops_within_the_free_distance(free, braking, reaction):
    speed = max_safe_speed(free, braking, reaction)
    assert stopping_distance(speed, braking, reaction) <= free + 1e-9


@pytest.mark.parametrize("free, speed", [(-1.0, 0.0), (0.0, 0.0), (inf, inf)])
def test_safe_speed_at_the_limits(free, speed):
    assert max_safe_speed(free, 1.5, 0.2) == speed


def test_reaction_of_a_sharp_sensor():
    sensors = load_robot("book_2wd").robot.sensors
    # the sensor's 25.2 ms and two frames of 25 ms
    assert guard_reaction(sensors, "front", 40.0, 2) == pytest.approx(0.0752)


def test_slowing_keeps_the_curvature():
    assert limit_to(Twist(1, 0.3, 0.6), 0.1, 5) == Twist(5, 0.1, pytest.approx(0.2))
    assert limit_to(Twist(1, 0.3, 0.6), 0.4, 5) == Twist(5, 0.3, 0.6)


# gap = distance; free way = gap - 5 cm; v = 1.5 * (sqrt(0.04 + 2 free / 1.5) - 0.2)
@pytest.mark.parametrize(
    "distance, linear",
    [
        (0.30, 0.3),  # free 25 cm would allow 0.62 m/s
        (0.14, 0.3),  # free 9 cm: just the wished 0.3 m/s
        (0.10, 1.5 * ((0.04 + 0.1 / 1.5) ** 0.5 - 0.2)),  # free 5 cm: 0.19 m/s
        (0.07, 1.5 * ((0.04 + 0.04 / 1.5) ** 0.5 - 0.2)),  # free 2 cm: 0.087 m/s
    ],
)
def test_it_slows_down_near_an_obstacle(distance, linear):
    course = Course(guard())
    course.see("measured", distance)
    assert course.see("measured", distance) == pytest.approx((linear, 2 * linear))
    assert course.stops == []


def test_the_margin_is_measured_from_the_front():
    course = Course(guard(setback=0.04))
    course.see("measured", 0.18)
    assert course.see("measured", 0.18)[0] == pytest.approx(0.3)  # 14 cm before the front


def test_a_wall_is_nearer_than_along_the_beam_of_a_sensor_that_looks_aside():
    """At 60 degrees, half as far: 20 cm along the beam are a free way of 5 cm to the margin."""
    course = Course(guard(heading=-pi / 3))
    course.see("measured", 0.20)
    linear = 1.5 * ((0.04 + 0.1 / 1.5) ** 0.5 - 0.2)
    assert course.see("measured", 0.20)[0] == pytest.approx(linear)


def test_two_readings_stop_and_two_release():
    course = Course(guard())
    course.see("clear", 0.3)
    # the slowest speed, 0.05 m/s, needs 0.0008 + 0.01 m; with the margin the zone ends at 6.1 cm
    assert course.see("measured", 0.060)[0] > 0.0  # one reading may be noise; it is slow already
    assert course.see("measured", 0.060) == (0.0, 0.6)
    assert course.stops == [("obstacle", False)]
    course.see("clear", 0.3)
    assert course.see("clear", 0.3) == FORWARD
    assert course.stops == [("obstacle", False), ("", False)]


def test_hysteresis_at_the_stop_distance():
    course = Course(guard())
    for distance in (0.06, 0.06, 0.065, 0.075, 0.065, 0.075):  # released from 8.1 cm on
        out = course.see("measured", distance)
    assert out == (0.0, 0.6)
    course.see("measured", 0.085)
    assert course.see("measured", 0.085)[0] > 0.0
    assert len(course.stops) == 2


@pytest.mark.parametrize(
    "state, code",
    [("too_close", "too_close"), ("fault", "range_fault"), (None, "range_stale")],
)
def test_an_uncertain_reading_stops_immediately(state, code):
    course = Course(guard())
    course.see("clear", 0.3)
    assert course.see(state) == (0.0, 0.6)
    assert course.stops == [(code, False)]


@pytest.mark.parametrize("state", ["too_close", "fault", None])
@pytest.mark.parametrize("velocity", [(0.0, 2.0), (-0.2, 0.0), (-0.1, 0.5), (0.0, 0.0)])
def test_turning_and_driving_backwards_stay_allowed(state, velocity):
    course = Course(guard(resume_by="wait"))
    course.see("clear", 0.3)
    course.see(state)  # forward: held, latched
    assert course.see(state, velocity=velocity) == velocity


# About a wheel: half the track, 0.0625 m, times 2 rad/s, and a fifth more that counts as such.
@pytest.mark.parametrize("linear", [0.125, 0.149])
@pytest.mark.parametrize("state, code", [("too_close", TOO_CLOSE), ("fault", FAULT), (None, STALE)])
def test_a_turn_about_a_wheel_becomes_one_on_the_spot(linear, state, code):
    course = Course(guard(resume_by="wait"))
    course.see("clear", 0.3, velocity=(linear, 2.0))
    assert course.see("clear", 0.3, velocity=(linear, 2.0)) == (linear, 2.0)
    assert course.see(state, velocity=(linear, 2.0)) == (0.0, 2.0)
    assert course.stops == []  # it can turn away from the obstacle without consent
    assert course.see(state, velocity=(0.151, 2.0)) == (0.0, 2.0)  # a curve: it is prevented
    assert [stop for stop, _ in course.stops] == [code]


def test_a_reading_that_changes_between_near_and_too_close_is_one_stop():
    course = Course(guard())
    course.see("clear", 0.3)
    for _ in range(5):
        course.see("measured", 0.045)
        course.see("measured", 0.045)
        assert course.see("too_close") == (0.0, 0.6)
    assert course.stops == [("obstacle", False)]
    course.see("fault")
    assert course.stops[1:] == [("range_fault", False)]


def test_near_an_obstacle_a_turn_about_a_wheel_is_as_fast_and_goes_less_forward():
    course = Course(guard())
    course.see("measured", 0.07, velocity=(0.125, 2.0))
    linear, angular = course.see("measured", 0.07, velocity=(0.125, 2.0))
    assert linear == pytest.approx(1.5 * ((0.04 + 0.04 / 1.5) ** 0.5 - 0.2))  # free 2 cm
    assert angular == 2.0


def test_no_stop_is_sent_before_motion_is_prevented():
    course = Course(guard())
    course.see(None, velocity=(0.0, 0.0))  # before the first reading, at rest
    assert course.stops == []


def test_it_does_not_drive_before_the_first_reading():
    assert Course(guard()).see(None) == (0.0, 0.6)


def test_after_a_stale_sensor_one_clear_reading_releases():
    course = Course(guard())
    course.see(None)
    assert course.see("clear", 0.3) == FORWARD
    assert course.stops == [("range_stale", False), ("", False)]


def test_after_a_stale_sensor_an_obstacle_does_not_release():
    course = Course(guard())
    course.see(None)
    assert course.see("measured", 0.055) == (0.0, 0.6)


def test_waiting_for_resume():
    course = Course(guard(resume_by="wait"))
    course.see("clear", 0.3)
    course.see("too_close")
    for _ in range(5):
        assert course.see("clear", 0.3) == (0.0, 0.6)
    assert course.stops == [("too_close", True)]
    assert course.see("clear", 0.3, resume=Resume(course.now)) == FORWARD
    assert course.stops[1:] == [("", False)]


def test_resume_is_ignored_while_the_obstacle_is_there():
    """Otherwise the robot would start by itself when the obstacle goes away."""
    course = Course(guard(resume_by="wait"))
    course.see("clear", 0.3)
    course.see("too_close")
    early = Resume(course.now)
    course.see("too_close", resume=early)
    course.see("clear", 0.3, resume=early)  # the engine goes on showing the last message
    assert course.see("clear", 0.3, resume=early) == (0.0, 0.6)
    assert course.see("clear", 0.3, resume=Resume(course.now)) == FORWARD


def test_a_stale_sensor_needs_no_resume():
    course = Course(guard(resume_by="wait"))
    course.see(None)
    assert course.stops == [("range_stale", False)]
    assert course.see("clear", 0.3) == FORWARD


def test_no_twist_no_output():
    twist, stop = guard().react(MS, None, Range(MS, 0.3, "clear"), None)
    assert (twist, stop) == (None, None)


def test_the_same_reading_twice_counts_once():
    block = guard()
    seen = Range(MS, 0.06, "measured")
    block.react(MS, Twist(MS, 0.05, 0.0), Range(0, 0.3, "clear"), None)
    for now in (2 * MS, 3 * MS, 4 * MS):  # new wishes, one old reading
        twist, _ = block.react(now, Twist(now, 0.05, 0.0), seen, None)
    assert twist.linear > 0.0


@given(
    st.lists(
        st.tuples(
            st.sampled_from(["clear", "measured", "too_close", "fault", None]),
            st.floats(0.0, 0.3),
            st.floats(-0.3, 0.3),
        ),
        max_size=30,
    )
)
def test_it_can_always_stop_in_time(steps):
    course = Course(guard())
    for state, distance, velocity in steps:
        linear, _ = course.see(state, distance, velocity=(velocity, 0.0))
        assert linear <= max(velocity, 0.0) or linear == velocity
        if state == "measured" and linear > 0.0:
            assert stopping_distance(linear, 1.5, 0.2) <= distance - 0.05 + 1e-9
        if state in ("too_close", "fault", None):
            assert linear <= 0.0


@pytest.mark.parametrize(
    "debounce, readings, moves",
    [
        # n: something stands 60 mm away, f: free. Moves forward after the last reading?
        (1, "n", False),
        (1, "nf", True),
        (3, "ffn", True),
        (3, "ffnn", True),
        (3, "ffnnn", False),
        (3, "ffnnfnn", True),  # the count begins anew
        (3, "ffnnnff", False),  # held until as many say that it is free
        (3, "ffnnnffnff", False),
        (3, "ffnnnfff", True),
    ],
)
def test_debouncing(debounce, readings, moves):
    course = Course(guard(debounce=debounce))
    for reading in readings:
        linear, _ = course.see("measured", 0.06 if reading == "n" else 0.3, velocity=(0.05, 0.0))
    assert (linear > 0.0) is moves
