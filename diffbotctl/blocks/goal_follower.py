"""Goal follower: turn to the bearing of the goal, drive to it, turn to its heading."""

from collections import deque
from collections.abc import Mapping
from math import degrees, pi
from typing import assert_never

from diffbotctl.block import Block, In, Out
from diffbotctl.control.goal_legs import FollowerStep, GoalLegs, LegLimits, LegView
from diffbotctl.control.goal_pursuit import (
    COAST_TIME_MAX,
    Coast,
    PoseSd,
    Pursuit,
)
from diffbotctl.control.motion_profile import MotionLimits, predict_motion, rest_to_rest_time
from diffbotctl.control.velocity_limits import VelocityRate
from diffbotctl.control.wheel_response import GAP_MAX, DriveResponse
from diffbotctl.estimation.geometry_deviation import GEOMETRY, TRACK
from diffbotctl.messages import (
    STARTING,
    Encoders,
    Goal,
    GoalEnd,
    GoalState,
    Odometry,
    Stop,
    Twist,
)
from diffbotctl.params import FromRobot, Param
from diffbotctl.time import MILLISECOND, SECOND

# Wheel speeds in m/s.
STILL_SPEED_MAX = 0.004  # m/s; at lower speeds a wheel may stand between two slots
SLOW_SPEED_MAX = 0.012  # m/s; it coasts for about a millimetre, so the next leg may begin
STILL_TIME_MIN = 60 * MILLISECOND  # at rest, after which the pose is final
# Multiple of the tolerance; farther from the goal, the last turn waits until it is nearer.
MISSED_RATIO = 2.5
ALIGNED_DISTANCE_RATIO = 0.6  # of the tolerance; closer, only the heading is corrected
# m; in wider turns about a wheel the robot would move too far away from its goal.
TURN_RADIUS_MAX = 0.15
TIME_LIMIT_BASE, TIME_LIMIT_RATIO = 30.0, 5.0  # s, and multiple of the shortest possible time
# Of the time limit. After it, a robot need not come nearer to the goal than its pose is known (one
# standard deviation): more attempts would follow the error of the pose.
SEARCH_RATIO = 1.0 / 3.0
WEAK_SPEED_RATIO = 0.5  # of the speed limit; below it a weak wheel is not reported
# Slow motors turn evenly at lower speeds than `creep`: at this part of their top speed, if the
# encoder then still counts often enough for the speed loop (1/s).
CREEP_SPEED_RATIO, CREEP_COUNTS = 0.1, 4.0
CRAWL_CREEP_RATIO = 2.0  # of the creep speed: friction holds a wheel at lower speeds only
# m; a goal whose position is known less well than this, and than it was far away, is not reached.
LOST_MIN = 0.3
LOST_EDGES_PROBABILITY_MAX = 0.5  # an encoder that is likelier broken than not
TURNED_MAX = 540 * pi / 180  # rad in one turn, which needs 180 deg and some corrections
HEADING_SD_MAX = 60 * pi / 180  # rad; with it no way leads to the goal but by chance
OPPOSED_TURN_MAX = 120 * pi / 180  # rad against the commands; more than any motor coasts
FARTHER_MAX = 0.12  # m beyond the distance at the start; the robot does not obey
LIMITED_STEP_MAX = 0.1  # s; block speed_limiter starts anew after a longer silence
FULL_DUTY = 0.98  # duty; more than a motor can be given


class GoalFollower(Block):
    """Drive to one goal after another, and report how each ended.

    Each attempt turns, drives and aligns, each from rest to rest. If the final pose is not within
    tolerance, it tries again.
    """

    tolerance = Param(
        float,
        default=0.01,
        unit="m",
        above=0.0,
        maximum=0.5,
        help="Tolerance of the position.",
        reason="with a larger one a goal counts as reached where the robot has hardly moved",
    )
    heading_tolerance = Param(
        float, default=2 * pi / 180, unit="rad", above=0.0, help="Tolerance of the heading."
    )
    reverse = Param(bool, default=False, help="Allow driving backwards where it is shorter.")
    creep = Param(
        float,
        default=0.035,
        unit="m/s",
        above=0.0,
        help="Minimum wheel speed: below it, friction may hold one of the wheels. Slow motors are "
        "driven down to a tenth of their top speed.",
    )
    attempts = Param(int, default=6, minimum=1, maximum=50, help="Maximum number of attempts.")
    patience = Param(float, default=4.5, unit="s", above=0.0, help="Maximum wait at an obstacle.")
    stuck_after = Param(
        float,
        default=2.0,
        unit="s",
        minimum=0.3,
        help="Time without motion after which it is stuck.",
        reason="a healthy wheel needs that long to start",
    )
    speed: float = FromRobot("limits.speed")
    turn_rate: float = FromRobot("limits.turn_rate")
    acceleration: float = FromRobot("limits.acceleration")
    braking: float = FromRobot("limits.braking")
    track: float = FromRobot("drive.track")
    wheelbase: float | None = FromRobot("drive.wheelbase")
    lag: float = FromRobot("drive.left.motor.lag")
    left_diameter: float = FromRobot("drive.left.wheel.diameter")
    right_diameter: float = FromRobot("drive.right.wheel.diameter")
    left_counts: int = FromRobot("drive.left.encoder.counts")
    right_counts: int = FromRobot("drive.right.encoder.counts")
    left_channels: int = FromRobot("drive.left.encoder.channels")
    right_channels: int = FromRobot("drive.right.encoder.channels")
    left_rated: float = FromRobot("drive.left.motor.rated")
    right_rated: float = FromRobot("drive.right.motor.rated")
    command_delay: float = FromRobot("link.command_delay")
    calibration: Mapping[str, object] = FromRobot("calibration")

    odometry = In(Odometry)
    goal = In(Goal)
    encoders = In(Encoders, trigger=False, optional=True, help="The commands in force.")
    stop = In(Stop, trigger=False, optional=True, help="Stops of the blocks behind it.")
    twist = Out(Twist)
    state = Out(GoalState)

    def reset(self) -> None:
        self.pursuit: Pursuit | None = None
        self.withdrawn: Pursuit | None = None  # until `resume` continues it or another replaces it
        self.coast = Coast(self.lag)
        self.last_goal: Goal | None = None
        self.last: Odometry | None = None
        self.last_encoders: Encoders | None = None
        self.sent: deque[tuple[int, float, float]] = deque([(0, 0.0, 0.0)])
        self.left_pitch = pi * self.left_diameter / self.left_counts
        self.right_pitch = pi * self.right_diameter / self.right_counts
        pitch = max(self.left_pitch, self.right_pitch)
        self.wheels = DriveResponse(self.track, pitch)
        top_speed = 0.5 * min(
            self.left_rated * self.left_diameter, self.right_rated * self.right_diameter
        )
        counted_speed = CREEP_COUNTS * pitch
        slowest = max(CREEP_SPEED_RATIO * top_speed, counted_speed)
        self.least_speed = min(self.creep, slowest)  # m/s, of a wheel
        self.turn_radius = self._first_turn_radius()
        limits = LegLimits(
            self._motion_limits,
            self.tolerance,
            self.heading_tolerance,
            self.least_speed,
            counted_speed,
            self.lag,
        )
        self.legs = GoalLegs(limits, self.wheels)

    @property
    def _motion_limits(self) -> MotionLimits:
        return MotionLimits(self.speed, self.turn_rate, self.acceleration, self.braking, self.track)

    def _first_turn_radius(self) -> float:
        """Radius (m) of the first turn: half the track, about a wheel; or 0, on the spot.

        An encoder with one channel does not show in which direction it turns: a wheel that goes
        backwards, and later forwards again, may be an edge off after each reversal. Where no wheel
        goes backwards, the direction is never in question, and the robot need not come to rest
        between the turn and the drive. Four wheels slip less in a turn on the spot.
        """
        has_one_channel = 1 in (self.left_channels, self.right_channels)
        radius = 0.5 * self.track
        if not has_one_channel or self.wheelbase or radius > TURN_RADIUS_MAX:
            return 0.0
        return radius

    def react(
        self,
        now: int,
        odometry: Odometry | None,
        goal: Goal | None,
        encoders: Encoders | None,
        stop: Stop | None,
    ) -> tuple[Twist | None, GoalState | None] | None:
        if odometry is None or odometry is self.last:
            return None
        seconds = 0.0 if self.last is None else (odometry.time - self.last.time) / SECOND
        self.last = odometry
        self._drop_effective(odometry)
        twist, state = Twist(now, 0.0, 0.0), None
        if goal is not None and goal is not self.last_goal:
            self.last_goal = goal
            state = self._replace_goal(now, goal, odometry)
        if self.pursuit is not None:
            self._observe_wheels(odometry, encoders, seconds)
            step = self.advance(self.pursuit, now, odometry, stop, seconds)
            twist = Twist(now, *self.wheels.compensated(step.linear, step.angular, self.speed))
            if state is None and not _suspends(stop):
                state = _goal_state(now, odometry, step)
            self.coast = step.pursuit.coast
            self.pursuit = step.pursuit if step.end is None else None
            self.sent.append((now, *self._limited(now, step.linear, step.angular)))
        else:
            self.sent.append((now, 0.0, 0.0))
            self.last_encoders = None  # what is counted between two goals is not of interest
        return twist, state

    def _limited(self, now: int, linear: float, angular: float) -> tuple[float, float]:
        """What the limits of acceleration leave of a velocity (m/s, rad/s) after the one before."""
        time, last_linear, last_angular = self.sent[-1]
        step = min((now - time) / SECOND, LIMITED_STEP_MAX)
        rate = VelocityRate(self.acceleration, self.braking, self.track)
        return rate.limited((last_linear, last_angular), (linear, angular), step)

    def _replace_goal(self, now: int, goal: Goal, odometry: Odometry) -> GoalState | None:
        """Take the operator's goal, or withdraw the present one; the end of the one before."""
        former = self.pursuit or self.withdrawn
        if not goal.number:
            self.pursuit, self.withdrawn = None, former
            return None
        self.pursuit, self.withdrawn = self._accept(goal, odometry), None
        if former is None or former.goal.number == goal.number:
            return None
        cause = f"replaced by goal {goal.number}"
        return _goal_state(now, odometry, FollowerStep(former, end="cancelled", cause=cause))

    @property
    def lag_estimate(self) -> float:
        """Lag (s) of the motors: that of the robot file, or more if they coast for longer."""
        return max(self.lag, self.coast.time)

    def _observe_wheels(
        self, odometry: Odometry, encoders: Encoders | None, seconds: float
    ) -> None:
        """Compare the speed of each wheel with its command."""
        half_track, lag = 0.5 * self.track, self.lag_estimate
        aside = odometry.angular * half_track
        left_limited = right_limited = True
        if encoders is None:
            _, linear, angular = self.sent[0]
            left, right = linear - angular * half_track, linear + angular * half_track
        elif encoders.command_kind == "wheels":
            left = 0.5 * self.left_diameter * encoders.left_command
            right = 0.5 * self.right_diameter * encoders.right_command
        else:
            left = 0.5 * self.left_diameter * self.left_rated * encoders.left_command
            right = 0.5 * self.right_diameter * self.right_rated * encoders.right_command
            left_limited = abs(encoders.left_command) >= FULL_DUTY
            right_limited = abs(encoders.right_command) >= FULL_DUTY
        before, self.last_encoders = self.last_encoders, encoders
        left_counted = right_counted = None
        if before is not None and encoders is not None and encoders.boot == before.boot:
            left_counted = self.left_pitch * (encoders.left - before.left)
            right_counted = self.right_pitch * (encoders.right - before.right)
        self.wheels.has_counted = bool(left_counted or right_counted)
        self.wheels.left.update(
            left, odometry.linear - aside, lag, seconds, left_counted, left_limited
        )
        self.wheels.right.update(
            right, odometry.linear + aside, lag, seconds, right_counted, right_limited
        )
        for weakness in self.wheels.newly_weak(WEAK_SPEED_RATIO * self.speed):
            self.log.warning(f"{weakness}; the other wheel is slowed down to it")

    def _accept(self, goal: Goal, odometry: Odometry) -> Pursuit:
        self.wheels.begin(min(CRAWL_CREEP_RATIO * self.least_speed, WEAK_SPEED_RATIO * self.speed))
        pursuit = Pursuit(goal, 0.0, self.coast)
        pursuit = pursuit._replace(start_distance=pursuit.distance(odometry))
        shortest_time = rest_to_rest_time(pursuit.distance(odometry), 0.0, pi, self._motion_limits)
        time_limit = TIME_LIMIT_BASE + TIME_LIMIT_RATIO * shortest_time
        return self._begin(pursuit._replace(time_limit=time_limit), odometry)

    def _begin(self, pursuit: Pursuit, odometry: Odometry) -> Pursuit:
        tolerance = ALIGNED_DISTANCE_RATIO * self.tolerance
        # A wheel that has turned without a command may be one that the other one drags along.
        radius = 0.0 if odometry.pushed_heading_sd else self.turn_radius
        return pursuit.begin(odometry, tolerance, self.reverse, radius)

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
        if _suspends(stop):  # this time does not count
            return FollowerStep(pursuit._replace(is_coasting=True))
        pursuit = self._count_time(pursuit, odometry, stop, seconds)
        timeout = self._timeout(pursuit, odometry, stop) or self._disobeys(pursuit, odometry)
        if timeout is not None:
            return FollowerStep(pursuit, 0.0, 0.0, *timeout)
        step = self._move(pursuit, now, odometry, seconds)
        if step.linear or step.angular or not step.pursuit.idle_for:
            return step
        return step._replace(pursuit=step.pursuit._replace(idle_for=0.0))

    def _count_time(
        self, pursuit: Pursuit, odometry: Odometry, stop: Stop | None, seconds: float
    ) -> Pursuit:
        is_stopped = stop is not None and stop.code != ""
        pursuit = pursuit.count_block(odometry, is_stopped, seconds)
        if is_stopped:
            return pursuit
        is_still = self._wheel_speed(odometry) <= STILL_SPEED_MAX and not self.wheels.has_counted
        is_idle = is_still and not pursuit.is_coasting
        return pursuit._replace(
            elapsed=pursuit.elapsed + seconds,
            idle_for=pursuit.idle_for + min(seconds, GAP_MAX) if is_idle else 0.0,
        )

    def _timeout(
        self, pursuit: Pursuit, odometry: Odometry, stop: Stop | None
    ) -> tuple[GoalEnd, str] | None:
        """How and why the goal ends, if it takes too long."""
        if stop is not None and pursuit.blocked_for > self.patience:
            return "blocked", f"{stop.cause}, for {self.patience:g} s"
        if pursuit.elapsed > pursuit.time_limit:
            cause = f"time limit of {pursuit.time_limit:.0f} s exceeded"
            away = f"{_away(pursuit, odometry)} in attempt {pursuit.attempts + 1}"
            return "given_up", "; ".join((f"{cause}, {away}", *self.wheels.weaknesses()))
        if pursuit.idle_for > self.stuck_after:
            return "stuck", f"no wheel has turned for {self.stuck_after:g} s{self._idle_reason()}"
        fault = self.wheels.fault(self.least_speed, self.stuck_after, self.lag_estimate)
        return ("stuck", fault) if fault else None

    def _idle_reason(self) -> str:
        """Why no wheel turns, if the telemetry shows that nothing is commanded."""
        encoders = self.last_encoders
        if encoders is None or encoders.left_command or encoders.right_command:
            return ""
        return ": the board has no command in force, too many are lost on the link"

    def _disobeys(self, pursuit: Pursuit, odometry: Odometry) -> tuple[GoalEnd, str] | None:
        """How and why a goal ends from which the robot drives or turns away."""
        farther = pursuit.distance(odometry) - pursuit.start_distance
        if farther > FARTHER_MAX + pursuit.turn_radius:
            moved = f"{farther * 1000:.0f} mm farther than at the start"
            cause = f"the robot moves away from the goal: {moved}"
            return "given_up", "; ".join((cause, *self.wheels.weaknesses()))
        lost = self.wheels.lost()
        if lost:
            return "given_up", lost
        # A robot that counts half of its edges drives twice as far: it must not go on to the end.
        if odometry.lost_edges_probability >= LOST_EDGES_PROBABILITY_MAX:
            return "given_up", f"it is not known where the robot is: {odometry.warning}"
        heading_sd = odometry.pushed_heading_sd
        if heading_sd > HEADING_SD_MAX:
            cause = (
                f"it is not known which way the robot faces: to {degrees(heading_sd):.0f} deg "
                f"(standard deviation): {odometry.warning}"
            )
            return "given_up", cause
        if pursuit.opposed_turn > OPPOSED_TURN_MAX:
            cause = "the robot turns against its commands: do both motors turn their own wheels?"
            return "given_up", cause
        return None

    def _move(self, pursuit: Pursuit, now: int, odometry: Odometry, seconds: float) -> FollowerStep:
        """The velocity for the present leg; changes to the next leg at rest."""
        if pursuit.is_coasting:
            pursuit = self._await_rest(pursuit, odometry)
            if pursuit.is_coasting:
                return FollowerStep(pursuit)
            pursuit = pursuit.learn_coast(odometry, self.legs.arm(pursuit), self.lag)
            tolerance, heading_tolerance = self._tolerances(pursuit, odometry)
            if self.legs.is_done(pursuit, odometry, seconds, heading_tolerance):
                match pursuit.leg:
                    case "turning":
                        pursuit = pursuit._replace(leg="driving", releases=0)
                    case "driving":
                        if pursuit.distance(odometry) > MISSED_RATIO * tolerance:
                            return self._try_again(pursuit, odometry)
                        # The last turn is about the goal, which reduces the position error further.
                        pivot = (pursuit.goal.x, pursuit.goal.y)
                        pursuit = pursuit._replace(leg="aligning", pivot=pivot, turn_radius=0.0)
                        pursuit = pursuit.restart_turn()
                    case "aligning":
                        return self._judge(pursuit, odometry)
                    case _:
                        assert_never(pursuit.leg)
            elif pursuit.leg == "driving":
                pursuit = pursuit._replace(releases=pursuit.releases + 1)
            else:
                pursuit = pursuit.count_release(odometry)
        view = self._view(now, odometry, seconds)
        if pursuit.leg == "driving":
            return self.legs.drive(pursuit, view)
        if pursuit.turned > TURNED_MAX:  # one wheel hardly turns, and swings the robot around
            return self._try_again(pursuit, odometry)
        return self.legs.turn(pursuit, view)

    def _view(self, now: int, odometry: Odometry, seconds: float) -> LegView:
        """What is known of the motion when a command that is sent now takes effect."""
        delay = round(self.command_delay * SECOND)
        commands = [(time + delay, linear, angular) for time, linear, angular in self.sent]
        # Odometry knows the motors from the way; until the first stop, nothing else does.
        lag = max(self.lag_estimate, min(odometry.coast_time, COAST_TIME_MAX))
        predicted = predict_motion(odometry, now + delay, commands, lag)
        return LegView(odometry, predicted, self.sent[-1][2], lag, seconds)

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
        tolerance, heading_tolerance = self._tolerances(pursuit, odometry)
        if distance > tolerance or turn > heading_tolerance:
            return self._try_again(pursuit, odometry)
        sd = self._pose_sd(odometry)
        # A fault that is possible, but less probable than not, leaves the goal the likelier place.
        is_likely_there = odometry.lost_edges_probability > 0.0
        if sd.position > max(LOST_MIN, pursuit.start_distance) and not is_likely_there:
            cause = (
                f"it is not known where the robot is: to {sd.position:.1f} m (standard deviation), "
                f"and the goal was {pursuit.start_distance:.1f} m away: {self._why(odometry)}"
            )
            return FollowerStep(pursuit, end="given_up", cause=cause)
        if pursuit.goal.heading is None:
            sd = sd._replace(heading=0.0)
        aside = pursuit.start_distance * self.heading_tolerance
        doubt = sd.doubt(self.tolerance, self.heading_tolerance, aside, bool(odometry.warning))
        if doubt:
            doubt = f"{doubt}: {self._why(odometry)}"
        if distance > self.tolerance or turn > self.heading_tolerance:
            away = f"{distance * 1000:.0f} mm and {degrees(turn):.1f} deg away"
            away = f"no nearer than {away} by odometry"
            doubt = f"{away}, and {doubt}" if doubt else away
        return FollowerStep(pursuit, end="reached_unsure" if doubt else "reached", cause=doubt)

    @property
    def _is_skidding(self) -> bool:
        """Whether the track is known so badly, that of four wheels, that no turn is sure."""
        return self.wheelbase is not None and TRACK not in self.calibration

    def _pose_sd(self, odometry: Odometry) -> PoseSd:
        return PoseSd.of(odometry, self._is_skidding or self.calibration.keys() >= GEOMETRY)

    def _why(self, odometry: Odometry) -> str:
        """Why the pose is known badly."""
        if odometry.warning:
            return odometry.warning
        if self._is_skidding:
            return "four wheels slide in turns: `diffbotctl calibrate spin` measures their track"
        return "dead reckoning drifts on the way"

    def _tolerances(self, pursuit: Pursuit, odometry: Odometry) -> tuple[float, float]:
        """Distance (m) and angle (rad) from the goal with which it ends."""
        if pursuit.elapsed <= SEARCH_RATIO * pursuit.time_limit:
            return self.tolerance, self.heading_tolerance
        sd = self._pose_sd(odometry)
        return max(self.tolerance, sd.position), max(self.heading_tolerance, sd.heading)

    def _try_again(self, pursuit: Pursuit, odometry: Odometry) -> FollowerStep:
        """Begin the next attempt, or give up."""
        pursuit = pursuit._replace(attempts=pursuit.attempts + 1)
        if pursuit.attempts >= self.attempts:
            cause = f"{_away(pursuit, odometry)} after {pursuit.attempts} attempts"
            cause = "; ".join((cause, *self.wheels.weaknesses()))
            return FollowerStep(pursuit, end="given_up", cause=cause)
        return FollowerStep(self._begin(pursuit, odometry))

    def _wheel_speed(self, odometry: Odometry) -> float:
        """Speed (m/s) of the faster wheel."""
        return abs(odometry.linear) + abs(odometry.angular) * 0.5 * self.track


def _suspends(stop: Stop | None) -> bool:
    """Whether a stop ends without regard to obstacles: by `resume`, or when a source has begun."""
    return stop is not None and stop.code != "" and (stop.latched or stop.code == STARTING)


def _away(pursuit: Pursuit, odometry: Odometry) -> str:
    """How far the robot is from the goal, and from its heading."""
    turn = abs(pursuit._replace(leg="aligning").heading_error(odometry))
    return f"{pursuit.distance(odometry) * 1000:.0f} mm and {degrees(turn):.1f} deg away"


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
