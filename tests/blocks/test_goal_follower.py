"""Goals on an ideal robot, and the ends of a goal that is not reached."""

from math import cos, pi, radians, sin
from typing import get_args

import pytest

from diffbotctl.blocks.goal_follower import GoalFollower
from diffbotctl.messages import GOAL_EXIT_CODES, Goal, GoalEnd, Odometry, Stop

MS = 1_000_000
STEP = 20 * MS  # ns between two poses
NONE = (0.0,) * 6


class Course:
    """An ideal robot at 50 Hz: it moves as the last twist says. Keeps twists and states."""

    def __init__(self, moves=True, **values):
        self.block = GoalFollower(
            **{"patience": 3.0, "lag": 0.02, **values},
            speed=0.3,
            turn_rate=4.0,
            acceleration=1.0,
            braking=1.5,
            track=0.125,
            command_delay=0.0,
        )
        self.block.reset()
        self.moves = moves
        self.now = 0
        self.x = self.y = self.heading = self.linear = self.angular = 0.0
        self.twists, self.states = [], []

    def step(self, goal, stop=None):
        self.now += STEP
        if self.moves and not (stop and stop.code and self.linear > 0.0):
            self.heading += self.angular * STEP * 1e-9
            self.x += self.linear * cos(self.heading) * STEP * 1e-9
            self.y += self.linear * sin(self.heading) * STEP * 1e-9
        speeds = (self.linear, self.angular) if self.moves else (0.0, 0.0)
        pose = Odometry(self.now, self.x, self.y, self.heading, *speeds, NONE)
        twist, state = self.block.react(self.now, pose, goal, stop)
        self.linear, self.angular = twist.linear, twist.angular
        self.twists.append(twist)
        if state is not None:
            self.states.append(state.state)
        return self

    def drive(self, goal, seconds=30.0, stop=None):
        until = self.now + int(seconds * 1e9)
        ends = GOAL_EXIT_CODES
        start = len(self.states)
        while self.now < until and not any(end in self.states[start:] for end in ends):
            self.step(goal, stop)
        return self.states[-1]


def test_every_end_has_an_exit_code():
    assert set(GOAL_EXIT_CODES) == set(get_args(GoalEnd))
    assert [end for end, code in GOAL_EXIT_CODES.items() if code == 0] == ["reached"]


def goal(x, y, heading=None, number=1):
    return Goal(0, number, x, y, None if heading is None else radians(heading))


def turn(angle):
    return (angle + pi) % (2 * pi) - pi


@pytest.mark.parametrize(
    "x, y, heading",
    [(1.0, 0.0, 0), (1.0, 1.0, 90), (0.5, 0.5, 180), (-0.3, 0.4, -90), (0.0, 0.1, 0), (2, 1, None)],
)
@pytest.mark.parametrize("reverse", [False, True])
def test_known_goals_are_reached(x, y, heading, reverse):
    course = Course(reverse=reverse)
    assert course.drive(goal(x, y, heading)) == "reached"
    assert abs(course.x - x) < 0.01 and abs(course.y - y) < 0.01
    if heading is not None:
        assert abs(turn(course.heading - radians(heading))) < radians(2)


@pytest.mark.parametrize(
    "bearing, sign",
    [(30, 1), (-30, -1), (170, 1), (-170, -1)],  # degrees
)
def test_it_turns_in_the_shorter_direction(bearing, sign):
    course = Course()
    for _ in range(5):
        course.step(goal(cos(radians(bearing)), sin(radians(bearing))))
    assert course.linear == pytest.approx(0.0, abs=0.02)
    assert course.angular * sign > 0.0


@pytest.mark.parametrize(
    "lag, left, moves",
    [
        # A turn of less than half a step at 3.5 cm/s and a quarter of the lag is let go at once:
        # 0.35 mm + 1.75 mm at the rim, 6.25 cm from the middle, are 1.9 degrees. 2 will do.
        (0.2, 1.8, False),
        # 0.35 mm + 2.6 mm are 2.7 degrees: one step, 0.7 mm, takes 0.6 of the 2.5 away.
        (0.3, 2.5, True),
    ],
)
def test_a_turn_that_is_too_small_for_slow_motors_ends(lag, left, moves):
    course = Course(lag=lag).step(None)
    assert course.drive(goal(0.0, 0.0, left), 3.0) == "reached"
    assert any(twist.angular for twist in course.twists) is moves


def test_backwards_only_when_allowed():
    behind = goal(-0.5, 0.0, 0)
    forwards, either = Course(), Course(reverse=True)
    assert forwards.drive(behind) == either.drive(behind) == "reached"
    assert min(t.linear for t in forwards.twists) > -0.1, "a short correction, no drive backwards"
    assert min(t.linear for t in either.twists) < -0.2
    assert max(abs(t.angular) for t in either.twists) < 1.0, "no turn was needed"
    assert len(either.twists) < len(forwards.twists)


def test_several_goals_in_a_row():
    course = Course()
    for number, (x, y) in enumerate([(0.3, 0.0), (0.3, 0.3), (0.0, 0.0)], 1):
        assert course.drive(goal(x, y, number=number)) == "reached"
        assert abs(course.x - x) < 0.01 and abs(course.y - y) < 0.01


def test_a_robot_that_does_not_move_is_stuck():
    course = Course(moves=False)
    assert course.drive(goal(1.0, 0.0)) == "stuck"
    assert 1.5e9 < course.now < 4e9  # `stuck_after` is 2 s
    assert course.twists[-1][1:] == (0.0, 0.0)


def test_a_goal_that_is_missed_in_every_attempt_is_given_up():
    course = Course(tolerance=1e-6, attempts=2)
    assert course.drive(goal(0.3, 0.2)) == "given_up"


def test_a_long_wait_at_an_obstacle_ends_as_blocked():
    course = Course()
    for _ in range(50):
        course.step(goal(1.0, 0.0))
    wall = Stop(course.now, "obstacle", "something stands 5 cm ahead", False)
    start = course.now
    assert course.drive(goal(1.0, 0.0), stop=wall) != "reached"
    assert course.states[-1] == "blocked"
    assert 2.5e9 < course.now - start < 5e9  # `patience` is 3 s


def test_a_latched_stop_suspends_the_goal():
    course, there = Course(), goal(0.5, 0.0)
    for _ in range(30):
        course.step(there)
    latched = Stop(course.now, "reconnect", "the board came back", True)
    for _ in range(100):
        course.step(there, latched)
        assert (course.linear, course.angular) == (0.0, 0.0)
    assert course.drive(there, stop=Stop(course.now, "", "", False)) == "reached"


def test_without_a_goal_it_does_not_move():
    course = Course()
    for _ in range(5):
        course.step(None)
    assert {t[1:] for t in course.twists} == {(0.0, 0.0)}


def test_number_zero_withdraws_the_goal_and_the_next_one_is_followed():
    course, ahead = Course(), goal(1.0, 0.0)
    for _ in range(20):
        course.step(ahead)
    assert course.linear > 0.0
    withdrawn = Goal(course.now, 0, 0.0, 0.0)
    for _ in range(20):
        course.step(withdrawn)
        assert (course.linear, course.angular) == (0.0, 0.0)
    assert course.drive(goal(0.5, 0.0, number=2)) == "reached"
