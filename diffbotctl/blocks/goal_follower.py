"""Goal follower: turn to the bearing of the goal, drive to it, turn to its heading."""

from __future__ import annotations

from collections import deque
from math import atan2, copysign, cos, pi, sin
from typing import NamedTuple, assert_never

from diffbotctl.block import Block, In, Out
from diffbotctl.control.goal_pursuit import Coast, Pursuit
from diffbotctl.control.motion_profile import (
    Motion,
    MotionLimits,
    SpeedBounds,
    approach_speed,
    predict_motion,
    rest_to_rest_time,
    shortest_turn,
)
from diffbotctl.messages import Goal, GoalEnd, GoalState, Odometry, Stop, Twist
from diffbotctl.params import FromRobot, Param
from diffbotctl.time import MILLISECOND, SECOND

# Wheel speeds in m/s.
STILL_SPEED_MAX = 0.004  # m/s; at lower speeds a wheel may stand between two slots
SLOW_SPEED_MAX = 0.012  # m/s; it coasts for about a millimetre, so the next leg may begin
STILL_TIME_MIN = 60 * MILLISECOND  # at rest, after which the pose is final
BRAKING_RATIO = 0.8  # of the braking limit; the rest is a reserve for the motors
HEADING_GAIN = 4.5  # 1/s: heading error to turn rate; a third of the limit given by the motors' lag
HEADING_CORRECTION_MAX = 1.0  # rad/s, while driving
PIVOT_GAIN = 2.5  # 1/s: position error to speed while turning
PIVOT_SPEED_RATIO_MAX = 0.3  # of the wheel speed, so that no wheel reverses
BEARING_DISTANCE_MIN = 0.06  # m to the goal; closer, the bearing is dominated by noise
ALIGNED_DISTANCE_RATIO = 0.6  # of the tolerance; closer, only the heading is corrected
TURN_TOLERANCE_RATIO, ALIGN_TOLERANCE_RATIO = 1.5, 0.8  # of the heading tolerance
TIME_LIMIT_BASE, TIME_LIMIT_RATIO = 30.0, 5.0  # s, and multiple of the shortest possible time


class FollowerStep(NamedTuple):
    """Result of one update: next state, velocity (m/s, rad/s), and how the goal ended."""

    pursuit: Pursuit
    linear: float = 0.0
    angular: float = 0.0
    end: GoalEnd | None = None
    cause: str = ""


class GoalFollower(Block):
    """Drive to one goal after another, and report how each ended.

    Each attempt turns, drives and aligns, each from rest to rest. If the final pose is not within
    tolerance, it tries again.
    """

    tolerance = Param(float, default=0.01, unit="m", above=0.0, help="Tolerance of the position.")
    heading_tolerance = Param(
        float, default=2 * pi / 180, unit="rad", above=0.0, help="Tolerance of the heading."
    )
    reverse = Param(bool, default=False, help="Allow driving backwards where it is shorter.")
    creep = Param(
        float,
        default=0.035,
        unit="m/s",
        above=0.0,
        help="Minimum wheel speed: below it, friction may hold one of the wheels.",
    )
    attempts = Param(int, default=6, minimum=1, maximum=50, help="Maximum number of attempts.")
    patience = Param(float, default=10.0, unit="s", above=0.0, help="Maximum wait at an obstacle.")
    stuck_after = Param(
        float, default=2.0, unit="s", above=0.0, help="Time without motion after which it is stuck."
    )
    speed: float = FromRobot("limits.speed")
    turn_rate: float = FromRobot("limits.turn_rate")
    acceleration: float = FromRobot("limits.acceleration")
    braking: float = FromRobot("limits.braking")
    track: float = FromRobot("drive.track")
    lag: float = FromRobot("drive.left.motor.lag")
    command_delay: float = FromRobot("link.command_delay")

    odometry = In(Odometry)
    goal = In(Goal)
    stop = In(Stop, trigger=False, optional=True, help="Stops of the blocks behind it.")
    twist = Out(Twist)
    state = Out(GoalState)

    def reset(self) -> None:
        self.pursuit: Pursuit | None = None
        self.coast = Coast(self.lag)
        self.last_goal: Goal | None = None
        self.last: Odometry | None = None
        self.sent: deque[tuple[int, float, float]] = deque([(0, 0.0, 0.0)])

    def react(
        self, now: int, odometry: Odometry | None, goal: Goal | None, stop: Stop | None
    ) -> tuple[Twist | None, GoalState | None] | None:
        if odometry is None or odometry is self.last:
            return None
        seconds = 0.0 if self.last is None else (odometry.time - self.last.time) / SECOND
        self.last = odometry
        self._drop_effective(odometry)
        if goal is not None and goal is not self.last_goal:
            self.last_goal = goal
            self.pursuit = self._accept(goal, odometry) if goal.number else None
        twist, state = Twist(now, 0.0, 0.0), None
        if self.pursuit is not None:
            step = self.advance(self.pursuit, now, odometry, stop, seconds)
            twist = Twist(now, step.linear, step.angular)
            if not _is_latched(stop):
                state = _goal_state(now, odometry, step)
            self.coast = step.pursuit.coast
            self.pursuit = step.pursuit if step.end is None else None
        self.sent.append((now, twist.linear, twist.angular))
        return twist, state

    def _accept(self, goal: Goal, odometry: Odometry) -> Pursuit:
        limits = MotionLimits(
            self.speed, self.turn_rate, self.acceleration, self.braking, self.track
        )
        pursuit = Pursuit(goal, 0.0, self.coast)
        shortest_time = rest_to_rest_time(pursuit.distance(odometry), 0.0, pi, limits)
        time_limit = TIME_LIMIT_BASE + TIME_LIMIT_RATIO * shortest_time
        return self._begin(pursuit._replace(time_limit=time_limit), odometry)

    def _begin(self, pursuit: Pursuit, odometry: Odometry) -> Pursuit:
        return pursuit.begin(odometry, ALIGNED_DISTANCE_RATIO * self.tolerance, self.reverse)

    def _drop_effective(self, odometry: Odometry) -> None:
        """Remove commands that took effect before the time of the pose, except the last."""
        delay = round(self.command_delay * SECOND)
        while len(self.sent) > 1 and self.sent[1][0] + delay <= odometry.time:
            self.sent.popleft()

    def advance(
        self, pursuit: Pursuit, now: int, odometry: Odometry, stop: Stop | None, seconds: float
    ) -> FollowerStep:
        """One update of the state by a pose that is `seconds` after the last; has no side effect.

        turning -> driving -> aligning, each to rest; then the goal has ended or a new attempt
        begins.
        """
        if _is_latched(stop):  # time in a latched stop does not count
            return FollowerStep(pursuit._replace(is_coasting=True))
        pursuit = self._count_time(pursuit, odometry, stop, seconds)
        timeout = self._timeout(pursuit, stop)
        if timeout is not None:
            return FollowerStep(pursuit, 0.0, 0.0, *timeout)
        step = self._move(pursuit, now, odometry, seconds)
        if step.linear or step.angular or not step.pursuit.idle_for:
            return step
        return step._replace(pursuit=step.pursuit._replace(idle_for=0.0))

    def _count_time(
        self, pursuit: Pursuit, odometry: Odometry, stop: Stop | None, seconds: float
    ) -> Pursuit:
        if stop is not None and stop.code:
            return pursuit._replace(blocked_for=pursuit.blocked_for + seconds)
        is_idle = self._wheel_speed(odometry) <= STILL_SPEED_MAX and not pursuit.is_coasting
        return pursuit._replace(
            blocked_for=0.0,
            elapsed=pursuit.elapsed + seconds,
            idle_for=pursuit.idle_for + seconds if is_idle else 0.0,
        )

    def _timeout(self, pursuit: Pursuit, stop: Stop | None) -> tuple[GoalEnd, str] | None:
        """How and why the goal ends, if it takes too long."""
        if stop is not None and pursuit.blocked_for > self.patience:
            return "blocked", f"{stop.cause}, for {self.patience:g} s"
        if pursuit.elapsed > pursuit.time_limit:
            return "given_up", f"time limit of {pursuit.time_limit:.0f} s exceeded"
        if pursuit.idle_for > self.stuck_after:
            return "stuck", f"no wheel has turned for {self.stuck_after:g} s"
        return None

    def _move(self, pursuit: Pursuit, now: int, odometry: Odometry, seconds: float) -> FollowerStep:
        """The velocity for the present leg; changes to the next leg at rest."""
        if pursuit.is_coasting:
            pursuit = self._await_rest(pursuit, odometry)
            if pursuit.is_coasting:
                return FollowerStep(pursuit)
            pursuit = pursuit.learn_coast(odometry, 0.5 * self.track, self.lag)
            if self._is_leg_done(pursuit, odometry, seconds):
                match pursuit.leg:
                    case "turning":
                        pursuit = pursuit._replace(leg="driving", pivot=(odometry.x, odometry.y))
                    case "driving":
                        # The last turn is about the goal, which reduces the position error further.
                        pivot = (pursuit.goal.x, pursuit.goal.y)
                        pursuit = pursuit._replace(leg="aligning", pivot=pivot)
                    case "aligning":
                        return self._judge(pursuit, odometry)
                    case _:
                        assert_never(pursuit.leg)
        delay = round(self.command_delay * SECOND)
        commands = [(time + delay, linear, angular) for time, linear, angular in self.sent]
        predicted = predict_motion(odometry, now + delay, commands, self.lag)
        if pursuit.leg == "driving":
            return self._drive_leg(pursuit, odometry, predicted, seconds)
        return self._turn_leg(pursuit, odometry, predicted, seconds)

    def _await_rest(self, pursuit: Pursuit, odometry: Odometry) -> Pursuit:
        """End coasting when the robot is slow enough for the next leg or for the final check."""
        wheel_speed = self._wheel_speed(odometry)
        if pursuit.leg != "aligning":
            return pursuit._replace(is_coasting=wheel_speed > SLOW_SPEED_MAX)
        since = odometry.time if pursuit.still_since is None else pursuit.still_since
        if wheel_speed > STILL_SPEED_MAX:
            return pursuit._replace(still_since=None)
        if odometry.time - since < STILL_TIME_MIN:
            return pursuit._replace(still_since=since)
        return pursuit._replace(still_since=None, is_coasting=False)

    def _judge(self, pursuit: Pursuit, odometry: Odometry) -> FollowerStep:
        distance = pursuit.distance(odometry)
        turn = abs(pursuit.heading_error(odometry))
        if distance <= self.tolerance and turn <= self.heading_tolerance:
            return FollowerStep(pursuit, end="reached")
        pursuit = pursuit._replace(attempts=pursuit.attempts + 1)
        if pursuit.attempts >= self.attempts:
            cause = f"{distance * 1000:.0f} mm away after {pursuit.attempts} attempts"
            return FollowerStep(pursuit, end="given_up", cause=cause)
        return FollowerStep(self._begin(pursuit, odometry))

    def _turn_leg(
        self, pursuit: Pursuit, odometry: Odometry, predicted: Motion, seconds: float
    ) -> FollowerStep:
        half_track, bounds = 0.5 * self.track, self._turn_bounds()
        remaining = half_track * (pursuit.heading_error(odometry) - predicted.turn)
        rolling = half_track * predicted.angular
        speed = approach_speed(remaining, rolling, pursuit.coast.time, seconds, bounds)
        if pursuit.needs_nudge:
            pursuit = pursuit._replace(needs_nudge=False)
            speed = speed or copysign(bounds.minimum, remaining)
        if speed == 0.0:
            return FollowerStep(pursuit.released(abs(rolling), predicted.angular))
        linear = self._pivot_speed(pursuit, odometry, abs(speed))
        return FollowerStep(pursuit, linear, speed / half_track)

    def _pivot_speed(self, pursuit: Pursuit, odometry: Odometry, wheel_speed: float) -> float:
        """Forward speed (m/s) that holds the position in a turn, against unequal motors."""
        x, y = pursuit.pivot
        ahead = (x - odometry.x) * cos(odometry.heading) + (y - odometry.y) * sin(odometry.heading)
        limit = PIVOT_SPEED_RATIO_MAX * wheel_speed
        return min(max(PIVOT_GAIN * ahead, -limit), limit)

    def _drive_leg(
        self, pursuit: Pursuit, odometry: Odometry, predicted: Motion, seconds: float
    ) -> FollowerStep:
        sign = -1.0 if pursuit.is_backwards else 1.0
        if pursuit.distance(odometry) > BEARING_DISTANCE_MIN:
            bearing = atan2(pursuit.goal.y - odometry.y, pursuit.goal.x - odometry.x)
            pursuit = pursuit._replace(line=bearing + (pi if pursuit.is_backwards else 0.0))
        remaining = pursuit.along(odometry) - predicted.travel
        bounds = SpeedBounds(self.creep, self.speed, self.braking * BRAKING_RATIO)
        linear = approach_speed(remaining, predicted.linear, pursuit.coast.time, seconds, bounds)
        if linear * sign <= 0.0:
            return FollowerStep(pursuit.released(sign * predicted.linear))
        error = shortest_turn(pursuit.line - odometry.heading - predicted.turn)
        correction = min(max(HEADING_GAIN * error, -HEADING_CORRECTION_MAX), HEADING_CORRECTION_MAX)
        return FollowerStep(pursuit, linear, correction)

    def _turn_bounds(self) -> SpeedBounds:
        """Wheel speeds while turning on the spot."""
        maximum = min(self.speed, self.turn_rate * 0.5 * self.track)
        return SpeedBounds(min(self.creep, maximum), maximum, self.braking * BRAKING_RATIO)

    def _is_leg_done(self, pursuit: Pursuit, odometry: Odometry, seconds: float) -> bool:
        if pursuit.leg == "driving":
            return True
        ratio = TURN_TOLERANCE_RATIO if pursuit.leg == "turning" else ALIGN_TOLERANCE_RATIO
        error = abs(pursuit.heading_error(odometry))
        if error <= self.heading_tolerance * ratio:
            return True
        # With slow motors the remaining angle may be too small to drive.
        remaining, bounds = 0.5 * self.track * error, self._turn_bounds()
        return approach_speed(remaining, 0.0, pursuit.coast.time, seconds, bounds) == 0.0

    def _wheel_speed(self, odometry: Odometry) -> float:
        """Speed (m/s) of the faster wheel."""
        return abs(odometry.linear) + abs(odometry.angular) * 0.5 * self.track


def _is_latched(stop: Stop | None) -> bool:
    return stop is not None and stop.code != "" and stop.latched


def _goal_state(now: int, odometry: Odometry, step: FollowerStep) -> GoalState:
    pursuit = step.pursuit
    if step.end is not None:
        pursuit = pursuit._replace(
            leg="aligning"
        )  # so that the error of the final heading is reported
    return GoalState(
        now,
        pursuit.goal.number,
        pursuit.leg if step.end is None else step.end,
        pursuit.distance(odometry),
        pursuit.heading_error(odometry),
        step.cause,
    )
