"""Goal follower: turn to the bearing of the goal, drive to it, turn to its heading."""

from __future__ import annotations

from collections import deque
from collections.abc import Mapping
from math import degrees, hypot, pi

from diffbotctl.block import Block, In, Out
from diffbotctl.control.coast import COAST_TIME_MAX
from diffbotctl.control.goal_motion import STILL_SPEED_MAX, GoalMotion, MotionView, Phase, Pursuit
from diffbotctl.control.motion_profile import MotionLimits, predict_motion, rest_to_rest_time
from diffbotctl.control.pose_sd import PLACE_RADIUS, PoseSd
from diffbotctl.control.velocity_limits import VelocityRate
from diffbotctl.control.wheel_response import GAP_MAX, DriveResponse
from diffbotctl.estimation.geometry_deviation import GEOMETRY, TRACK
from diffbotctl.messages import (
    STARTING,
    Encoders,
    Goal,
    GoalEnd,
    GoalPhase,
    GoalState,
    Odometry,
    Stop,
    Twist,
)
from diffbotctl.params import FromRobot, Param
from diffbotctl.time import SECOND

TIME_LIMIT_BASE, TIME_LIMIT_RATIO = 30.0, 5.0  # s, and multiple of the shortest possible time
# Of the time limit. After it, a robot need not come nearer to the goal than its pose is known (one
# standard deviation): more attempts would follow the error of the pose.
SEARCH_RATIO = 1.0 / 3.0
WEAK_SPEED_RATIO = 0.5  # of the speed limit; below it a weak wheel is not reported
# Slow motors turn evenly at lower speeds than `creep`: at this part of their top speed, if the
# encoder then still counts often enough for the speed loop (1/s).
CREEP_SPEED_RATIO, CREEP_COUNTS = 0.1, 4.0
TURN_RADIUS_MAX = 0.15  # m; in wider turns about a wheel it would move too far away from its goal
# m; a goal whose position is known less well than this, and than it was far away, is not reached.
LOST_MIN = 0.3
LOST_EDGES_PROBABILITY_MAX = 0.5  # an encoder that is likelier broken than not
HEADING_SD_MAX = 60 * pi / 180  # rad; with it no way leads to the goal but by chance
OPPOSED_TURN_MAX = 120 * pi / 180  # rad against the commands; more than any motor coasts
FARTHER_MAX = 0.12  # m beyond the distance at the start; the robot does not obey
LIMITED_STEP_MAX = 0.1  # s; block speed_limiter starts anew after a longer silence
FULL_DUTY = 0.98  # duty; more than a motor can be given


class GoalFollower(Block):
    """Drive to one goal after another, and report how each ended.

    It turns, drives and aligns, each from rest to rest; a robot that has come too far backs up. If
    the final pose is not within tolerance, it tries again.
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
    reverse = Param(
        bool,
        default=False,
        help="Allow driving backwards where it is shorter. Without it, the robot backs up only by "
        "2 cm, or over ground that it has just driven over.",
    )
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
        slowest = max(CREEP_SPEED_RATIO * top_speed, CREEP_COUNTS * pitch)
        self.least_speed = min(self.creep, slowest)  # m/s, of a wheel
        self.motion = GoalMotion(
            MotionLimits(self.speed, self.turn_rate, self.acceleration, self.braking, self.track),
            self.least_speed,
            self.lag,
            self._first_turn_radius(),
            self.reverse,
            self.wheels,
        )

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
        linear = angular = 0.0
        if goal is not None and goal is not self.last_goal:
            self.last_goal = goal
            state = self._replace_goal(now, goal, odometry, seconds)
        if self.pursuit is None:
            self.last_encoders = None  # what is counted between two goals is not of interest
        else:
            self._observe_wheels(odometry, encoders, seconds)
            if _suspends(stop):  # this time does not count
                self.pursuit = self.pursuit._replace(is_released=True, still_since=None)
            else:
                end, linear, angular = self._advance(now, odometry, stop, seconds)
                state = state or _goal_state(now, odometry, self.pursuit, *end)
                twist = Twist(now, *self.wheels.compensated(linear, angular, self.speed))
                self.pursuit = None if end[0] else self.pursuit
        rate = VelocityRate(self.acceleration, self.braking, self.track)
        time, *before = self.sent[-1]
        step = min((now - time) / SECOND, LIMITED_STEP_MAX)
        self.sent.append((now, *rate.limited((before[0], before[1]), (linear, angular), step)))
        return twist, state

    def _replace_goal(
        self, now: int, goal: Goal, odometry: Odometry, seconds: float
    ) -> GoalState | None:
        """Take the operator's goal, or withdraw the present one; the end of the one before."""
        former = self.pursuit or self.withdrawn
        if not goal.number:
            self.pursuit, self.withdrawn = None, former
            return None
        self.pursuit, self.withdrawn = self._accept(now, goal, odometry, seconds), None
        if former is None or former.goal.number == goal.number:
            return None
        return _goal_state(now, odometry, former, "cancelled", f"replaced by goal {goal.number}")

    def _accept(self, now: int, goal: Goal, odometry: Odometry, seconds: float) -> Pursuit:
        self.wheels.begin()
        pursuit = Pursuit(goal)
        distance = pursuit.distance(odometry)
        shortest_time = rest_to_rest_time(distance, 0.0, pi, self.motion.limits)
        time_limit = TIME_LIMIT_BASE + TIME_LIMIT_RATIO * shortest_time
        pursuit = pursuit._replace(start_distance=distance, time_limit=time_limit)
        planned = self.motion.plan(pursuit, self._view(now, pursuit, odometry, seconds))
        return planned or pursuit._replace(phase=Phase.ALIGNING, is_released=True)

    def _observe_wheels(
        self, odometry: Odometry, encoders: Encoders | None, seconds: float
    ) -> None:
        """Compare the speed of each wheel with its command."""
        half_track, lag = 0.5 * self.track, self._lag
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

    @property
    def _lag(self) -> float:
        """Lag (s) of the motors: that of the robot file, or more if they coast for longer."""
        return max(self.lag, self.motion.coast.time)

    def _drop_effective(self, odometry: Odometry) -> None:
        """Remove commands that took effect before the time of the pose, except the last."""
        delay = round(self.command_delay * SECOND)
        while len(self.sent) > 1 and self.sent[1][0] + delay <= odometry.time:
            self.sent.popleft()

    def _advance(
        self, now: int, odometry: Odometry, stop: Stop | None, seconds: float
    ) -> tuple[tuple[GoalEnd | None, str], float, float]:
        """The end of the goal and its cause, or the velocity (m/s, rad/s)."""
        assert self.pursuit is not None
        pursuit = self._count_time(self.pursuit, odometry, stop, seconds)
        end = self._timeout(pursuit, odometry, stop) or self._disobeys(pursuit, odometry)
        linear = angular = 0.0
        if end is None:
            view = self._view(now, pursuit, odometry, seconds)
            pursuit, linear, angular, has_arrived = self.motion.advance(pursuit, view)
            if has_arrived:
                end = self._judge(pursuit, odometry)
            elif pursuit.attempts >= self.attempts:
                cause = f"{_away(pursuit, odometry)} after {pursuit.attempts} attempts"
                end = "given_up", "; ".join((cause, *self.wheels.weaknesses()))
        if end is not None or not (linear or angular):
            pursuit = pursuit._replace(idle_for=0.0)
        self.pursuit = pursuit
        return (end, 0.0, 0.0) if end is not None else ((None, ""), linear, angular)

    def _count_time(
        self, pursuit: Pursuit, odometry: Odometry, stop: Stop | None, seconds: float
    ) -> Pursuit:
        """Stops do not count, but as one if they are at one place."""
        at = pursuit.blocked_at or (odometry.x, odometry.y)
        if stop is not None and stop.code:
            return pursuit._replace(blocked_for=pursuit.blocked_for + seconds, blocked_at=at)
        if hypot(odometry.x - at[0], odometry.y - at[1]) > PLACE_RADIUS:
            pursuit = pursuit._replace(blocked_for=0.0, blocked_at=None)
        is_still = self.motion.wheel_speed(odometry) <= STILL_SPEED_MAX
        is_idle = is_still and not self.wheels.has_counted and not pursuit.is_released
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
        fault = self.wheels.fault(self.least_speed, self.stuck_after, self._lag)
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

    def _view(self, now: int, pursuit: Pursuit, odometry: Odometry, seconds: float) -> MotionView:
        """What is known of the motion when a command that is sent now takes effect."""
        delay = round(self.command_delay * SECOND)
        commands = [(time + delay, linear, angular) for time, linear, angular in self.sent]
        # Odometry learns the motors on the way; until the first stop, nothing else does.
        lag = max(self._lag, min(odometry.coast_time, COAST_TIME_MAX))
        predicted = predict_motion(odometry, now + delay, commands, lag)
        tolerances = self._tolerances(pursuit, odometry)
        return MotionView(odometry, predicted, self.sent[-1][2], lag, seconds, tolerances)

    def _judge(self, pursuit: Pursuit, odometry: Odometry) -> tuple[GoalEnd, str]:
        """How a goal ends within whose tolerances the robot is at rest."""
        distance, turn = pursuit.distance(odometry), abs(pursuit.final_error(odometry))
        sd = self._pose_sd(odometry)
        # A fault that is possible, but less probable than not, leaves the goal the likelier place.
        is_likely_there = odometry.lost_edges_probability > 0.0
        if sd.position > max(LOST_MIN, pursuit.start_distance) and not is_likely_there:
            cause = (
                f"it is not known where the robot is: to {sd.position:.1f} m (standard deviation), "
                f"and the goal was {pursuit.start_distance:.1f} m away: {self._why(odometry)}"
            )
            return "given_up", cause
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
        return "reached_unsure" if doubt else "reached", doubt

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


def _suspends(stop: Stop | None) -> bool:
    """Whether a stop ends without regard to obstacles: by `resume`, or when a source has begun."""
    return stop is not None and stop.code != "" and (stop.latched or stop.code == STARTING)


def _away(pursuit: Pursuit, odometry: Odometry) -> str:
    """How far the robot is from the goal, and from its heading."""
    turn = abs(pursuit.final_error(odometry))
    return f"{pursuit.distance(odometry) * 1000:.0f} mm and {degrees(turn):.1f} deg away"


def _goal_state(
    now: int, odometry: Odometry, pursuit: Pursuit, end: GoalEnd | None, cause: str = ""
) -> GoalState:
    turn = pursuit.final_error(odometry) if end else pursuit.heading_error(odometry)
    state: GoalPhase | GoalEnd = pursuit.phase.value if end is None else end
    return GoalState(now, pursuit.goal.number, state, pursuit.distance(odometry), turn, cause)
