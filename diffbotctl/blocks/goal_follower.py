"""Drive to a pose: turn to its bearing, drive there, turn to its heading."""

from __future__ import annotations

from collections import deque
from collections.abc import Iterable
from math import atan2, copysign, cos, exp, hypot, pi, sin, sqrt
from typing import cast

from diffbotctl.block import Block, In, Out
from diffbotctl.control.motion_profile import MotionLimits, rest_to_rest_time, shortest_turn
from diffbotctl.messages import Goal, GoalEnd, GoalPhase, GoalState, Odometry, Stop, Twist
from diffbotctl.params import FromRobot, Param
from diffbotctl.time import SECOND

STILL_SPEED = 0.004  # m/s at the rim: below this a wheel is between two slots
SLOW_SPEED = 0.012  # m/s at the rim: it rolls on for about a millimetre; the next leg may begin
STILL_TIME = 60_000_000  # ns of stillness after which the pose is believed
MARGIN = 0.8  # of the braking limit: the rest is for what the motors add
STEER = 4.5  # 1/s: heading error to turn rate; a third of what the motors' lag allows
MAX_STEER = 1.0  # rad/s; a correction is not a turn
COAST_GAIN = 0.7  # share of a roll's surprise that is believed: the pose has its own errors
MIN_COAST_INNOVATION = 0.03  # m/s; slower, the surprise is the pose's alone
COAST_GAIN_HALF_SPEED = 0.03  # m/s; the release at which half of the surprise is believed
PIVOT = 2.5  # 1/s; place error to speed while turning
PIVOT_SHARE = 0.3  # of the rim's speed at most, so that no wheel changes its direction
LINE = 0.06  # m before the goal, from where the bearing to it says more of noise than of the way
PAUSE = {"turning": "driving", "driving": "aligning", "aligning": "judging"}


class GoalFollower(Block):
    """Reach one goal after another; say for each how it ended.

    The state goes turning, driving, aligning, each from rest to rest, then judges the pose and
    tries again when it is not within tolerance.
    """

    tolerance = Param(
        float, default=0.01, unit="m", above=0.0, help="Distance that counts as there."
    )
    heading_tolerance = Param(
        float, default=2 * pi / 180, unit="rad", above=0.0, help="Heading that counts as there."
    )
    reverse = Param(bool, default=False, help="May drive backwards where that is shorter.")
    creep = Param(
        float,
        default=0.035,
        unit="m/s",
        above=0.0,
        help="Least speed asked of a wheel: below it friction may hold one of the two.",
    )
    attempts = Param(int, default=6, minimum=1, maximum=50, help="Tries before a goal is given up.")
    patience = Param(
        float, default=10.0, unit="s", above=0.0, help="How long to wait at an obstacle."
    )
    stuck_after = Param(
        float, default=2.0, unit="s", above=0.0, help="Driving without moving so long is stuck."
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
    stop = In(Stop, trigger=False, optional=True, help="What holds the robot further on.")
    twist = Out(Twist)
    state = Out(GoalState)

    def reset(self) -> None:
        self.target: Goal | None = None
        self.seen: Goal | None = None
        self.phase = "idle"
        self.backwards = False
        self.halting = False
        self.tries = 0
        self.last: Odometry | None = None
        self.time = 0
        self.still_since: int | None = None
        self.clock = self.held = self.idle = 0.0
        self.allowed = 0.0
        self.line = 0.0
        self.pivot = (0.0, 0.0)
        self.roll = self.lag  # s; how far a wheel rolls on is this times its speed
        self.let_go = 0.0
        self.nudge = False  # what is left is too little to be driven, and too much to be left
        self.turning = 0.0  # rad/s at the last release of a turn
        self.sent: deque[tuple[int, float, float]] = deque([(0, 0.0, 0.0)])

    def react(
        self, now: int, odometry: Odometry | None, goal: Goal | None, stop: Stop | None
    ) -> tuple[Twist | None, GoalState | None] | None:
        if odometry is None or odometry is self.last:
            return None
        twist, state = self._follow(now, odometry, goal, stop)
        self.sent.append((now, twist.linear, twist.angular))
        return twist, state

    def _follow(
        self, now: int, odometry: Odometry, goal: Goal | None, stop: Stop | None
    ) -> tuple[Twist, GoalState | None]:
        step = 0.0 if self.last is None else (odometry.time - self.last.time) / SECOND
        self.last = odometry
        if goal is not None and goal is not self.seen:
            self._take(goal, odometry)
        if self.target is None:
            return Twist(now, 0.0, 0.0), None
        before = self.phase
        ended = self._clocks(step, odometry, stop)
        if ended is not None:
            return Twist(now, 0.0, 0.0), self._end(now, odometry, *ended)
        if stop is not None and stop.code and stop.latched:
            self.halting = True
            return Twist(now, 0.0, 0.0), None
        linear, angular = self._drive(now, odometry, step)
        if self.phase == "judging":
            verdict = self._judge(now, odometry)
            if verdict is not None:
                return Twist(now, 0.0, 0.0), verdict
        self.idle = self.idle if linear or angular else 0.0
        told = self._tell(now, odometry) if self.phase != before or not linear else None
        return Twist(now, linear, angular), told or self._tell(now, odometry)

    def _take(self, goal: Goal, odometry: Odometry) -> None:
        self.seen = goal
        if not goal.number:
            self.target, self.phase = None, "idle"
            return
        self.target = goal
        self.tries = 0
        self.clock = self.held = self.idle = 0.0
        limits = MotionLimits(
            self.speed, self.turn_rate, self.acceleration, self.braking, self.track
        )
        away = hypot(goal.x - odometry.x, goal.y - odometry.y)
        self.allowed = 30.0 + 5.0 * rest_to_rest_time(away, 0.0, pi, limits)
        self._begin(odometry)

    def _begin(self, odometry: Odometry) -> None:
        """Plan the three legs from here."""
        goal = self.target
        assert goal is not None
        self.halting, self.still_since = False, None
        self.nudge = self.tries > 0
        away = hypot(goal.x - odometry.x, goal.y - odometry.y)
        self.pivot = (odometry.x, odometry.y)
        if away <= 0.6 * self.tolerance:
            self.phase = "aligning"
            self._plant_pivot(odometry)
            return
        bearing = atan2(goal.y - odometry.y, goal.x - odometry.x)
        self.backwards = self.reverse and self._prefers_back(odometry, bearing)
        self.line = bearing + pi if self.backwards else bearing
        self.phase = "turning"

    def _plant_pivot(self, odometry: Odometry) -> None:
        """The last turn is about the goal itself: on the way round it can still come nearer."""
        goal = self.target
        assert goal is not None
        self.pivot = (goal.x, goal.y) if self.phase == "aligning" else (odometry.x, odometry.y)

    def _prefers_back(self, odometry: Odometry, bearing: float) -> bool:
        def turns(line: float) -> float:
            first = abs(shortest_turn(line - odometry.heading))
            goal = self.target
            assert goal is not None
            last = 0.0 if goal.heading is None else abs(shortest_turn(goal.heading - line))
            return first + last

        return turns(bearing + pi) < turns(bearing)

    def _drive(self, now: int, odometry: Odometry, step: float) -> tuple[float, float]:
        """The velocity for the leg under way; moves on to the next one at rest."""
        if self.halting:
            if not self._is_still(odometry):
                return 0.0, 0.0
            self.halting, self.still_since = False, None
            self._learn_roll(odometry)
            if self._is_leg_done(odometry, step):
                self.phase = PAUSE[self.phase]
                self._plant_pivot(odometry)
                if self.phase == "judging":
                    return 0.0, 0.0
        foresight = self._foresee(now, odometry)
        if self.phase == "driving":
            return self._drive_leg(odometry, foresight, step)
        return self._turn_leg(odometry, foresight, step)

    def _foresee(self, now: int, odometry: Odometry) -> tuple[float, float, float, float]:
        """Way, speed, turn and turn rate when a command of `now` takes hold."""
        delay = round(self.command_delay * SECOND)
        span = (odometry.time, now + delay)
        while len(self.sent) > 1 and self.sent[1][0] + delay <= odometry.time:
            self.sent.popleft()
        way, speed = predict_motion(
            odometry.linear, span, [(t + delay, v) for t, v, _ in self.sent], self.lag
        )
        turn, rate = predict_motion(
            odometry.angular, span, [(t + delay, w) for t, _, w in self.sent], self.lag
        )
        return way, speed, turn, rate

    def _turn_leg(
        self, odometry: Odometry, foresight: tuple[float, float, float, float], step: float
    ) -> tuple[float, float]:
        _, _, turn, rate = foresight
        arm = 0.5 * self.track
        left = self._turn_left(odometry) - turn
        rim = approach_speed(arm * left, arm * rate, self.roll, step, self._turn_limits())
        if rim == 0.0 and self.nudge:
            rim = copysign(self._turn_limits()[0], left)
        self.nudge = False
        if rim == 0.0:
            self.turning = rate
            self._release(abs(arm * rate))
            return 0.0, 0.0
        return self._hold_place(odometry, abs(rim)), rim / arm

    def _release(self, speed: float) -> None:
        """Let go at `speed` (m/s towards the goal of this leg) and see how far it rolls."""
        self.halting = True
        self.let_go = speed

    def _learn_roll(self, odometry: Odometry) -> None:
        """What is left of the way says how far a wheel truly rolls when it is let go."""
        if self.let_go < MIN_COAST_INNOVATION:
            return
        if self.phase == "driving":
            goal = self.target
            assert goal is not None
            east, north = goal.x - odometry.x, goal.y - odometry.y
            left = east * cos(self.line) + north * sin(self.line)
            left = (-left if self.backwards else left) - abs(odometry.linear) * self.roll
        else:
            left = abs(self._turn_left(odometry)) * 0.5 * self.track
            same = self._turn_left(odometry) * self.turning > 0.0
            rim = abs(odometry.angular) * 0.5 * self.track
            left = (left if same else -left) - rim * self.roll
        # A slow release says little: what the pose is wrong by weighs as much as the roll.
        belief = COAST_GAIN * self.let_go / (self.let_go + COAST_GAIN_HALF_SPEED)
        wanted = self.roll - belief * left / self.let_go
        self.roll = min(max(wanted, 0.4 * self.lag), 2.0 * self.lag)
        self.let_go = 0.0

    def _hold_place(self, odometry: Odometry, rim: float) -> float:
        """Forward speed that keeps a turn on its spot: motors of unequal strength would drift."""
        x, y = self.pivot
        aside = (x - odometry.x) * cos(odometry.heading) + (y - odometry.y) * sin(odometry.heading)
        most = PIVOT_SHARE * rim
        return min(max(PIVOT * aside, -most), most)

    def _drive_leg(
        self, odometry: Odometry, foresight: tuple[float, float, float, float], step: float
    ) -> tuple[float, float]:
        goal = self.target
        assert goal is not None
        way, speed, turn, _ = foresight
        east, north = goal.x - odometry.x, goal.y - odometry.y
        if hypot(east, north) > LINE:
            self.line = atan2(north, east) + (pi if self.backwards else 0.0)
        ahead = east * cos(self.line) + north * sin(self.line) - way
        linear = approach_speed(
            ahead, speed, self.roll, step, (self.creep, self.speed, self.braking * MARGIN)
        )
        if linear == 0.0 or linear * (-1.0 if self.backwards else 1.0) < 0.0:
            self._release(-speed if self.backwards else speed)
            return 0.0, 0.0
        error = shortest_turn(self.line - odometry.heading - turn)
        return linear, min(max(STEER * error, -MAX_STEER), MAX_STEER)

    def _turn_limits(self) -> tuple[float, float, float]:
        rim = min(self.speed, self.turn_rate * 0.5 * self.track)
        return min(self.creep, rim), rim, self.braking * MARGIN

    def _turn_left(self, odometry: Odometry) -> float:
        goal = self.target
        assert goal is not None
        wanted = self.line if self.phase == "turning" else goal.heading
        return 0.0 if wanted is None else shortest_turn(wanted - odometry.heading)

    def _is_leg_done(self, odometry: Odometry, step: float) -> bool:
        if self.phase == "driving":
            return True
        limit = self.heading_tolerance * (1.5 if self.phase == "turning" else 0.8)
        left = abs(self._turn_left(odometry))
        if left <= limit:
            return True
        # Where the motors are slow, what is left may be too little to be driven.
        return (
            approach_speed(0.5 * self.track * left, 0.0, self.roll, step, self._turn_limits())
            == 0.0
        )

    def _is_still(self, odometry: Odometry) -> bool:
        rim = abs(odometry.linear) + abs(odometry.angular) * 0.5 * self.track
        if PAUSE[self.phase] != "judging":
            return rim <= SLOW_SPEED
        if rim > STILL_SPEED:
            self.still_since = None
        elif self.still_since is None:
            self.still_since = odometry.time
        return self.still_since is not None and odometry.time - self.still_since >= STILL_TIME

    def _judge(self, now: int, odometry: Odometry) -> GoalState | None:
        goal = self.target
        assert goal is not None
        away = hypot(goal.x - odometry.x, goal.y - odometry.y)
        self.phase = "aligning"
        turn = abs(self._turn_left(odometry))
        if away <= self.tolerance and turn <= self.heading_tolerance:
            return self._end(now, odometry, "reached", "")
        self.tries += 1
        if self.tries >= self.attempts:
            cause = f"still {away * 1000:.0f} mm away after {self.tries} tries"
            return self._end(now, odometry, "stuck", cause)
        self._begin(odometry)
        return None

    def _clocks(
        self, step: float, odometry: Odometry, stop: Stop | None
    ) -> tuple[GoalEnd, str] | None:
        """Let the clocks run; (state, cause) when one of them ends the goal."""
        if stop is not None and stop.code and stop.latched:
            return None  # a held robot is neither late nor stuck
        if stop is not None and stop.code:
            self.held += step
            if self.held > self.patience:
                return "blocked", f"{stop.cause}, for {self.patience:g} s"
            return None
        self.held = 0.0
        self.clock += step
        if self.clock > self.allowed:
            return "timed_out", f"not there after {self.allowed:.0f} s"
        rim = abs(odometry.linear) + abs(odometry.angular) * 0.5 * self.track
        moving = rim > STILL_SPEED
        self.idle = 0.0 if moving or self.halting else self.idle + step
        if self.idle > self.stuck_after:
            return "stuck", f"no wheel turned for {self.stuck_after:g} s of driving"
        return None

    def _tell(self, now: int, odometry: Odometry) -> GoalState:
        goal = self.target
        assert goal is not None
        away = hypot(goal.x - odometry.x, goal.y - odometry.y)
        phase = cast(GoalPhase, self.phase)  # `judging` lasts no longer than one call of `react`
        return GoalState(now, goal.number, phase, away, self._turn_left(odometry))

    def _end(self, now: int, odometry: Odometry, state: GoalEnd, cause: str) -> GoalState:
        self.phase = "aligning"
        told = self._tell(now, odometry)._replace(state=state, cause=cause)
        self.target, self.phase = None, "idle"
        return told


def approach_speed(
    left: float,
    speed: float,
    lag: float,
    step: float,
    limits: tuple[float, float, float],
) -> float:
    """The speed (m/s) to ask for with `left` metres to go at `speed`; 0 when it is time to let go.

    A motor that is let go rolls on by its speed times its `lag` (s): only what remains beyond that
    is still to be driven. `limits` are the least and the most speed (m/s) and the braking (m/s2);
    `step` (s) is the time until the next command.
    """
    least, most, braking = limits
    direction = copysign(1.0, left)
    rolling = max(direction * speed, 0.0)
    rest = abs(left) - rolling * lag
    if rest <= 0.5 * least * step + 0.25 * least * lag:
        return 0.0
    wanted = sqrt(2.0 * braking * rest)
    if step > 0.0:
        wanted = min(wanted, rolling + rest / (step + lag))
    return direction * min(max(wanted, least), most)


def predict_motion(
    speed: float, span: tuple[int, int], sent: Iterable[tuple[int, float]], lag: float
) -> tuple[float, float]:
    """Way and speed at the end of `span` (ns), from `speed` at its start.

    `sent` are the commands by the time (ns) when they take hold, in order; the speed follows them
    with `lag` (s).
    """
    at, end = span
    way, wanted = 0.0, 0.0
    for time, command in (*sent, (end, 0.0)):
        until = min(max(time, at), end)
        seconds = (until - at) / SECOND
        fade = exp(-seconds / lag)
        way += wanted * seconds + (speed - wanted) * lag * (1.0 - fade)
        speed = wanted + (speed - wanted) * fade
        at, wanted = until, command
    return way, speed
