"""The legs of a goal: how fast the robot turns, drives, and turns again, and when each is done."""

from __future__ import annotations

from math import copysign, cos, pi, sin
from typing import NamedTuple

from diffbotctl.control.goal_pursuit import Pursuit
from diffbotctl.control.motion_profile import (
    Motion,
    MotionLimits,
    SpeedBounds,
    approach_speed,
    is_too_small,
    shortest_turn,
    stopping_turn,
)
from diffbotctl.control.wheel_response import DriveResponse
from diffbotctl.messages import GoalEnd, Odometry

BRAKING_RATIO = 0.8  # of the braking limit; the rest is a reserve for the motors
# 1/s: heading error to turn rate while driving, position error to speed while turning; and the most
# that their products with the lag of the motors may be.
HEADING_GAIN, HEADING_GAIN_LAG_MAX = 4.5, 1.0
PIVOT_GAIN, PIVOT_GAIN_LAG_MAX = 2.5, 0.6
HEADING_CORRECTION_MAX = 1.0  # rad/s, while driving
STEERING_RATIO_MAX = 0.8  # of the speed of the wheels, so that none reverses while driving
HEADING_ERROR_FREE = 10 * pi / 180  # up to here it drives at full speed
HEADING_ERROR_MAX = 45 * pi / 180  # beyond, it stops and turns
PIVOT_SPEED_RATIO_MAX = 0.3  # of the wheel speed, so that no wheel reverses
BEARING_DISTANCE_MIN = 0.06  # m to the goal; closer, the bearing is dominated by noise
STEERED_ERROR_MAX = 8 * pi / 180  # remaining turn that is steered on the way to the goal,
STEERED_DISTANCE_MIN = 0.3  # m, if that is as far as this
ROLLING_ERROR_MAX = 15 * pi / 180  # remaining turn about a wheel that is steered while it drives on
TURN_TOLERANCE_RATIO, ALIGN_TOLERANCE_RATIO = 1.5, 0.8  # of the heading tolerance
# Of the tolerance: remaining distance that need not be driven.
TURN_REST_RATIO, DRIVE_REST_RATIO = 0.5, 0.5
# A motor that breaks loose at a high duty and goes on at a low one turns the robot farther than
# asked; without power it comes to rest. Motors that are exchanged go on from there.
OPPOSED_TURN_STOP = 45 * pi / 180
PUSH_GROWTH = 1.4  # of the least speed, with each small turn in which friction held the wheels
# s, of the first of them; each further one takes a little more than twice as long. The loop of the
# board takes up to 0.6 s to kick a wheel loose.
PUSH_TIME = 0.03
# s without motion in all, after which a wheel is pushed until its encoder counts.
STUCK_PUSH_AFTER = 1.0
OVERSHOT_RATIO = 0.7  # of the least speed, after each small turn that went too far
RELEASES_MAX = 12  # in one turn; then the remaining angle is left to the next leg or attempt
RETRY_SPEED_RATIO = 0.6  # of the speed of the attempt before: slow motors and weak ones err less
UNSTICK_AFTER = 0.3  # s without motion, after which the least speed is raised
UNSTICK_TIME = 1.0  # s in which it is raised to the limit


class FollowerStep(NamedTuple):
    """Result of one update: next state, velocity (m/s, rad/s), and how the goal ended."""

    pursuit: Pursuit
    linear: float = 0.0
    angular: float = 0.0
    end: GoalEnd | None = None
    cause: str = ""


class LegLimits(NamedTuple):
    """What the legs keep to, the same for all goals."""

    motion: MotionLimits
    tolerance: float
    """m"""
    heading_tolerance: float
    """rad"""
    least_speed: float
    """m/s; below it, friction may hold a wheel"""
    counted_speed: float
    """m/s; below it, a wheel's encoder counts too rarely for its loop"""
    lag: float
    """s, of the motors by the robot file"""


class LegView(NamedTuple):
    """What is known of the motion in one update."""

    odometry: Odometry
    predicted: Motion
    """until a command that is sent now takes effect"""
    commanded_turn_rate: float
    """rad/s, of the last command"""
    lag: float
    """s, of the motors by all that is known"""
    seconds: float
    """until the next update"""


class GoalLegs:
    """The velocity in each leg."""

    def __init__(self, limits: LegLimits, wheels: DriveResponse) -> None:
        self.limits, self.wheels = limits, wheels
        motion = limits.motion
        self.half_track = 0.5 * motion.track
        # rad/s2, that the limits of the wheels allow
        self.angular_acceleration = min(motion.acceleration, motion.braking) / self.half_track

    def arm(self, pursuit: Pursuit) -> float:
        """Distance (m) of a wheel from the point about which the robot turns."""
        return self.half_track + pursuit.turn_radius

    def turn(self, pursuit: Pursuit, view: LegView) -> FollowerStep:
        """The velocity in a turn; without one, the wheels are released."""
        odometry, predicted, seconds = view.odometry, view.predicted, view.seconds
        if pursuit.turn_radius and self.wheels.weak:  # both wheels together are stronger than one
            pursuit = pursuit.turn_on_the_spot(odometry)
        arm, bounds = self.arm(pursuit), self.turn_bounds(pursuit)
        if pursuit.leg == "turning" and pursuit.distance(odometry) > BEARING_DISTANCE_MIN:
            pursuit = pursuit.aim(odometry)
        if pursuit.needs_nudge:  # friction holds the wheels: they have not followed their commands
            predicted = Motion(0.0, 0.0, 0.0, 0.0)
        error = pursuit.heading_error(odometry) - predicted.turn
        if pursuit.turn_radius and abs(error) <= ROLLING_ERROR_MAX:
            return self.drive(pursuit._replace(leg="driving", releases=0), view)
        remaining, rolling = arm * error, arm * predicted.angular
        speed = approach_speed(
            remaining, rolling, pursuit.coast_time(rolling, odometry), seconds, bounds
        )
        if pursuit.needs_nudge:
            pursuit = self._pushed(pursuit, seconds)
            speed = speed or copysign(bounds.minimum, remaining)
        if speed == 0.0:
            return FollowerStep(pursuit.released(abs(rolling), odometry, predicted.angular))
        before = pursuit.opposed_turn
        pursuit = pursuit.watch_turn(odometry.angular, speed, seconds)
        if before <= OPPOSED_TURN_STOP < pursuit.opposed_turn:
            return FollowerStep(pursuit.stop_opposed_turn(odometry))
        if pursuit.turn_radius:
            return FollowerStep(pursuit, pursuit.turn_radius * abs(speed) / arm, speed / arm)
        linear = self._pivot_speed(pursuit, view, abs(speed))
        return FollowerStep(pursuit, linear, speed / arm)

    def _pushed(self, pursuit: Pursuit, seconds: float) -> Pursuit:
        """After another update of a push against friction."""
        # A fine encoder shows when the wheels have left static friction; a coarse one too late.
        rest = TURN_REST_RATIO * self.arm(pursuit) * self.limits.heading_tolerance
        is_coarse = self.wheels.pitch > rest
        pushed_for = pursuit.pushed_for + seconds
        is_enough = is_coarse and pushed_for > (2**pursuit.stalls - 1) * PUSH_TIME
        is_stuck = self.wheels.idle_for > STUCK_PUSH_AFTER
        needs_nudge = not (self.wheels.has_counted or (is_enough and not is_stuck))
        return pursuit._replace(needs_nudge=needs_nudge, pushed_for=pushed_for)

    def _pivot_speed(self, pursuit: Pursuit, view: LegView, wheel_speed: float) -> float:
        """Forward speed (m/s) that holds the position in a turn, against unequal motors."""
        (x, y), odometry = pursuit.pivot, view.odometry
        ahead = (x - odometry.x) * cos(odometry.heading) + (y - odometry.y) * sin(odometry.heading)
        limit = PIVOT_SPEED_RATIO_MAX * wheel_speed
        lag = max(self.limits.lag, pursuit.coast.time)
        gain = min(PIVOT_GAIN, PIVOT_GAIN_LAG_MAX / lag)
        return min(max(gain * ahead, -limit), limit)

    def drive(self, pursuit: Pursuit, view: LegView) -> FollowerStep:
        """The velocity on the way to the goal; without one, the wheels are released."""
        odometry, predicted = view.odometry, view.predicted
        sign = -1.0 if pursuit.is_backwards else 1.0
        if pursuit.distance(odometry) > BEARING_DISTANCE_MIN:
            pursuit = pursuit.aim(odometry)
        bounds = self._drive_bounds(pursuit)
        linear = approach_speed(
            pursuit.along(odometry) - predicted.travel,
            predicted.linear,
            pursuit.coast_time(predicted.linear, odometry),
            view.seconds,
            bounds,
        )
        if linear * sign <= 0.0:
            return FollowerStep(pursuit.released(sign * predicted.linear, odometry))
        error = shortest_turn(pursuit.line - odometry.heading - predicted.turn)
        # A turn would begin the time anew in which the board finds a blocked wheel.
        if abs(error) > HEADING_ERROR_MAX and not self.wheels.has_silent_wheel:
            return FollowerStep(pursuit.turn_again(odometry))
        if abs(error) > HEADING_ERROR_FREE:
            rest = max(HEADING_ERROR_MAX - abs(error), 0.0)
            ratio = rest / (HEADING_ERROR_MAX - HEADING_ERROR_FREE)
            linear = copysign(max(abs(linear) * ratio, bounds.minimum), linear)
        return FollowerStep(pursuit, linear, self._turn_rate(error, linear, view))

    def _turn_rate(self, error: float, linear: float, view: LegView) -> float:
        """Turn rate (rad/s) that steers against a heading `error` (rad) while driving.

        Slow motors, and commands whose changes are limited, turn the robot on after a command:
        without that, a heavy robot would weave.
        """
        turned, lag = view.predicted.angular, view.lag
        error -= stopping_turn(view.commanded_turn_rate, turned, lag, self.angular_acceleration)
        gain = min(HEADING_GAIN, HEADING_GAIN_LAG_MAX / lag)
        limit = min(STEERING_RATIO_MAX * abs(linear) / self.half_track, HEADING_CORRECTION_MAX)
        return min(max(gain * error, -limit), limit)

    def turn_bounds(self, pursuit: Pursuit) -> SpeedBounds:
        """Speeds of the wheels, or of the outer one, while turning."""
        arm, motion = self.arm(pursuit), self.limits.motion
        rest = TURN_REST_RATIO * arm * self.limits.heading_tolerance
        return self._bounds(pursuit, min(motion.speed, motion.turn_rate * arm), rest)

    def _drive_bounds(self, pursuit: Pursuit) -> SpeedBounds:
        limits = self.limits
        return self._bounds(pursuit, limits.motion.speed, DRIVE_REST_RATIO * limits.tolerance)

    def _bounds(self, pursuit: Pursuit, maximum: float, rest: float) -> SpeedBounds:
        """Speeds up to `maximum`: slower in each further attempt, faster for wheels that stick."""
        limits = self.limits
        least = max(
            limits.least_speed * OVERSHOT_RATIO**pursuit.overshoots,
            min(limits.least_speed, limits.counted_speed),
        )
        creep = min(least * PUSH_GROWTH**pursuit.stalls, maximum)
        top = max(maximum * RETRY_SPEED_RATIO**pursuit.attempts, min(2.0 * creep, maximum))
        idle = self.wheels.idle_for
        if idle > UNSTICK_AFTER:
            creep += (maximum - creep) * min((idle - UNSTICK_AFTER) / UNSTICK_TIME, 1.0)
            top = max(top, creep)
        return SpeedBounds(creep, top, limits.motion.braking * BRAKING_RATIO, rest)

    def is_done(
        self, pursuit: Pursuit, odometry: Odometry, seconds: float, heading_tolerance: float
    ) -> bool:
        """Whether the leg of a robot at rest is done. `heading_tolerance` (rad) of a turn;
        `seconds` from one update to the next."""
        if pursuit.releases >= RELEASES_MAX:
            return True
        if pursuit.leg == "driving":
            return not self._falls_short(pursuit, odometry, seconds)
        error = abs(pursuit.heading_error(odometry))
        if pursuit.leg == "turning":
            tolerance = TURN_TOLERANCE_RATIO * heading_tolerance
            if pursuit.distance(odometry) > STEERED_DISTANCE_MIN:
                tolerance = max(tolerance, STEERED_ERROR_MAX)
        else:
            tolerance = ALIGN_TOLERANCE_RATIO * heading_tolerance
        if error <= tolerance:
            return True
        # With slow motors the remaining angle may be too small to drive.
        remaining, bounds = self.arm(pursuit) * error, self.turn_bounds(pursuit)
        return is_too_small(remaining, pursuit.coast.time, seconds, bounds)

    def _falls_short(self, pursuit: Pursuit, odometry: Odometry, seconds: float) -> bool:
        """Whether the robot, at rest, should drive on, having coasted less than expected."""
        remaining = pursuit.along(odometry)
        remaining = -remaining if pursuit.is_backwards else remaining
        error = shortest_turn(pursuit.line - odometry.heading)
        bounds = self._drive_bounds(pursuit)
        return (
            remaining > self.limits.tolerance
            and abs(error) < HEADING_ERROR_MAX
            and not is_too_small(remaining, pursuit.coast.time, seconds, bounds)
        )
