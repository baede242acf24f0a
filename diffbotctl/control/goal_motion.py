"""Motion to one goal: turn, drive and align, each from rest to rest, until the robot is there."""

from __future__ import annotations

from enum import StrEnum
from math import atan2, copysign, cos, hypot, inf, pi, sin
from typing import NamedTuple

from diffbotctl.control.coast import COAST_SPEED_MIN, Coast
from diffbotctl.control.motion_profile import (
    Motion,
    MotionLimits,
    SpeedBounds,
    approach_speed,
    shortest_turn,
    stopping_turn,
)
from diffbotctl.control.wheel_response import DriveResponse
from diffbotctl.messages import Goal, Odometry
from diffbotctl.time import MILLISECOND

STILL_SPEED_MAX = 0.004  # m/s of a wheel; at lower speeds it may stand between two slots
SLOW_SPEED_MAX = 0.012  # m/s; it coasts for about a millimetre, so the next leg may begin
STILL_TIME_MIN = 60 * MILLISECOND  # at rest, after which the pose is final
BRAKING_RATIO = 0.8  # of the braking limit; the rest is a reserve for the motors
# 1/s: heading error to turn rate while driving, position error to speed while turning; and the most
# that their products with the lag of the motors may be.
HEADING_GAIN, HEADING_GAIN_LAG_MAX = 4.5, 1.0
PIVOT_GAIN, PIVOT_GAIN_LAG_MAX = 2.5, 0.6
HEADING_CORRECTION_MAX = 1.0  # rad/s, while driving
STEERING_RATIO_MAX = 0.8  # of the speed of the wheels, so that none reverses while driving
HEADING_ERROR_MAX = 45 * pi / 180  # beyond, a robot that drives stops and turns
PIVOT_SPEED_RATIO_MAX = 0.3  # of the wheel speed, so that no wheel reverses
BEARING_DISTANCE_MIN = 0.06  # m to the goal; closer, the bearing is dominated by noise
STEERED_ERROR_MAX = 8 * pi / 180  # remaining turn that is steered on the way to the goal,
STEERED_DISTANCE_MIN = 0.3  # m, if that is as far as this
ROLLING_ERROR_MAX = 15 * pi / 180  # remaining turn about a wheel that is steered while it drives on
# m to the goal per metre of the radius of the first turn; from nearer, it would drive around it.
TURN_WAY_RADII = 4.0
ALIGN_TOLERANCE_RATIO = 0.8  # of the heading tolerance
PIVOT_GAIN_RATIO = 0.5 * PIVOT_SPEED_RATIO_MAX  # of a wheel's travel: what it comes nearer
NEAR_RATIO = 0.6  # of the tolerance; a goal that is as near as this asks for no drive
ASIDE_RATIO = 0.7  # of the tolerance; a goal that is less far aside asks for no turn
# m that a robot may back up over ground that it has not driven over just now: less than its wheels
# cover, and less than a turn on the spot moves them.
BACKING_MAX = 0.02
STALL_RATIO = 0.8  # of a remaining way; if more of it remains, friction has held the wheels
PUSH_GROWTH = 1.4  # of the least speed, with each leg in which friction held the wheels
# s, of the first push against it, unless a wheel counts; each further one takes a little more than
# twice as long. The loop of the board takes up to 0.6 s to kick a wheel loose.
PUSH_TIME = 0.03
UNSTICK_AFTER, UNSTICK_TIME = 0.3, 1.0  # s without motion until, and in which the speed is raised
RELEASES_MAX = 8  # in one attempt
RETRY_SPEED_RATIO = 0.6  # of the speed of the attempt before: slow motors and weak ones err less
TURNED_MAX = 540 * pi / 180  # rad in one turn, which needs 180 deg and some corrections


class Phase(StrEnum):
    """What the robot does on its way to a goal."""

    TURNING = "turning"
    DRIVING = "driving"
    ALIGNING = "aligning"


class Pursuit(NamedTuple):
    """A goal under way."""

    goal: Goal
    start_distance: float = inf  # m to the goal when it was accepted
    time_limit: float = inf  # s
    phase: Phase = Phase.TURNING
    line: float = 0.0  # heading (rad) to turn to, or of the robot while it drives
    direction: float = 1.0  # 1 or -1: of the turn, or of the drive along `line`
    is_released: bool = False  # at rest, the next leg is planned
    still_since: int | None = None  # ns
    turn_radius: float = 0.0
    """m from the middle of the axle to the point about which it turns; 0: on the spot"""
    pivot: tuple[float, float] = (0.0, 0.0)
    """point (m) that the robot holds during a turn on the spot"""
    turned: float = 0.0  # rad that the robot has turned in this leg, in either direction
    driven: float = 0.0  # m forwards since the last turn
    rest_way: float = inf
    """m of a wheel, with its sign, that remained when this leg was planned at rest"""
    stalls: int = 0  # successive releases that have not moved the robot
    pushed_for: float = 0.0
    """s for which the wheels have been driven in this leg; infinite when one has counted"""
    releases: int = 0  # in this attempt
    attempts: int = 0
    opposed_turn: float = 0.0
    """rad that the robot has turned against its command, less those it has turned back"""
    elapsed: float = 0.0  # s, not counting stops
    blocked_for: float = 0.0  # s, of all stops at one place
    blocked_at: tuple[float, float] | None = None  # m; the place of the first of them
    idle_for: float = 0.0  # s of being driven without moving

    @property
    def is_pushed(self) -> bool:
        """Whether wheels that friction held are driven, whatever odometry makes of it."""
        return self.pushed_for < (2.0**self.stalls - 1.0) * PUSH_TIME

    def distance(self, odometry: Odometry) -> float:
        """Metres to the goal."""
        return hypot(self.goal.x - odometry.x, self.goal.y - odometry.y)

    def bearing(self, odometry: Odometry) -> float:
        """Direction (rad) of the goal in odom."""
        return atan2(self.goal.y - odometry.y, self.goal.x - odometry.x)

    def along(self, odometry: Odometry) -> float:
        """Metres to the goal along `line`; negative when it is behind the robot."""
        east, north = self.goal.x - odometry.x, self.goal.y - odometry.y
        return east * cos(self.line) + north * sin(self.line)

    def final_error(self, odometry: Odometry) -> float:
        """Radians to turn at the goal."""
        heading = self.goal.heading
        return 0.0 if heading is None else shortest_turn(heading - odometry.heading)

    def heading_error(self, odometry: Odometry) -> float:
        """Radians to turn: to `line`, and after the drive to the heading of the goal."""
        if self.phase is Phase.ALIGNING:
            return self.final_error(odometry)
        return shortest_turn(self.line - odometry.heading)

    def aimed(self, odometry: Odometry) -> Pursuit:
        """`line` towards the goal from this pose, or away from it if the goal is behind."""
        if self.distance(odometry) <= BEARING_DISTANCE_MIN:
            return self
        bearing = self.bearing(odometry)
        return self._replace(line=bearing if cos(bearing - self.line) >= 0.0 else bearing + pi)


class MotionStep(NamedTuple):
    """Result of one update: the state, and the velocity (m/s, rad/s); at rest, maybe no leg."""

    pursuit: Pursuit
    linear: float = 0.0
    angular: float = 0.0
    has_arrived: bool = False


class MotionView(NamedTuple):
    """What is known of the motion in one update."""

    odometry: Odometry
    predicted: Motion  # until a command that is sent now takes effect
    commanded_turn_rate: float  # rad/s, of the last command
    lag: float  # s, of the motors by all that is known
    seconds: float  # until the next update
    tolerances: tuple[float, float]  # m and rad; of the goal


class GoalMotion:
    """The transition function, with the coast time that it learns."""

    def __init__(
        self,
        limits: MotionLimits,
        least_speed: float,
        lag: float,
        turn_radius: float,
        may_reverse: bool,
        wheels: DriveResponse,
    ) -> None:
        """`least_speed` (m/s): below it, friction may hold a wheel. `lag` (s) of the motors by the
        robot file. `turn_radius` (m): of the first turn."""
        self.limits, self.wheels = limits, wheels
        self.least_speed, self.lag = least_speed, lag
        self.turn_radius, self.may_reverse = turn_radius, may_reverse
        self.half_track = 0.5 * limits.track
        self.coast = Coast(lag)

    def advance(self, pursuit: Pursuit, view: MotionView) -> MotionStep:
        """One update: wait for rest, plan the next leg there, or move."""
        odometry = view.odometry
        if pursuit.phase is Phase.DRIVING:
            pursuit = pursuit._replace(driven=pursuit.driven + odometry.linear * view.seconds)
        if pursuit.is_released:
            pursuit = self._await_rest(pursuit, odometry)
            if pursuit.is_released:
                return MotionStep(pursuit)
            self._learn_coast(pursuit, odometry)
            planned = self.plan(pursuit, view)
            if planned is None:
                return MotionStep(pursuit, has_arrived=True)
            pursuit = self._count_release(planned, pursuit, odometry)
        seconds = inf if self.wheels.has_counted else view.seconds
        pursuit = pursuit._replace(pushed_for=pursuit.pushed_for + seconds)
        if pursuit.phase is Phase.DRIVING:
            return self._drive(pursuit, view)
        return self._turn(pursuit, view)

    def wheel_speed(self, odometry: Odometry) -> float:
        """Speed (m/s) of the faster wheel."""
        return abs(odometry.linear) + abs(odometry.angular) * self.half_track

    def _await_rest(self, pursuit: Pursuit, odometry: Odometry) -> Pursuit:
        """End the wait when the robot is slow enough for the next leg or for the final check."""
        speed = self.wheel_speed(odometry)
        is_last = pursuit.phase is Phase.ALIGNING or pursuit.goal.heading is None
        if speed > (STILL_SPEED_MAX if is_last else SLOW_SPEED_MAX):
            return pursuit._replace(still_since=None)
        since = odometry.time if pursuit.still_since is None else pursuit.still_since
        is_still = not is_last or odometry.time - since >= STILL_TIME_MIN
        return pursuit._replace(still_since=since, is_released=not is_still)

    def plan(self, pursuit: Pursuit, view: MotionView) -> Pursuit | None:
        """The next leg from this pose; None if the robot is there."""
        odometry, (tolerance, heading_tolerance) = view.odometry, view.tolerances
        distance, error = pursuit.distance(odometry), pursuit.final_error(odometry)
        pursuit = pursuit._replace(still_since=None, is_released=False)
        near = NEAR_RATIO * tolerance if pursuit.rest_way == inf else tolerance
        if pursuit.phase is Phase.DRIVING:  # the last turn holds the goal: it corrects some more
            near += min(PIVOT_GAIN_RATIO * self.half_track * abs(error), 0.5 * tolerance)
        has_turned = abs(error) <= ALIGN_TOLERANCE_RATIO * heading_tolerance
        if distance <= near and not has_turned:
            return self._turning(pursuit, Phase.ALIGNING, error, odometry)
        if distance <= tolerance and has_turned:
            return None
        bearing = shortest_turn(pursuit.bearing(odometry) - odometry.heading)
        ahead, aside = distance * cos(bearing), distance * sin(bearing)
        may_back = self.may_reverse or -ahead <= max(pursuit.driven, 0.0) + BACKING_MAX
        is_straight = abs(aside) <= ASIDE_RATIO * tolerance or (
            distance > STEERED_DISTANCE_MIN and abs(aside) <= STEERED_ERROR_MAX * distance
        )
        if is_straight and (ahead > 0.0 or may_back):
            line = odometry.heading
            if abs(ahead) > BEARING_DISTANCE_MIN:
                line += bearing if ahead > 0.0 else shortest_turn(bearing + pi)
            return pursuit._replace(
                phase=Phase.DRIVING, line=line, direction=copysign(1.0, ahead), turn_radius=0.0
            )
        line = pursuit.bearing(odometry)
        if self.may_reverse and self._turns(pursuit, odometry, line + pi) < self._turns(
            pursuit, odometry, line
        ):
            line += pi
        error = shortest_turn(line - odometry.heading)
        planned = self._turning(pursuit._replace(line=line), Phase.TURNING, error, odometry)
        is_forwards = cos(line - pursuit.bearing(odometry)) > 0.0
        # A wheel that has turned without a command may be one that the other one drags along.
        is_far = distance >= TURN_WAY_RADII * self.turn_radius and not odometry.pushed_heading_sd
        if is_forwards and is_far and pursuit.phase is not Phase.ALIGNING:
            planned = planned._replace(turn_radius=self.turn_radius)
        return planned

    def _turning(self, pursuit: Pursuit, phase: Phase, error: float, odometry: Odometry) -> Pursuit:
        """A turn on the spot; the last one is about the goal, which it comes nearer to."""
        center = pursuit.goal if phase is Phase.ALIGNING else odometry
        return pursuit._replace(
            phase=phase,
            direction=copysign(1.0, error),
            pivot=(center.x, center.y),
            turn_radius=0.0,
            turned=0.0,
            driven=0.0,
        )

    @staticmethod
    def _turns(pursuit: Pursuit, odometry: Odometry, line: float) -> float:
        """Sum of both turns (rad) when driving in the direction `line`."""
        first = abs(shortest_turn(line - odometry.heading))
        heading = pursuit.goal.heading
        return first + (0.0 if heading is None else abs(shortest_turn(heading - line)))

    def _count_release(self, planned: Pursuit, before: Pursuit, odometry: Odometry) -> Pursuit:
        """Compare the way that remains at rest with that of the same leg before."""
        way = self._way(planned, odometry)
        is_same = planned.phase is before.phase
        has_stalled = is_same and way * before.rest_way > STALL_RATIO * before.rest_way**2
        is_again = planned.phase is Phase.TURNING and not is_same
        is_again |= before.releases >= RELEASES_MAX
        return planned._replace(
            attempts=before.attempts + is_again,
            releases=0 if is_again else before.releases + 1,
            stalls=before.stalls + 1 if has_stalled else 0,
            pushed_for=0.0,
            rest_way=way,
        )

    def _way(self, pursuit: Pursuit, odometry: Odometry) -> float:
        """Remaining way (m) of the faster wheel in this leg, with its sign."""
        if pursuit.phase is Phase.DRIVING:
            return pursuit.along(odometry)
        return self._arm(pursuit) * pursuit.heading_error(odometry)

    def _arm(self, pursuit: Pursuit) -> float:
        """Distance (m) of a wheel from the point about which the robot turns."""
        return self.half_track + pursuit.turn_radius

    def _turn(self, pursuit: Pursuit, view: MotionView) -> MotionStep:
        """The velocity in a turn; without one, the wheels are released."""
        odometry = view.odometry
        if pursuit.turn_radius and self.wheels.weak:  # both wheels together are stronger than one
            pursuit = pursuit._replace(turn_radius=0.0, pivot=(odometry.x, odometry.y))
        arm = self._arm(pursuit)
        if pursuit.phase is Phase.TURNING:
            pursuit = pursuit.aimed(odometry)
        turned = pursuit.turned + abs(odometry.angular) * view.seconds
        predicted = self._predicted(pursuit, view)
        error = pursuit.heading_error(odometry) - predicted.turn
        if pursuit.turn_radius and abs(error) <= ROLLING_ERROR_MAX:
            pursuit = pursuit._replace(phase=Phase.DRIVING, direction=1.0, turn_radius=0.0)
            return self._drive(pursuit, view)
        if pursuit.direction * error < -0.5 * pi:  # half a turn and more, in either direction
            error += 2.0 * pi * pursuit.direction
        bounds = self._bounds(pursuit, min(self.limits.speed, self.limits.turn_rate * arm))
        speed = self._approach(pursuit, arm * error, arm * predicted.angular, bounds, view)
        if speed == 0.0 or turned > TURNED_MAX:
            return self._released(pursuit, arm * predicted.angular, odometry)
        against = abs(odometry.angular) * view.seconds * copysign(1.0, odometry.angular * -speed)
        opposed = max(pursuit.opposed_turn + against, 0.0)
        pursuit = pursuit._replace(turned=turned, opposed_turn=opposed)
        if pursuit.turn_radius:
            return MotionStep(pursuit, pursuit.turn_radius * abs(speed) / arm, speed / arm)
        return MotionStep(pursuit, self._pivot_speed(pursuit, odometry, abs(speed)), speed / arm)

    def _pivot_speed(self, pursuit: Pursuit, odometry: Odometry, wheel_speed: float) -> float:
        """Forward speed (m/s) that holds the position in a turn, against unequal motors."""
        (x, y), heading = pursuit.pivot, odometry.heading
        ahead = (x - odometry.x) * cos(heading) + (y - odometry.y) * sin(heading)
        limit = PIVOT_SPEED_RATIO_MAX * wheel_speed
        gain = min(PIVOT_GAIN, PIVOT_GAIN_LAG_MAX / max(self.lag, self.coast.time))
        return min(max(gain * ahead, -limit), limit)

    def _drive(self, pursuit: Pursuit, view: MotionView) -> MotionStep:
        """The velocity on the way to the goal; without one, the wheels are released."""
        odometry = view.odometry
        pursuit = pursuit.aimed(odometry)
        predicted = self._predicted(pursuit, view)
        bounds = self._bounds(pursuit, self.limits.speed)
        way = pursuit.along(odometry) - predicted.travel
        linear = self._approach(pursuit, way, predicted.linear, bounds, view)
        error = shortest_turn(pursuit.line - odometry.heading - predicted.turn)
        is_off = abs(error) > HEADING_ERROR_MAX
        if linear == 0.0 or is_off:
            return self._released(pursuit, 0.0 if is_off else predicted.linear, odometry)
        linear = copysign(max(abs(linear) * cos(2.0 * error), bounds.minimum), linear)
        return MotionStep(pursuit, linear, self._steering(error, linear, view))

    def _predicted(self, pursuit: Pursuit, view: MotionView) -> Motion:
        """The motion until a command takes effect: none while friction holds a wheel."""
        is_held = pursuit.is_pushed or self.wheels.idle_for
        return Motion(0.0, 0.0, 0.0, 0.0) if is_held else view.predicted

    def _steering(self, error: float, linear: float, view: MotionView) -> float:
        """Turn rate (rad/s) that steers against a heading `error` (rad) while driving.

        Slow motors, and commands whose changes are limited, turn the robot on after a command:
        without that, a heavy robot would weave.
        """
        lag, limits = view.lag, self.limits
        acceleration = min(limits.acceleration, limits.braking) / self.half_track
        error -= stopping_turn(view.commanded_turn_rate, view.predicted.angular, lag, acceleration)
        gain = min(HEADING_GAIN, HEADING_GAIN_LAG_MAX / lag)
        limit = min(STEERING_RATIO_MAX * abs(linear) / self.half_track, HEADING_CORRECTION_MAX)
        return min(max(gain * error, -limit), limit)

    def _approach(
        self, pursuit: Pursuit, way: float, speed: float, bounds: SpeedBounds, view: MotionView
    ) -> float:
        """Speed (m/s) over the remaining `way` (m) at `speed`; 0 at its end, or beyond it."""
        if pursuit.is_pushed:
            return pursuit.direction * bounds.minimum
        if pursuit.direction * way <= 0.0:
            return 0.0
        coast_time = self.coast.expected(speed, view.odometry.coast_time)
        return approach_speed(way, speed, coast_time, view.seconds, bounds)

    def _bounds(self, pursuit: Pursuit, maximum: float) -> SpeedBounds:
        """Speeds up to `maximum`: slower in each further attempt, faster for wheels that stick."""
        creep = min(self.least_speed * PUSH_GROWTH**pursuit.stalls, maximum)
        top = max(maximum * RETRY_SPEED_RATIO**pursuit.attempts, min(2.0 * creep, maximum))
        idle = self.wheels.idle_for
        if idle > UNSTICK_AFTER:
            creep += (maximum - creep) * min((idle - UNSTICK_AFTER) / UNSTICK_TIME, 1.0)
            top = max(top, creep)
        return SpeedBounds(creep, top, self.limits.braking * BRAKING_RATIO)

    def _released(self, pursuit: Pursuit, speed: float, odometry: Odometry) -> MotionStep:
        """Let the wheels coast, at `speed` (m/s)."""
        time = self.coast.expected(speed, odometry.coast_time)
        self.coast = self.coast._replace(
            release_speed=max(pursuit.direction * speed, 0.0), release_time=time
        )
        return MotionStep(pursuit._replace(is_released=True, still_since=None))

    def _learn_coast(self, pursuit: Pursuit, odometry: Odometry) -> None:
        """Update the coast time, at rest or nearly, by the remaining way of the leg."""
        if self.coast.release_speed < COAST_SPEED_MIN:
            return
        is_drive = pursuit.phase is Phase.DRIVING
        rolling = odometry.linear if is_drive else odometry.angular * self._arm(pursuit)
        remaining = pursuit.direction * self._way(pursuit, odometry)
        remaining -= abs(rolling) * self.coast.at(rolling)
        self.coast = self.coast.learn(remaining, self.lag)
