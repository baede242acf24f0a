"""A spawned turtle: velocities, goals, the border of its canvas, stops."""

from math import pi

import pytest

from diffbotctl.blocks.turtle import Turtle
from diffbotctl.messages import Odometry, Stop, TurtleGoal, TurtlePlacement, Twist
from diffbotctl.time import SECOND

PERIOD = SECOND // 100  # of the frames
HELD = Stop(0, "operator_stop", "a person asked to stop", True)


class Frames:
    """A turtle that gets frame after frame."""

    def __init__(self, **values):
        self.block = Turtle(speed=2.0, turn_rate=2.0, **values)
        self.now = 0
        self.placement = None

    def place(self, number=2, x=2.0, y=3.0, heading=0.0, is_present=True):
        self.placement = TurtlePlacement(self.now + PERIOD, number, x, y, heading, is_present)
        return self.frame()

    def frame(self, twist=None, goal=None, stop=None):
        self.now += PERIOD
        seen = Odometry(self.now, 0.0, 0.0, 0.0, 0.0, 0.0, (0.0,) * 6)
        return self.block.react(self.now, self.placement, seen, twist, goal, stop)

    def frames(self, seconds, **inputs):
        for _ in range(round(seconds * SECOND / PERIOD)):
            pose = self.frame(**inputs)
        return pose


@pytest.fixture
def turtle():
    """Turtle 2 at 2, 3, facing along x."""
    frames = Frames()
    assert frames.frame() is None  # not spawned
    assert frames.place(number=3) is None  # another one
    pose = frames.place()
    assert pose[2:] == (2.0, 3.0, 0.0, 0.0, 0.0)
    return frames


def test_a_velocity_is_obeyed_exactly_on_its_arc(turtle):
    twist = Twist(0, 1.0, 0.5)
    turtle.frames(pi, twist=twist)  # a quarter of a circle with a radius of 2 m
    pose = turtle.frame(twist=twist)
    assert (pose.x, pose.y) == pytest.approx((4.0, 5.0), abs=0.02)
    assert pose.heading == pytest.approx(pi / 2, abs=0.01)
    still = turtle.frames(1.0, twist=Twist(0, 0.0, 0.0))
    assert still[2:5] == pytest.approx(pose[2:5], abs=0.02) and still.linear == 0.0


def test_a_velocity_beyond_the_limits_keeps_its_arc(turtle):
    pose = turtle.frame(twist=Twist(0, 8.0, -2.0))
    assert (pose.linear, pose.angular) == (2.0, -0.5)


def test_a_goal_is_reached_and_kept(turtle):
    goal = TurtleGoal(1, 1.0, 8.0)
    turtle.frame(goal=goal)
    pose = turtle.frames(15.0, goal=goal)
    assert (pose.x, pose.y) == pytest.approx((1.0, 8.0), abs=0.02)
    assert pose.linear == 0.0
    assert turtle.frames(1.0)[2:5] == pose[2:5]  # also when the message has expired


def test_a_velocity_ends_a_goal(turtle):
    goal = TurtleGoal(1, 9.0, 3.0)
    assert turtle.frames(0.5, goal=goal).linear > 1.0
    turtle.frame(goal=goal, twist=Twist(0, 0.1, 0.0))
    assert turtle.frames(0.1, goal=goal).linear == 0.0


def test_it_cannot_leave_the_canvas(turtle):
    assert turtle.frames(10.0, twist=Twist(0, 2.0, 0.0)).x == 11.09
    assert turtle.frames(10.0, twist=Twist(0, -2.0, 0.0)).x == 0.0


def test_a_stop_of_the_robot_holds_it_and_ends_its_goal(turtle):
    goal = TurtleGoal(1, 9.0, 3.0)
    turtle.frames(0.5, goal=goal)
    held = turtle.frames(1.0, goal=goal, stop=HELD, twist=Twist(0, 1.0, 0.0))
    assert held.linear == 0.0
    assert turtle.frames(1.0, goal=goal, stop=Stop(0, "", "", False)).x == held.x
    assert turtle.frame(twist=Twist(0, 1.0, 0.0)).linear == 1.0


def test_it_is_moved_killed_and_spawned_again(turtle):
    turtle.frames(0.5, goal=TurtleGoal(1, 9.0, 3.0))
    assert turtle.place(x=5.0, heading=1.0)[2:] == (5.0, 3.0, 1.0, 0.0, 0.0)
    assert turtle.place(is_present=False) is None
    assert turtle.frame(twist=Twist(0, 1.0, 0.0), goal=TurtleGoal(2, 1.0, 1.0)) is None
    assert turtle.place(x=20.0)[2:] == (11.09, 3.0, 0.0, 0.0, 0.0)
