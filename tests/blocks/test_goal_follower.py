"""Goals on an ideal robot, and the ends of a goal that is not reached."""

from math import cos, pi, radians, sin
from typing import get_args

import pytest

from diffbotctl.blocks.goal_follower import GoalFollower
from diffbotctl.estimation.geometry_deviation import GEOMETRY
from diffbotctl.log import Logbook
from diffbotctl.messages import GOAL_EXIT_CODES, Encoders, Goal, GoalEnd, Odometry, Stop

MS = 1_000_000
STEP = 20 * MS  # ns between two poses
NONE = (0.0,) * 6
ROBOT = {
    "patience": 3.0,
    "speed": 0.3,
    "turn_rate": 4.0,
    "acceleration": 1.0,
    "braking": 1.5,
    "track": 0.125,
    "wheelbase": None,
    "lag": 0.02,
    "left_diameter": 0.065,
    "right_diameter": 0.065,
    "left_counts": 20,
    "right_counts": 20,
    "left_channels": 1,
    "right_channels": 1,
    "left_rated": 10.5,
    "right_rated": 10.5,
    "command_delay": 0.0,
}


class Course:
    """An ideal robot at 50 Hz: it moves as the last twist commands. Keeps twists and states."""

    def __init__(self, moves=True, calibrated=GEOMETRY, **values):
        self.block = GoalFollower(**{**ROBOT, **values}, calibration=dict.fromkeys(calibrated))
        self.block.reset()
        self.moves = moves
        self.covariance, self.warning, self.geometry_sd = NONE, "", 0.0
        self.geometry_heading_sd = self.pushed_heading_sd = 0.0
        self.now = 0
        self.coast_time = 0.0  # s
        self.x = self.y = self.heading = self.linear = self.angular = 0.0
        self.twists, self.states, self.causes = [], [], []

    def step(self, goal, stop=None):
        self.now += STEP
        if self.moves and not (stop and stop.code and self.linear > 0.0):
            self.heading += self.angular * STEP * 1e-9
            self.x += self.linear * cos(self.heading) * STEP * 1e-9
            self.y += self.linear * sin(self.heading) * STEP * 1e-9
        speeds = (self.linear, self.angular) if self.moves else (0.0, 0.0)
        pose = Odometry(
            self.now,
            self.x,
            self.y,
            self.heading,
            *speeds,
            self.covariance,
            self.warning,
            self.geometry_sd,
            self.geometry_heading_sd,
            coast_time=self.coast_time,
            pushed_heading_sd=self.pushed_heading_sd,
        )
        twist, state = self.block.react(self.now, pose, goal, None, stop)
        self.linear, self.angular = twist.linear, twist.angular
        self.twists.append(twist)
        if state is not None:
            self.states.append(state.state)
            self.causes.append(state.cause)
        return self

    def drive(self, goal, seconds=30.0, stop=None):
        until = self.now + int(seconds * 1e9)
        ends = GOAL_EXIT_CODES
        start = len(self.states)
        while self.now < until and not any(end in self.states[start:] for end in ends):
            self.step(goal, stop)
        return self.states[-1]

    def drive_seconds(self, goal):
        """How long a goal takes."""
        start = self.now
        assert self.drive(goal) == "reached"
        return (self.now - start) * 1e-9


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
    course = Course(left_channels=2, right_channels=2)
    for _ in range(5):
        course.step(goal(cos(radians(bearing)), sin(radians(bearing))))
    assert course.linear == pytest.approx(0.0, abs=0.02)
    assert course.angular * sign > 0.0


@pytest.mark.parametrize("bearing, inner", [(30, 0), (-30, 1), (170, 0), (-170, 1)])
def test_with_one_channel_it_turns_about_the_inner_wheel_and_drives_on(bearing, inner):
    # No wheel goes backwards, and the robot does not stop between turn and drive.
    course = Course()
    there = goal(cos(radians(bearing)), sin(radians(bearing)))
    course.step(there)
    while "driving" not in course.states:
        course.step(there)
        wheels = course.linear - 0.0625 * course.angular, course.linear + 0.0625 * course.angular
        assert wheels[inner] == pytest.approx(0.0, abs=1e-9) or course.states[-1] == "driving"
        assert wheels[1 - inner] > 0.0
    assert course.linear > 0.1  # m/s
    assert course.drive(there) == "reached"


@pytest.mark.parametrize(
    "values, distance",
    [
        ({}, 0.24),  # m; four times half the track is 0.25 m
        ({"track": 0.31}, 1.0),  # half of it is more than 0.15 m
        ({"wheelbase": 0.12}, 1.0),  # four wheels
        ({"left_channels": 2, "right_channels": 2}, 1.0),
        ({"left_channels": 0, "right_channels": 0}, 1.0),  # no encoders
    ],
)
def test_else_it_turns_on_the_spot(values, distance):
    course = Course(**values)
    for _ in range(5):
        course.step(goal(0.0, distance))
    assert course.linear == pytest.approx(0.0, abs=0.02) and course.angular > 0.5


def test_after_a_wheel_was_dragged_along_it_turns_on_the_spot():
    course = Course()
    course.pushed_heading_sd = 0.1
    for _ in range(5):
        course.step(goal(0.0, 1.0))
    assert course.linear == pytest.approx(0.0, abs=0.02) and course.angular > 0.5


@pytest.mark.parametrize("left", [1.5, 1.8, 2.5, 4.0])
@pytest.mark.parametrize("lag", [0.1, 0.2, 0.3, 0.5])
def test_a_small_turn_ends_with_slow_motors(lag, left):
    # A quarter of a lag of 0.3 s at 3.5 cm/s is 2.6 mm at the rim, 6.25 cm from the middle: 2.4
    # degrees, more than the tolerance. The turn is driven all the same.
    course = Course(lag=lag).step(None)
    assert course.drive(goal(0.0, 0.0, left), 3.0) == "reached"


def test_backwards_only_when_allowed():
    behind = goal(-0.5, 0.0, 0)
    forwards, either = Course(), Course(reverse=True)
    assert forwards.drive(behind) == either.drive(behind) == "reached"
    assert min(t.linear for t in forwards.twists) > -0.1, "a short correction, no drive backwards"
    assert min(t.linear for t in either.twists) < -0.2
    assert max(abs(t.angular) for t in either.twists) < 1.0, "no turn was needed"
    assert len(either.twists) < len(forwards.twists)


class SlidingCourse(Course):
    """A robot that slides on by `way` m when it is released on its first drive."""

    def __init__(self, way, **values):
        super().__init__(**values)
        self.way = way

    def step(self, goal, stop=None):
        before = self.linear
        super().step(goal, stop)
        if before > 0.0 and self.linear == 0.0 and self.states[-1] == "driving":
            self.x, self.way = self.x + self.way, 0.0
        return self


@pytest.mark.parametrize("heading", [0, 90, None])
@pytest.mark.parametrize("way", [0.015, 0.03, 0.08])  # m
def test_a_way_too_far_is_backed_up_over(way, heading):
    course = SlidingCourse(way, left_channels=2, right_channels=2)
    assert course.drive(goal(0.5, 0.0, heading)) == "reached"
    assert abs(course.x - 0.5) < 0.01
    assert sum(abs(t.angular) * 0.02 for t in course.twists) < radians((heading or 0) + 10)
    seconds = course.now * 1e-9
    assert seconds < Course().drive_seconds(goal(0.5, 0.0, heading)) + 3.0


def test_it_does_not_back_up_over_ground_that_it_has_not_driven_over():
    course = Course(left_channels=2, right_channels=2)
    assert course.drive(goal(-0.04, 0.0)) == "reached"
    assert max(abs(course.heading), 0.0) > radians(150)


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


@pytest.mark.parametrize("in_force", [0.0, 2.0])
def test_commands_that_are_lost_on_the_link_are_reported(in_force):
    """Telemetry shows the command that the board carries out; 0: none of ours."""
    block, causes = Course().block, []
    for frame in range(1, 250):
        time = frame * STEP
        pose = Odometry(time, 0.0, 0.0, 0.0, 0.0, 0.0, NONE)
        telemetry = Encoders(time, 0, 0, None, None, in_force, in_force, "wheels")
        new_goal = goal(1.0, 0.0) if frame == 1 else None
        _, state = block.react(time, pose, new_goal, telemetry, None)
        causes += [state.cause] if state is not None and state.state == "stuck" else []
    assert causes
    assert ("no command in force" in causes[0]) == (in_force == 0.0)


def test_a_goal_that_is_missed_in_every_attempt_is_given_up():
    course = Course(tolerance=1e-6, attempts=2)
    assert course.drive(goal(0.3, 0.2)) == "given_up"


class JitteryCourse(Course):
    """A robot whose pose, at rest, is never nearer to the goal than `away` m ahead of it."""

    def __init__(self, away, **values):
        super().__init__(**values)
        self.away = away

    def step(self, goal, stop=None):
        if self.linear == self.angular == 0.0 and abs(goal.x - self.x) < self.away:
            self.x = goal.x + self.away
        return super().step(goal, stop)


def test_the_time_limit_is_reported_with_the_remainder():
    course = JitteryCourse(0.05)
    course.block.attempts = 1000
    assert course.drive(goal(0.5, 0.0, 0.0), 60.0) == "given_up"
    assert "time limit of 4" in course.causes[-1] and " s exceeded, " in course.causes[-1]
    assert " mm and " in course.causes[-1] and " in attempt " in course.causes[-1]


@pytest.mark.parametrize(
    ("sd", "end"), [(0.05, "reached_unsure"), (0.03, "given_up"), (0.005, "given_up")]
)
def test_late_a_goal_need_not_be_nearer_than_the_pose_is_known(sd, end):
    """The robot is never nearer than 40 mm, and does not try for ever to follow such a pose."""
    course = JitteryCourse(0.04, attempts=50)
    course.covariance = (sd * sd, 0.0, 0.0, sd * sd, 0.0, radians(8.0) ** 2)
    assert course.drive(goal(1.0, 0.0, 0.0), 90.0) == end
    assert course.now > 11e9, "it tries in the first third of the time limit"
    if end == "reached_unsure":
        assert course.causes[-1].startswith("no nearer than 4")


class StickingCourse(Course):
    """A robot whose wheels stand at speeds below `hold` (m/s), and count when they turn."""

    def __init__(self, hold, **values):
        super().__init__(left_counts=2000, right_counts=2000, **values)
        self.hold = hold

    def step(self, goal, stop=None):
        if abs(self.linear) + abs(self.angular) * 0.0625 < self.hold:
            self.linear = self.angular = 0.0
        return super().step(goal, stop)


@pytest.mark.parametrize("hold", [0.04, 0.06, 0.1])
@pytest.mark.parametrize("x, heading", [(0.0, 5.0), (0.03, 0.0), (0.5, -60.0)])
def test_wheels_that_stick_at_low_speeds_reach_the_goal(hold, x, heading):
    course = StickingCourse(hold)
    assert course.drive(goal(x, 0.0, heading), 20.0) == "reached"


class LateCourse(Course):
    """A robot that moves when it has been driven for `kick` s; odometry takes it for moving."""

    def __init__(self, kick, **values):
        super().__init__(**values)
        self.kick, self.driven = kick, 0.0

    def step(self, goal, stop=None):
        self.driven = self.driven + 0.02 if self.linear or self.angular else 0.0
        before = self.x, self.y, self.heading
        super().step(goal, stop)
        if self.driven < self.kick:
            self.x, self.y, self.heading = before
        return self


@pytest.mark.parametrize("angle", [2.0, 2.2, 2.5, 4.0])
@pytest.mark.parametrize("kick", [0.1, 0.3, 0.6])
def test_a_small_turn_of_motors_that_start_late_is_driven(kick, angle):
    course = LateCourse(kick)
    assert course.drive(goal(0.0, 0.0, angle), 20.0) == "reached"


def test_a_long_wait_at_an_obstacle_ends_as_blocked():
    course = Course()
    for _ in range(50):
        course.step(goal(1.0, 0.0))
    wall = Stop(course.now, "obstacle", "something stands 5 cm ahead", False)
    start = course.now
    assert course.drive(goal(1.0, 0.0), stop=wall) != "reached"
    assert course.states[-1] == "blocked"
    assert 2.5e9 < course.now - start < 5e9  # `patience` is 3 s


@pytest.mark.parametrize(
    "stop",
    [
        ("reconnect", "the board came back", True),
        ("source_starting", "source lidar (/dev/ttyUSB1) starts", False),
    ],
)
def test_such_a_stop_suspends_the_goal(stop):
    course, there = Course(), goal(0.5, 0.0)
    for _ in range(30):
        course.step(there)
    held = Stop(course.now, *stop)
    for _ in range(400):  # its patience is 3 s
        course.step(there, held)
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
    new = goal(0.5, 0.0, number=2)
    course.step(new)  # the end of the first goal is published
    assert course.drive(new) == "reached"


def last_state(course, goal):
    """The message of one more step."""
    course.now += STEP
    pose = Odometry(course.now, course.x, course.y, course.heading, 0.0, 0.0, NONE)
    return course.block.react(course.now, pose, goal, None, None)[1]


@pytest.mark.parametrize("is_withdrawn_first", [False, True])
def test_a_goal_that_another_replaces_is_cancelled(is_withdrawn_first):
    course = Course()
    course.drive(goal(1.0, 0.0), seconds=1.0)
    if is_withdrawn_first:  # as `drive` does
        assert last_state(course, Goal(0, 0)) is None
    state = last_state(course, goal(0.0, 1.0, number=2))
    assert (state.number, state.state, state.cause) == (1, "cancelled", "replaced by goal 2")
    assert state.distance == pytest.approx(1.0 - course.x)
    assert course.drive(goal(0.0, 1.0, number=2)) == "reached"
    assert course.states.count("cancelled") == 0, "reported once"


def test_a_goal_that_continues_after_manual_driving_is_not_cancelled():
    course = Course()
    whole = goal(1.0, 0.0)
    course.drive(whole, seconds=1.0)
    course.step(Goal(0, 0))
    assert course.drive(whole._replace(time=1)) == "reached"
    assert "cancelled" not in course.states


class WeakCourse(Course):
    """A robot whose left motor reaches `reach` m/s, and follows with the lag of 0.1 s."""

    def __init__(self, reach, **values):
        super().__init__(lag=0.1, **values)
        self.reach = reach
        self.wheels = [0.0, 0.0]

    def step(self, goal, stop=None):
        aside = self.angular * 0.0625
        commands = (self.linear - aside, self.linear + aside)
        for side, (command, limit) in enumerate(zip(commands, (self.reach, 9.9), strict=True)):
            settled = min(max(command, -limit), limit)
            self.wheels[side] += (settled - self.wheels[side]) * 0.18
        left, right = self.wheels
        self.linear, self.angular = 0.5 * (left + right), (right - left) / 0.125
        return super().step(goal, stop)

    def speeds(self):
        return self.linear, self.angular


@pytest.mark.parametrize("reach", [0.05, 0.1, 0.15, 0.2])
@pytest.mark.parametrize("x, y", [(1.0, 0.0), (0.5, -0.8), (-1.0, 0.6)])
def test_a_weak_wheel_slows_down_the_other_one(reach, x, y):
    course, farthest = WeakCourse(reach), 0.0
    start = Goal(0, 1, x, y, 0.0)
    for _ in range(6000):
        course.step(start)
        away = ((course.x - x) ** 2 + (course.y - y) ** 2) ** 0.5
        farthest = max(farthest, away - (x * x + y * y) ** 0.5)
        if course.states[-1] in GOAL_EXIT_CODES:
            break
    assert course.states[-1] == "reached"
    assert farthest < 0.0625  # m, half the track: it turns about a wheel at first


@pytest.mark.parametrize(
    "linear, angular, word",
    [
        (-1, -1, "against its commands"),  # motors exchanged and reversed: every deviation grows
        (-1, 1, "moves away"),  # exchanged and reversed leads: it turns well, and drives backwards
        (1, -1, "against its commands"),  # exchanged motors
    ],
)
def test_a_robot_that_does_the_opposite_is_stopped(linear, angular, word):
    course, there = Course(), goal(1.0, 0.3)
    course.step(there)
    for _ in range(500):
        course.linear, course.angular = linear * course.linear, angular * course.angular
        course.step(there)
        if course.states[-1] == "given_up":
            break
    assert course.states[-1] == "given_up"
    assert word in course.causes[-1]
    assert (course.x**2 + course.y**2) ** 0.5 < 0.2


@pytest.mark.parametrize(
    "sd, warning, end",
    [
        (0.009, "", "reached"),
        (0.025, "", "reached"),  # dead reckoning is rarely as good as the tolerance of 10 mm
        (0.035, "", "reached_unsure"),
        (0.009, "1 % of the edges are missing", "reached"),
        (0.025, "1 % of the edges are missing", "reached_unsure"),
    ],
)
def test_a_pose_that_is_known_too_badly_reaches_a_goal_unsurely(sd, warning, end):
    course = Course()
    course.covariance, course.warning = (sd * sd, 0.0, 0.0, 1e-6, 0.0, 0.0), warning
    assert course.drive(goal(0.3, 0.0, 0.0)) == end
    if end == "reached_unsure":
        assert f"{sd * 1000:.0f} mm" in course.causes[-1] and warning in course.causes[-1]


def test_a_very_uncertain_position_is_printed_in_metres():
    course = Course()
    course.covariance = (1.96, 0.0, 0.0, 1e-6, 0.0, 0.0)
    assert course.drive(goal(1.5, 0.0, 0.0)) == "reached_unsure"
    assert "the position is known to 1.4 m (standard deviation)" in course.causes[-1]


@pytest.mark.parametrize(
    ("sd", "end"), [(0.45, "reached_unsure"), (0.55, "given_up"), (88.9, "given_up")]
)
def test_a_pose_that_is_known_less_well_than_the_goal_was_far_reaches_nothing(sd, end):
    course = Course()
    course.covariance, course.warning = (0.0, 0.0, 0.0, sd * sd, 0.0, 0.0), "its clock is fast"
    assert course.drive(goal(0.5, 0.0, 0.0)) == end
    assert course.causes[-1].endswith("its clock is fast")
    assert (f"not known where the robot is: to {sd:.1f} m" in course.causes[-1]) == (
        end == "given_up"
    )


@pytest.mark.parametrize(("degrees_known", "is_lost"), [(55.0, False), (65.0, True)])
def test_a_robot_that_was_pushed_and_does_not_know_which_way_it_faces_does_not_drive(
    degrees_known, is_lost
):
    course = Course()
    course.pushed_heading_sd, course.warning = degrees_known * pi / 180, "pushed"
    end = course.drive(goal(1.0, 0.0, 0.0))
    assert (end == "given_up") is is_lost
    if is_lost:
        assert course.causes[-1].endswith("faces: to 65 deg (standard deviation): pushed")
        assert abs(course.x) < 0.01


@pytest.mark.parametrize(
    "calibrated, sd, end",
    [
        (GEOMETRY, 0.1, "reached_unsure"),
        (("drive.track",), 0.1, "reached"),  # sqrt(0.1^2 - 0.098^2) = 20 mm
        (("drive.track",), 0.104, "reached_unsure"),  # 35 mm
    ],
)
def test_the_geometry_of_a_robot_that_is_not_calibrated_does_not_make_it_unsure(
    calibrated, sd, end
):
    course = Course(calibrated=calibrated)
    course.covariance, course.geometry_sd = (0.0, 0.0, 0.0, sd * sd, 0.0, 0.0), 0.098
    assert course.drive(goal(0.3, 0.0, 0.0)) == end


@pytest.mark.parametrize(
    ("sd", "geometry", "warning", "end"),
    [
        (5.9, 0.0, "", "reached"),  # deg; three times the tolerance
        (6.1, 0.0, "", "reached_unsure"),
        (9.0, 8.0, "", "reached"),  # sqrt(9^2 - 8^2) = 4.1
        (9.0, 6.0, "", "reached_unsure"),  # 6.7
        (2.1, 0.0, "1 % of the edges are missing", "reached_unsure"),
    ],
)
def test_the_heading_of_a_goal_is_judged_as_its_position_is(sd, geometry, warning, end):
    course = Course(calibrated=("drive.track",))
    course.covariance, course.warning = (*NONE[:5], radians(sd) ** 2), warning
    course.geometry_heading_sd = radians(geometry)
    assert course.drive(goal(0.0, 0.0, -170.0)) == end
    assert ("the heading is known to" in course.causes[-1]) == (end == "reached_unsure")
    assert course.drive(goal(0.3, 0.0, None, number=2)) == "reached", "it asks for no heading"


@pytest.mark.parametrize(
    ("calibrated", "end"), [((), "reached_unsure"), (("drive.track",), "reached")]
)
def test_the_turns_of_four_wheels_are_sure_when_their_track_is_calibrated(calibrated, end):
    course = Course(calibrated=calibrated, wheelbase=0.1)
    course.covariance, course.geometry_heading_sd = (*NONE[:5], radians(8.0) ** 2), radians(8.0)
    assert course.drive(goal(0.0, 0.0, 45.0)) == end
    assert ("calibrate spin" in course.causes[-1]) == (end == "reached_unsure")


def test_one_wheel_that_does_not_turn_is_named():
    course, there = WeakCourse(reach=0.0), goal(1.0, 0.0)
    for _ in range(300):
        course.step(there)
        if course.states[-1] in GOAL_EXIT_CODES:
            break
    assert course.states[-1] == "stuck"
    assert "the left wheel has not turned" in course.causes[-1]
    assert course.now < 4e9


def test_a_weak_wheel_is_reported_with_its_figure():
    course = WeakCourse(reach=0.1)
    book = Logbook()
    course.block.log = book.source_log("follower")
    assert course.drive(goal(1.0, 0.0), 60.0) == "reached"
    assert any("the left wheel reaches 0.10 m/s" in text for _, _, text in book.lines)
    assert not any("right" in text.split(":")[0] for _, _, text in book.lines)


class HeavyCourse(Course):
    """A heavy robot: the loops of its wheels swing around their targets with 4 rad/s, damped by
    0.4, after a delay of one frame, and the changes of the targets are limited."""

    def __init__(self, coast_time):
        super().__init__(
            speed=0.25, track=0.3, lag=0.1, acceleration=0.25, braking=0.25, command_delay=0.04
        )
        self.coast_time = coast_time
        self.speeds, self.rates = [0.0, 0.0], [0.0, 0.0]
        self.headings = []

    def step(self, goal, stop=None):
        _, *targets = list(self.block.sent)[-2:][0]
        for axis, target in enumerate(targets):
            swing = 4.0**2 * (target - self.speeds[axis]) - 2 * 0.4 * 4.0 * self.rates[axis]
            self.rates[axis] += swing * STEP * 1e-9
            self.speeds[axis] += self.rates[axis] * STEP * 1e-9
        self.linear, self.angular = self.speeds
        self.headings.append(self.heading)
        return super().step(goal, stop)


@pytest.mark.parametrize("coast_time", [0.1, 0.25])
def test_a_heavy_robot_does_not_weave(coast_time):
    """It turns on after its commands: steered by its heading alone, it swung by 25 degrees."""
    course = HeavyCourse(coast_time)
    course.heading = radians(14)  # on to the drive without a turn
    assert course.drive(goal(3.0, 0.0), 60.0) == "reached"
    driving = course.states.count("driving")
    way = course.headings[driving // 3 : 2 * driving // 3]
    assert max(map(abs, way)) < radians(2)


def test_what_is_counted_between_two_goals_is_not_compared():
    block, states = Course().block, []
    for frame in range(1, 200):
        time, first, second = frame * STEP, frame == 1, frame == 150
        pose = Odometry(time, 0.0, 0.0, 0.0, 0.0, 0.0, NONE)
        new_goal = goal(1.0, 0.0) if first else goal(1.0, 0.0, number=2) if second else None
        if frame == 2:
            new_goal = Goal(0, 0)  # withdrawn, to drive by hand
        counts = min(max(frame - 2, 0), 148) * 5
        _, state = block.react(time, pose, new_goal, Encoders(time, counts, counts), None)
        states += [state] if state is not None else []
    assert states and "given_up" not in {state.state for state in states}


class SwingingCourse(Course):
    """A robot whose right wheel makes `share` of its commands: each turn swings it around."""

    def __init__(self, share):
        super().__init__()
        self.share = share

    def step(self, goal, stop=None):
        aside = self.angular * 0.0625
        left, right = self.linear - aside, self.share * (self.linear + aside)
        self.linear, self.angular = 0.5 * (left + right), (right - left) / 0.125
        return super().step(goal, stop)


@pytest.mark.parametrize("share", [0.2, 0.3, 0.4])
@pytest.mark.parametrize("x, y", [(0.0, 0.05), (0.05, 0.03), (-0.03, 0.0)])
def test_a_robot_that_swings_around_a_near_goal_does_not_turn_for_ever(share, x, y):
    """Its bearing to the goal turns with it: so followed, it turned ten times and more."""
    course = SwingingCourse(share)
    course.drive(goal(x, y, 1.0), 60.0)
    assert abs(course.heading) < 2.5 * pi
    assert course.now < 40e9
    assert course.states[-1] == "reached" or "right wheel reaches" in course.causes[-1]


def test_slow_motors_creep_slowly():
    course = Course()
    # 10.5 rad/s * 0.0325 m, and 20 slots of 10.2 mm: the encoder must count four times a second.
    assert course.block.least_speed == 0.035
    slow = {"left_counts": 2000, "right_counts": 2000, "left_rated": 5.0, "right_rated": 5.0}
    fine = Course(speed=0.1, lag=0.1, **slow).block
    assert fine.least_speed == pytest.approx(0.1 * 5.0 * 0.0325)
    fast = Course(creep=0.02)
    assert fast.block.least_speed == 0.02
