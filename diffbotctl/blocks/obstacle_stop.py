"""Obstacle stop: a wanted velocity and a distance in, one that can still stop in time out."""

from __future__ import annotations

from math import sqrt
from typing import Any

from diffbotctl.block import Block, FromRobot, In, Out
from diffbotctl.messages import Range, Resume, Stop, StopCode, Twist
from diffbotctl.params import Param

STALE: StopCode = "range_stale"
FAULT: StopCode = "range_fault"
TOO_CLOSE: StopCode = "too_close"
OBSTACLE: StopCode = "obstacle"
CYCLE = 0.0252  # s; a Sharp sensor's longest cycle and its settling (data sheet ED-05G101)
RELEASE = 0.02  # m farther than it stopped before it drives on; a reading at 20 cm wobbles by 3 mm


class ObstacleStop(Block):
    """Let the robot drive forward only as fast as it can still stop in front of what it sees.

    Near an obstacle it slows down, nearer it stops; a sensor that is too close, faulty or silent
    counts as an obstacle. Turning and backing away stay allowed. It stands behind the limiter, so
    its stops are not ramped.

    blocks:
      guard: {block: obstacle_stop, in: {twist: limiter.twist, range: range.range}}
    """

    margin = Param(
        float,
        unit="m",
        default=0.05,
        minimum=0.0,
        live=True,
        help="Distance between the robot's front and the obstacle where it comes to stand.",
    )
    reaction = Param(
        float,
        unit="s",
        default=None,
        none=True,
        minimum=0.0,
        maximum=2.0,
        help="Time from the obstacle coming into view to the wheels slowing down; none: reckoned "
        "from the sensor's cycle, the telemetry, the debouncing, the command's way and the motors.",
    )
    slowest = Param(
        float,
        unit="m/s",
        default=0.05,
        above=0.0,
        live=True,
        help="Where it may only drive slower than this, it stops.",
    )
    debounce = Param(
        int,
        default=2,
        minimum=1,
        maximum=20,
        live=True,
        help="So many readings in a row stop the robot, or let it go on.",
    )
    stale_after = Param(
        float,
        unit="s",
        default=0.2,
        minimum=0.02,
        maximum=1.0,
        help="A distance older than this counts as none.",
    )
    resume_by = Param(
        str,
        key="resume",
        default="by_itself",
        choices=("by_itself", "wait"),
        live=True,
        help="After an obstacle has gone: drive on by itself, or wait for a person to resume.",
    )
    sensor = Param(
        str,
        none=True,
        default=None,
        help="Sensor that the distance comes from; none: the robot's first.",
    )
    braking = FromRobot("limits.braking")
    telemetry = FromRobot("board.telemetry")
    command_delay = FromRobot("link.command_delay")
    lag = FromRobot("drive.left.motor.lag")
    front = FromRobot("body.front")
    sensors = FromRobot("sensors")

    twist = In(Twist, fresh_for=0.5, help="The wanted velocity.")
    range = In(Range, fresh_for="stale_after", help="The distance to what is ahead.")
    resume = In(Resume, optional=True, help="A person's consent to drive on.")
    safe = Out(Twist, name="twist", help="The velocity that is allowed.")
    stop = Out(Stop, help="What holds the robot, and that it is released.")

    def reset(self) -> None:
        mounted: Any = self.sensors.get(self.sensor or next(iter(self.sensors), ""))
        self.setback = self.front - mounted.at.x if mounted else 0.0
        self.react_within = self.reaction
        if self.reaction is None:
            self.react_within = reaction_time(
                self.telemetry, self.debounce, self.command_delay, self.lag
            )
        self.last_range = -1  # time of the last reading that was counted
        self.blocked = 0  # readings in a row that say stop
        self.free = 0  # readings in a row that say go
        self.held = ("", "")  # code and cause; empty while nothing holds
        self.told = ""  # code of the last Stop that was sent
        self.is_latched = False
        self.is_slowing = False  # for something that is still far enough away
        self.consent: Resume | None = None  # the last one that was heard

    def react(
        self, now: int, twist: Twist | None, range: Range | None, resume: Resume | None
    ) -> tuple[Twist | None, Stop | None]:
        gap = self._look(range)
        if resume is not None and resume is not self.consent:
            self.consent = resume
            # Consent while the obstacle still stands there would set the robot off later, unseen.
            self.is_latched = self.is_latched and self.held[0] != ""
        if twist is None:
            return None, self._tell(now, wants_forward=False)
        wants_forward = twist.linear > 0.0
        told = self._tell(now, wants_forward)
        if not wants_forward:
            return twist._replace(time=now), told
        if self.held[0] or self.is_latched:
            return Twist(now, 0.0, twist.angular), told
        limit = max_safe_speed(gap - self.margin, self.braking, self.react_within)
        if (twist.linear > limit) != self.is_slowing:
            self._tell_slowing(gap)
        return limit_to(twist, limit, now), told

    def _tell_slowing(self, gap: float) -> None:
        self.is_slowing = not self.is_slowing
        if self.log.debugs:
            does = "slows down for" if self.is_slowing else "drives at full speed again with"
            self.log.debug(f"{does} what is {gap * 100:.0f} cm ahead")

    def _look(self, range: Range | None) -> float:
        """Take the newest reading into account; return the free distance before the front."""
        if range is None:
            self._hold(STALE, "no fresh distance comes from the sensor")
            return 0.0
        gap = range.distance - self.setback
        if range.time == self.last_range:
            return gap
        self.last_range = range.time
        if range.state == "fault":
            self._hold(FAULT, "the distance sensor is faulty")
        elif range.state == "too_close":
            self._hold(TOO_CLOSE, "something is closer than the sensor can measure")
        elif range.state == "clear":
            self._count(False)
        else:
            limit = self.margin + stopping_distance(self.slowest, self.braking, self.react_within)
            self._count(gap <= limit + (RELEASE if self.held[0] else 0.0), gap)
        return gap if range.state != "clear" else float("inf")

    def _hold(self, code: str, cause: str) -> None:
        self.held, self.free = (code, cause), 0

    def _count(self, is_blocked: bool, gap: float = 0.0) -> None:
        self.blocked = self.blocked + 1 if is_blocked else 0
        self.free = 0 if is_blocked else self.free + 1
        if self.blocked >= self.debounce:
            self._hold(OBSTACLE, f"something stands {max(gap, 0.0) * 100:.0f} cm ahead")
        elif not is_blocked and (self.free >= self.debounce or self.held[0] == STALE):
            self.held = ("", "")

    def _tell(self, now: int, wants_forward: bool) -> Stop | None:
        """A Stop when the robot begins or ceases to be held back from driving forward."""
        code, cause = self.held
        if wants_forward and code and code != self.told:
            must_wait = self.resume_by == "wait" and code != STALE
            self.is_latched = self.is_latched or must_wait
            self.told = code
            return Stop(now, code, cause, self.is_latched)
        if self.told and not code and not self.is_latched:
            self.told = ""
            return Stop(now, "", "", False)
        return None


def reaction_time(rate: float, debounce: int, delay: float, lag: float) -> float:
    """Seconds from an obstacle coming into view to the wheels slowing down, at the longest.

    `rate` of the telemetry in Hz, readings that must agree, `delay` of a command and `lag` of the
    motors in s.
    """
    return CYCLE + debounce / rate + delay + lag


def stopping_distance(speed: float, braking: float, reaction: float) -> float:
    """Metres driven from `speed` to standstill: m/s, m/s2, s of driving on before braking."""
    return speed * speed / (2 * braking) + speed * reaction


def max_safe_speed(free: float, braking: float, reaction: float) -> float:
    """Highest speed in m/s from which the robot stands within `free` metres; 0 when there are none.

    The inverse of `stopping_distance`.
    """
    if free <= 0.0:
        return 0.0
    if free == float("inf"):
        return free
    return braking * (sqrt(reaction * reaction + 2 * free / braking) - reaction)


def limit_to(twist: Twist, limit: float, now: int) -> Twist:
    """`twist` at no more than `limit` m/s forward, on the same curve."""
    if twist.linear <= limit:
        return twist._replace(time=now)
    return Twist(now, limit, twist.angular * limit / twist.linear)
