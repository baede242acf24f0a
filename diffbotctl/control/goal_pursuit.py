"""State of the motion to one goal, and the adaptive estimate of how far the wheels coast."""

from __future__ import annotations

from math import atan2, cos, degrees, hypot, inf, pi, sin, sqrt
from typing import Literal, NamedTuple

from diffbotctl.control.motion_profile import shortest_turn
from diffbotctl.messages import Goal, Odometry

COAST_SD = 0.25  # s; of the coast time before the first release: lags are up to 0.4 s
# s2/m; of its growth with the speed before the first release. Dry friction of 1 m/s2 makes it 0.5.
COAST_GROWTH_SD = 0.5
# Standard deviation of the coast time that odometry reports: relative, and s.
REPORTED_SD_RATIO, REPORTED_SD_MIN = 0.3, 0.1
COAST_DRIFT = 0.012  # s; change of the coast time from one release to the next
COAST_NOISE = 0.01  # s; of the coast time that one release shows
POSE_NOISE = 0.002  # m; of the distance that one release shows
COAST_SPEED_MIN = 0.005  # m/s; below it the innovation is mostly error of the pose
COAST_RATIO_MIN = 0.4  # least coast time, relative to the motors' lag
COAST_TIME_MAX = 0.6  # s

STALL_RATIO = 0.8  # of an angle; if more of it remains, friction has held the wheels
# A pose that is known less well does not prove the goal. Multiple of a tolerance,
UNSURE_RATIO = 3.0
# or of the position, of what the tolerance of the heading is to the side at the end of the way,
UNSURE_ASIDE_RATIO = 1.5
UNSURE_ASIDE_MAX = 0.1  # m, of that

STRAIGHT_ANGLE = 180.0  # deg

# m to the goal per metre of the radius of the first turn; from nearer, it would drive around it.
TURN_WAY_RADII = 4.0

PLACE_RADIUS = 0.05  # m; stops within it are one: more than a reading's noise, less than a robot

Leg = Literal["turning", "driving", "aligning"]


class Coast(NamedTuple):
    """Estimate of the coast time: released wheels travel their speed times it further.

    With motors that brake by their current it is their lag at any speed; with dry friction it grows
    with the speed.
    """

    time: float
    """s, of slow wheels"""
    release_speed: float = 0.0
    """m/s towards the end of the leg, at the last release; 0 after it was used for an update"""
    release_turn_rate: float = 0.0
    """rad/s, at the last release of a turn"""
    variance: float = COAST_SD * COAST_SD
    """s2; of `time`"""
    growth: float = 0.0
    """s2/m; of the coast time with the speed; no friction makes it shrink"""
    growth_variance: float = COAST_GROWTH_SD * COAST_GROWTH_SD
    """s4/m2"""
    covariance: float = 0.0
    """s3/m; of `time` and `growth`"""
    release_time: float = 0.0
    """s; the coast time that the last release was planned with"""

    def at(self, speed: float) -> float:
        """The coast time (s) of wheels released at `speed` (m/s)."""
        return self.time + self.growth * abs(speed)

    def expected(self, speed: float, reported: float) -> float:
        """The coast time (s) to plan a release at `speed` (m/s) with; odometry's is `reported`.

        It is the mean of the learnt and the reported time, weighted by their variances. A shorter
        reported time does not count: the friction of the motor model stops a slow wheel at
        once, before a real motor has lost its current.
        """
        learnt = self.at(speed)
        if reported <= learnt:
            return learnt
        variance = (
            self.variance
            + 2.0 * self.covariance * abs(speed)
            + self.growth_variance * speed * speed
        )
        reported_variance = max(REPORTED_SD_RATIO * reported, REPORTED_SD_MIN) ** 2
        return learnt + (reported - learnt) * variance / (variance + reported_variance)

    def learn(self, remaining: float, lag: float) -> Coast:
        """Kalman update by the `remaining` distance (m) of the leg at rest. `lag` of the motors in
        s."""
        speed = self.release_speed
        noise = COAST_NOISE * COAST_NOISE + (POSE_NOISE / speed) ** 2
        time_row = self.variance + self.covariance * speed
        growth_row = self.covariance + self.growth_variance * speed
        variance = time_row + growth_row * speed + noise
        innovation = (self.release_time - remaining / speed - self.at(speed)) / variance
        time = self.time + time_row * innovation
        growth = self.growth + growth_row * innovation
        lowest, highest = COAST_RATIO_MIN * lag, max(COAST_TIME_MAX, 2.0 * lag)
        time = min(max(time, lowest), highest)
        return self._replace(
            time=time,
            growth=min(max(growth, 0.0), (highest - time) / speed),
            release_speed=0.0,
            variance=self.variance - time_row * time_row / variance + COAST_DRIFT * COAST_DRIFT,
            growth_variance=self.growth_variance - growth_row * growth_row / variance,
            covariance=self.covariance - time_row * growth_row / variance,
        )


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
    """point (m) that the robot holds during a turn on the spot"""
    turn_radius: float = 0.0
    """m from the middle of the axle to the point about which it turns; 0: on the spot"""
    turned: float = 0.0
    """rad that the robot has turned in this leg, in either direction"""
    opposed_turn: float = 0.0
    """rad that the robot has turned against its command, less those it has turned back"""
    is_coasting: bool = False
    """released or stopped; the leg continues, or the next one begins, at rest"""
    still_since: int | None = None
    """ns"""
    needs_nudge: bool = False
    """turn at the least speed although the remaining angle is too small for it"""
    pushed_for: float = 0.0
    """s for which the wheels were driven since the last release"""
    releases: int = 0
    """in this turn; a small one may need several"""
    stalls: int = 0
    """successive releases that have not turned the robot"""
    overshoots: int = 0
    """releases after which the robot had turned too far, since the last one that did not turn it"""
    rest_error: float = inf
    """rad that remained after the last release"""
    attempts: int = 0
    start_distance: float = inf
    """m to the goal when it was accepted"""
    elapsed: float = 0.0
    """s, not counting stops"""
    blocked_for: float = 0.0
    """s, of all stops at one place"""
    blocked_at: tuple[float, float] | None = None
    """m; the place of the first of them"""
    idle_for: float = 0.0
    """s of being driven without moving"""

    def count_block(self, odometry: Odometry, is_stopped: bool, seconds: float) -> Pursuit:
        """Count the time at stops. One that begins again at the same place goes on."""
        at = self.blocked_at or (odometry.x, odometry.y)
        if is_stopped:
            return self._replace(blocked_for=self.blocked_for + seconds, blocked_at=at)
        if hypot(odometry.x - at[0], odometry.y - at[1]) <= PLACE_RADIUS:
            return self
        return self._replace(blocked_for=0.0, blocked_at=None)

    def begin(
        self, odometry: Odometry, tolerance: float, may_reverse: bool, turn_radius: float
    ) -> Pursuit:
        """Plan the legs from this pose; within `tolerance` (m) of the goal, only the last turn.

        `turn_radius` (m) is that of the first turn, if the goal is far enough away for it.
        """
        goal, position = self.goal, (odometry.x, odometry.y)
        state = self._replace(
            is_coasting=False,
            still_since=None,
            needs_nudge=self.attempts > 0,
            pushed_for=0.0,
            pivot=position,
            turn_radius=0.0,
        ).restart_turn()
        if self.distance(odometry) <= tolerance:
            return state._replace(leg="aligning", pivot=(goal.x, goal.y))
        bearing = atan2(goal.y - odometry.y, goal.x - odometry.x)
        is_backwards = may_reverse and (
            self._turns(odometry, bearing + pi) < self._turns(odometry, bearing)
        )
        is_near = self.distance(odometry) < TURN_WAY_RADII * turn_radius
        return state._replace(
            leg="turning",
            line=bearing + pi if is_backwards else bearing,
            is_backwards=is_backwards,
            turn_radius=0.0 if is_backwards or is_near else turn_radius,
        )

    def restart_turn(self) -> Pursuit:
        """Before the first release of a turn."""
        return self._replace(releases=0, stalls=0, rest_error=inf, turned=0.0)

    def count_release(self, odometry: Odometry) -> Pursuit:
        """Count a release after which the turn is not done, and whether it had an effect."""
        error = self.heading_error(odometry)
        has_stalled = error * self.rest_error > STALL_RATIO * self.rest_error * self.rest_error
        has_overshot = self.rest_error < inf and error * self.rest_error < 0.0
        return self._replace(
            releases=self.releases + 1,
            stalls=self.stalls + 1 if has_stalled else 0,
            overshoots=0 if has_stalled else self.overshoots + has_overshot,
            needs_nudge=self.needs_nudge or has_stalled,
            pushed_for=0.0,
            rest_error=error,
        )

    def aim(self, odometry: Odometry) -> Pursuit:
        """Point `line` at the goal from this pose."""
        bearing = atan2(self.goal.y - odometry.y, self.goal.x - odometry.x)
        return self._replace(line=bearing + pi if self.is_backwards else bearing)

    def turn_again(self, odometry: Odometry) -> Pursuit:
        """Stop a drive in a wrong direction, and turn to the goal on the spot."""
        coast = self.coast._replace(release_speed=0.0)
        state = self._replace(leg="turning", is_coasting=True, coast=coast)
        return state.turn_on_the_spot(odometry).restart_turn().aim(odometry)

    def turn_on_the_spot(self, odometry: Odometry) -> Pursuit:
        """Turn about the present position from now on."""
        return self._replace(turn_radius=0.0, pivot=(odometry.x, odometry.y))

    def watch_turn(self, turn_rate: float, command: float, seconds: float) -> Pursuit:
        """Sum up how far the robot turns at `turn_rate`, and how far against its `command`."""
        step = abs(turn_rate) * seconds
        opposed = self.opposed_turn + (step if turn_rate * command < 0.0 else -step)
        opposed = max(opposed, 0.0)
        return self._replace(turned=self.turned + step, opposed_turn=opposed)

    def stop_opposed_turn(self, odometry: Odometry) -> Pursuit:
        """Release the wheels of a robot that turns against its command, and turn anew at rest."""
        return self.released(0.0, odometry).restart_turn()

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

    def coast_time(self, speed: float, odometry: Odometry) -> float:
        """Coast time (s) of wheels released at `speed` (m/s)."""
        return self.coast.expected(speed, odometry.coast_time)

    def released(self, speed: float, odometry: Odometry, turn_rate: float | None = None) -> Pursuit:
        """Coast after a release at `speed` (m/s) and, in a turn, at `turn_rate` (rad/s)."""
        time = self.coast_time(speed, odometry)
        coast = self.coast._replace(release_speed=speed, release_time=time)
        if turn_rate is not None:
            coast = coast._replace(release_turn_rate=turn_rate)
        return self._replace(is_coasting=True, coast=coast)

    def learn_coast(self, odometry: Odometry, arm: float, lag: float) -> Pursuit:
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
            remaining = abs(error) * arm
            remaining = remaining if error * coast.release_turn_rate > 0.0 else -remaining
            speed = abs(odometry.angular) * arm
        return self._replace(coast=coast.learn(remaining - speed * coast.at(speed), lag))


class PoseSd(NamedTuple):
    """How well a pose is known: standard deviations."""

    position: float
    """m, in its worst direction"""
    heading: float
    """rad"""

    @classmethod
    def of(cls, odometry: Odometry, counts_geometry: bool) -> PoseSd:
        """Without `counts_geometry` the error of the geometry is left out: that of a robot that is
        not calibrated would exceed any tolerance."""
        xx, xy, _, yy, _, hh = odometry.covariance
        position = largest_variance(xx, xy, yy)
        if not counts_geometry:
            position -= odometry.geometry_sd * odometry.geometry_sd
            hh -= odometry.geometry_heading_sd * odometry.geometry_heading_sd
        return cls(sqrt(max(position, 0.0)), sqrt(max(hh, 0.0)))

    def doubt(
        self, tolerance: float, heading_tolerance: float, aside: float, has_warning: bool
    ) -> str:
        """What of the pose is known too badly to prove that it is within both tolerances (m, rad);
        empty if nothing is.

        A pose with a warning must be known within the tolerances. Dead reckoning is never as good
        as that over a long way: any other pose must be known within UNSURE_RATIO times them, or the
        position about as well as the tolerance of the heading asks: `aside` (m) is what a robot
        misses the goal by whose heading is off by it on the whole way.
        """
        if not has_warning:
            aside = min(UNSURE_ASIDE_RATIO * aside, UNSURE_ASIDE_MAX)
            tolerance = max(UNSURE_RATIO * tolerance, aside)
            heading_tolerance *= UNSURE_RATIO
        known = []
        if self.position > tolerance:
            known.append(f"the position is known to {length_text(self.position)}")
        if self.heading > heading_tolerance:
            turn = min(degrees(self.heading), STRAIGHT_ANGLE)  # a larger one means as little
            known.append(f"the heading is known to {turn:.1f} deg")
        return f"{' and '.join(known)} (standard deviation)" if known else ""


def length_text(length: float) -> str:
    """A length (m) in millimetres, or from a metre on in metres."""
    return f"{length * 1000:.0f} mm" if length < 1.0 else f"{length:.1f} m"


def largest_variance(xx: float, xy: float, yy: float) -> float:
    """Variance (m2) of a position in its worst direction: the larger eigenvalue."""
    half_difference = 0.5 * (xx - yy)
    return 0.5 * (xx + yy) + sqrt(half_difference * half_difference + xy * xy)
