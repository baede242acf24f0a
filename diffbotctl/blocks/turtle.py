"""Turtle: a spawned turtle that follows velocities and goals exactly, as in turtlesim."""

from __future__ import annotations

from math import atan2, cos, hypot, sin

from diffbotctl.block import Block, In, Out
from diffbotctl.control.motion_profile import shortest_turn
from diffbotctl.geometry.footprint import arc_motion
from diffbotctl.messages import Odometry, Stop, TurtleGoal, TurtlePlacement, TurtlePose, Twist
from diffbotctl.params import FromRobot, Param
from diffbotctl.time import SECOND

APPROACH = 1.5  # 1/s: speed for each metre that is left to the goal
TURNING = 4.0  # 1/s: turn rate for each radian between heading and goal


class Turtle(Block):
    """Move the spawned turtle that has this number.

    It obeys the velocity exactly, with the limits of the robot, and stays on the canvas. A goal is
    followed until a velocity that is not zero comes. While the robot is stopped it stands, and a
    goal is forgotten. It touches no other turtle.

    blocks:
      turtle2:
        block: turtle
        with: {number: 2}
        in:
          placement: canvas.placement
          odometry: robot.pose
          twist: input.turtle2_twist
          goal: input.turtle2_goal
    """

    number = Param(int, default=2, minimum=2, help="Number of the turtle.")
    tolerance = Param(
        float, unit="m", default=0.02, above=0.0, live=True, help="Distance that reaches the goal."
    )
    width = Param(float, unit="m", default=11.09, above=0.0, help="Width of the canvas, along x.")
    height = Param(float, unit="m", default=11.09, above=0.0, help="Height of the canvas, along y.")
    speed: float = FromRobot("limits.speed")
    turn_rate: float = FromRobot("limits.turn_rate")

    placement = In(TurtlePlacement, help="Where turtles are spawned, moved and killed.")
    odometry = In(Odometry, help="Triggers the output; its values are not used.")
    twist = In(Twist, trigger=False, optional=True, help="The desired velocity.")
    goal = In(TurtleGoal, optional=True, help="Where to go.")
    stop = In(Stop, trigger=False, optional=True, help="What stops the robot.")
    pose = Out(TurtlePose, help="Pose and velocity, while there is a turtle of this number.")

    def reset(self) -> None:
        self.at: tuple[float, float, float] | None = None  # x, y, heading
        self.target: tuple[float, float] | None = None
        self.last_goal: TurtleGoal | None = None
        self.velocity = (0.0, 0.0)  # in force since `since`
        self.since = 0

    def react(
        self,
        now: int,
        placement: TurtlePlacement | None,
        odometry: Odometry | None,
        twist: Twist | None,
        goal: TurtleGoal | None,
        stop: Stop | None,
    ) -> TurtlePose | None:
        self._move(now)
        if placement is not None and placement.number == self.number and placement.time == now:
            self._place(placement)
        if goal is not None and goal != self.last_goal:
            self.last_goal, self.target = goal, (goal.x, goal.y)
        if self.at is None:
            self.target = None
            return None
        self.velocity = self._next_velocity(self.at, twist, stop)
        return TurtlePose(now, self.number, *self.at, *self.velocity)

    def _place(self, placement: TurtlePlacement) -> None:
        self.at = self.target = None
        if placement.is_present:
            self.at = (*self._on_canvas(placement.x, placement.y), placement.heading)

    def _move(self, now: int) -> None:
        """Go on at the velocity in force, up to `now`."""
        seconds, self.since = (now - self.since) / SECOND, now
        if self.at is None:
            return
        x, y, heading = self.at
        ahead, left, turn = arc_motion(*self.velocity, seconds)
        c, s = cos(heading), sin(heading)
        place = self._on_canvas(x + c * ahead - s * left, y + s * ahead + c * left)
        self.at = (*place, shortest_turn(heading + turn))

    def _on_canvas(self, x: float, y: float) -> tuple[float, float]:
        return min(max(x, 0.0), self.width), min(max(y, 0.0), self.height)

    def _next_velocity(
        self, at: tuple[float, float, float], twist: Twist | None, stop: Stop | None
    ) -> tuple[float, float]:
        if stop is not None and stop.code:
            self.target = None
            return 0.0, 0.0
        if twist is not None and (twist.linear or twist.angular):
            self.target = None
            return self._limited(twist.linear, twist.angular)
        return (0.0, 0.0) if self.target is None else self._towards(at, *self.target)

    def _towards(self, at: tuple[float, float, float], x: float, y: float) -> tuple[float, float]:
        """The velocity towards the goal; the nearer the slower, and no faster than it faces it."""
        ahead, left = x - at[0], y - at[1]
        distance = hypot(ahead, left)
        if distance <= self.tolerance:
            self.log.info(f"turtle {self.number} has reached {x:.2f}, {y:.2f}")
            self.target = None
            return 0.0, 0.0
        turn = shortest_turn(atan2(left, ahead) - at[2])
        speed = min(APPROACH * distance, self.speed) * max(cos(turn), 0.0)
        return speed, min(max(TURNING * turn, -self.turn_rate), self.turn_rate)

    def _limited(self, linear: float, angular: float) -> tuple[float, float]:
        """The velocity within the limits that keeps the radius of the arc."""
        excess = max(abs(linear) / self.speed, abs(angular) / self.turn_rate, 1.0)
        return linear / excess, angular / excess
