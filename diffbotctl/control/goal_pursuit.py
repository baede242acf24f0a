"""State of the motion to one goal, and the adaptive estimate of how far the wheels coast."""

from __future__ import annotations

from math import atan2, cos, hypot, pi, sin
from typing import Literal, NamedTuple

from diffbotctl.control.motion_profile import shortest_turn
from diffbotctl.messages import Goal, Odometry

COAST_GAIN = 0.7  # of the update by one release; below 1 because the pose has errors of its own
COAST_GAIN_HALF_SPEED = 0.03  # m/s; release speed at which the gain is halved
COAST_SPEED_MIN = 0.03  # m/s; below it the innovation is mostly error of the pose
COAST_RATIO_MIN, COAST_RATIO_MAX = 0.4, 2.0  # limits of the coast time, relative to the motors' lag

Leg = Literal["turning", "driving", "aligning"]


class Coast(NamedTuple):
    """Estimate of the coast time: released wheels travel their speed times `time` (s) further."""

    time: float
    release_speed: float = 0.0
    """m/s towards the end of the leg, at the last release; 0 after it was used for an update"""
    release_turn_rate: float = 0.0
    """rad/s, at the last release of a turn"""

    def learn(self, remaining: float, lag: float) -> Coast:
        """Update by the `remaining` distance (m) of the leg at rest. `lag` of the motors in s."""
        speed = self.release_speed
        # After a slow release the error of the pose is as large as the error of the coast time.
        gain = COAST_GAIN * speed / (speed + COAST_GAIN_HALF_SPEED)
        time = self.time - gain * remaining / speed
        time = min(max(time, COAST_RATIO_MIN * lag), COAST_RATIO_MAX * lag)
        return self._replace(time=time, release_speed=0.0)


class Pursuit(NamedTuple):
    """A goal under way."""

    goal: Goal
    time_limit: float
    """s"""
    coast: Coast
    leg: Leg = "turning"
    line: float = 0.0
    """heading (rad) of the robot while it drives to the goal"""
    is_backwards: bool = False
    pivot: tuple[float, float] = (0.0, 0.0)
    """point (m) that the robot holds during a turn"""
    is_coasting: bool = False
    """released or stopped; the leg continues, or the next one begins, at rest"""
    still_since: int | None = None
    """ns"""
    needs_nudge: bool = False
    """turn at the least speed although the remaining angle is too small for it"""
    attempts: int = 0
    elapsed: float = 0.0
    """s, not counting stops"""
    blocked_for: float = 0.0
    """s"""
    idle_for: float = 0.0
    """s of being driven without moving"""

    def begin(self, odometry: Odometry, tolerance: float, may_reverse: bool) -> Pursuit:
        """Plan the legs from this pose; within `tolerance` (m) of the goal, only the last turn."""
        goal, position = self.goal, (odometry.x, odometry.y)
        state = self._replace(
            is_coasting=False, still_since=None, needs_nudge=self.attempts > 0, pivot=position
        )
        if self.distance(odometry) <= tolerance:
            return state._replace(leg="aligning", pivot=(goal.x, goal.y))
        bearing = atan2(goal.y - odometry.y, goal.x - odometry.x)
        is_backwards = may_reverse and (
            self._turns(odometry, bearing + pi) < self._turns(odometry, bearing)
        )
        return state._replace(
            leg="turning",
            line=bearing + pi if is_backwards else bearing,
            is_backwards=is_backwards,
        )

    def _turns(self, odometry: Odometry, line: float) -> float:
        """Sum of both turns (rad) when driving in the direction `line`."""
        first = abs(shortest_turn(line - odometry.heading))
        heading = self.goal.heading
        return first + (0.0 if heading is None else abs(shortest_turn(heading - line)))

    def distance(self, odometry: Odometry) -> float:
        """Metres to the goal."""
        return hypot(self.goal.x - odometry.x, self.goal.y - odometry.y)

    def along(self, odometry: Odometry) -> float:
        """Metres to the goal along `line`; negative when it is behind the robot."""
        east, north = self.goal.x - odometry.x, self.goal.y - odometry.y
        return east * cos(self.line) + north * sin(self.line)

    def heading_error(self, odometry: Odometry) -> float:
        """Radians to turn: to `line` before driving, to the heading of the goal after it."""
        target = self.line if self.leg == "turning" else self.goal.heading
        return 0.0 if target is None else shortest_turn(target - odometry.heading)

    def released(self, speed: float, turn_rate: float | None = None) -> Pursuit:
        """Coast after a release at `speed` (m/s) and, in a turn, at `turn_rate` (rad/s)."""
        coast = self.coast._replace(release_speed=speed)
        if turn_rate is not None:
            coast = coast._replace(release_turn_rate=turn_rate)
        return self._replace(is_coasting=True, coast=coast)

    def learn_coast(self, odometry: Odometry, half_track: float, lag: float) -> Pursuit:
        """Update the coast time, at rest or nearly, by the remaining distance of the leg."""
        coast = self.coast
        if coast.release_speed < COAST_SPEED_MIN:
            return self
        if self.leg == "driving":
            remaining = self.along(odometry)
            remaining = -remaining if self.is_backwards else remaining
            speed = abs(odometry.linear)
        else:
            error = self.heading_error(odometry)
            remaining = abs(error) * half_track
            remaining = remaining if error * coast.release_turn_rate > 0.0 else -remaining
            speed = abs(odometry.angular) * half_track
        return self._replace(coast=coast.learn(remaining - speed * coast.time, lag))
