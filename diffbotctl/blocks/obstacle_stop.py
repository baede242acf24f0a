"""Obstacle stop: limits the velocity by a distance sensor, so that the robot stops in time."""

from __future__ import annotations

from collections.abc import Mapping
from math import cos, sqrt
from typing import assert_never

from diffbotctl.block import Block, FromRobot, In, Out
from diffbotctl.control.velocity_limits import is_turn
from diffbotctl.geometry.distance_sensors import TYPES, sensor_timing
from diffbotctl.geometry.footprint import MountedDevice
from diffbotctl.messages import Range, Resume, Stop, StopCode, Twist
from diffbotctl.params import Param

STALE: StopCode = "range_stale"
FAULT: StopCode = "range_fault"
TOO_CLOSE: StopCode = "too_close"
OBSTACLE: StopCode = "obstacle"
# A reading of something near changes between both by its noise.
NEAR: tuple[StopCode, ...] = (TOO_CLOSE, OBSTACLE)
# m; hysteresis: a reading at 20 cm has a noise of 3 mm
RELEASE_DISTANCE = 0.02


class ObstacleStop(Block):
    """Limit the forward speed so that the robot can stop before an obstacle ahead.

    It slows down and then stops in front of an obstacle. A reading that is too close, faulty or
    stale counts as an obstacle. Turning and driving backwards stay allowed: where a turn about one
    wheel would lead the robot too far forward, it turns on the spot. Connect it after the speed
    limiter, so that its stops are not ramped.

    blocks:
      guard: {block: obstacle_stop, in: {twist: limiter.twist, range: range.range}}
    """

    margin = Param(
        float,
        unit="m",
        default=0.05,
        minimum=0.01,
        maximum=1.0,
        live=True,
        reason="the sensor's noise alone is 3 mm, and it hardly sees farther than a metre",
        help="Distance between the front of the robot and the obstacle at standstill.",
    )
    reaction: float | None = Param(
        float,
        unit="s",
        default=None,
        none=True,
        minimum=0.0,
        maximum=2.0,
        help="Time from an obstacle in view to the start of braking; none: computed from sensor "
        "cycle, telemetry rate, debouncing, command delay and motor lag.",
    )
    slowest = Param(
        float,
        unit="m/s",
        default=0.05,
        above=0.0,
        maximum=1.0,
        live=True,
        help="Stop where the safe speed is lower than this.",
    )
    debounce = Param(
        int,
        default=2,
        minimum=1,
        maximum=20,
        live=True,
        help="Consecutive readings that stop or release the robot.",
    )
    stale_after = Param(
        float, unit="s", default=0.2, minimum=0.02, maximum=1.0, help="Maximum age of a distance."
    )
    resume_by = Param(
        str,
        key="resume",
        default="by_itself",
        choices=("by_itself", "wait"),
        live=True,
        help="When the obstacle has gone: drive on by itself, or wait for `resume`.",
    )
    sensor: str | None = Param(
        str,
        none=True,
        default=None,
        help="Name of the sensor; none: the first distance sensor of the robot.",
    )
    braking = FromRobot("limits.braking")
    telemetry = FromRobot("board.telemetry")
    command_delay = FromRobot("link.command_delay")
    lag = FromRobot("drive.left.motor.lag")
    front = FromRobot("body.front")
    track: float = FromRobot("drive.track")
    sensors: Mapping[str, MountedDevice] = FromRobot("sensors")

    twist = In(Twist, fresh_for=0.5, help="The desired velocity.")
    range = In(Range, fresh_for="stale_after", help="The distance ahead.")
    resume = In(Resume, optional=True, help="Consent to drive on.")
    safe = Out(Twist, name="twist", help="The safe velocity.")
    stop = Out(Stop, help="Stop and release events.")

    def reset(self) -> None:
        name = guard_sensor(self.sensors, self.sensor)
        self.sensor_setback, self.ahead_ratio = 0.0, 1.0
        if name in self.sensors:
            at = self.sensors[name].at
            self.sensor_setback = self.front - at.x
            # A wall across the way is nearer than along the beam of a sensor that looks aside.
            self.ahead_ratio = cos(at.heading)
        self.last_range_time = -1
        self.blocked_readings = 0  # in a row
        self.free_readings = 0  # in a row
        self.code: StopCode = ""  # empty while nothing is in the way
        self.cause = ""
        self.reported_code: StopCode = ""
        self.is_latched = False
        self.is_slowing = False  # for an obstacle that is still far enough away
        self.last_resume: Resume | None = None
        self.usual_reaction = 0, 0.0  # `debounce` and the reaction time (s) that it gives

    def react(
        self, now: int, twist: Twist | None, range: Range | None, resume: Resume | None
    ) -> tuple[Twist | None, Stop | None]:
        free = self._free_distance(range)
        if resume is not None and resume is not self.last_resume:
            self.last_resume = resume
            # Consent is ignored while the obstacle is there: it would start the robot later.
            self.is_latched = self.is_latched and self.code != ""
        if twist is None:
            return None, self._stop_event(now, False)
        is_turning = is_turn(twist.linear, twist.angular, self.track)
        event = self._stop_event(now, twist.linear > 0.0 and not is_turning)
        if twist.linear <= 0.0:
            return Twist(now, twist.linear, twist.angular), event
        if self.code or self.is_latched:
            return Twist(now, 0.0, twist.angular), event
        limit = max_safe_speed(free - self.margin, self.braking, self._reaction_time())
        if (twist.linear > limit) != self.is_slowing:
            self._log_slowing(free)
        if is_turning:
            return Twist(now, min(twist.linear, limit), twist.angular), event
        return limit_to(twist, limit, now), event

    def _reaction_time(self) -> float:
        """Reaction time (s), with the present value of `debounce`, which is live."""
        if self.reaction is not None:
            return self.reaction
        debounce, reaction = self.usual_reaction
        if debounce != self.debounce:
            name = guard_sensor(self.sensors, self.sensor)
            guard = guard_reaction(self.sensors, name, self.telemetry, self.debounce)
            reaction = guard + self.command_delay + self.lag
            self.usual_reaction = self.debounce, reaction
        return reaction

    def _log_slowing(self, free: float) -> None:
        self.is_slowing = not self.is_slowing
        if self.log.debugs:
            does = "slows down for" if self.is_slowing else "drives at full speed again with"
            self.log.debug(f"{does} what is {free * 100:.0f} cm ahead")

    def _free_distance(self, range: Range | None) -> float:
        """Process a new reading; returns the free distance (m) before the front."""
        if range is None:
            self._block(STALE, "no fresh distance comes from the sensor")
            return 0.0
        free = range.distance * self.ahead_ratio - self.sensor_setback
        if range.time == self.last_range_time:
            return free
        self.last_range_time = range.time
        match range.state:
            case "fault":
                self._block(FAULT, "the distance sensor is faulty")
            case "too_close":
                self._block(
                    TOO_CLOSE,
                    "something is closer than the sensor can measure, or was: `resume` confirms "
                    "that nothing is",
                )
            case "clear":
                self._count_free()
                return float("inf")
            case "measured":
                limit = self.margin + stopping_distance(
                    self.slowest, self.braking, self._reaction_time()
                )
                if free <= limit + (RELEASE_DISTANCE if self.code else 0.0):
                    self._count_blocked(free)
                else:
                    self._count_free()
            case _:
                assert_never(range.state)
        return free

    def _block(self, code: StopCode, cause: str) -> None:
        self.code, self.cause, self.free_readings = code, cause, 0

    def _count_blocked(self, free: float) -> None:
        self.blocked_readings += 1
        self.free_readings = 0
        if self.blocked_readings >= self.debounce:
            self._block(OBSTACLE, f"something stands {max(free, 0.0) * 100:.0f} cm ahead")

    def _count_free(self) -> None:
        self.blocked_readings = 0
        self.free_readings += 1
        if self.free_readings >= self.debounce or self.code == STALE:
            self.code = self.cause = ""

    def _stop_event(self, now: int, is_forward: bool) -> Stop | None:
        """A Stop when forward motion is first prevented or allowed again, else None."""
        code = self.code
        is_reported = code == self.reported_code or (code in NEAR and self.reported_code in NEAR)
        if is_forward and code and not is_reported:
            must_wait = self.resume_by == "wait" and code != STALE
            self.is_latched = self.is_latched or must_wait
            self.reported_code = code
            return Stop(now, code, self.cause, self.is_latched)
        if self.reported_code and not code and not self.is_latched:
            self.reported_code = ""
            return Stop(now, "", "", False)
        return None


def guard_reaction(
    sensors: Mapping[str, MountedDevice], name: str, telemetry: float, debounce: int
) -> float:
    """Longest time (s) from an obstacle in view of a sensor to the reading that stops the robot."""
    timing = sensor_timing(sensor_kinds(sensors), name, telemetry)
    return timing.measuring + debounce * timing.period


def guard_sensor(sensors: Mapping[str, object], stated: str | None) -> str:
    """The sensor of a guard: the stated one, or the first distance sensor; empty without one."""
    kinds = sensor_kinds(sensors)
    return stated or next((name for name, kind in kinds.items() if kind in TYPES), "")


def sensor_kinds(sensors: Mapping[str, object]) -> dict[str, str]:
    return {name: str(getattr(sensor, "type", "")) for name, sensor in sensors.items()}


def stopping_distance(speed: float, braking: float, reaction: float) -> float:
    """Distance (m) from `speed` (m/s) to standstill; `braking` in m/s2, `reaction` in s."""
    return speed * speed / (2 * braking) + speed * reaction


def max_safe_speed(free: float, braking: float, reaction: float) -> float:
    """Highest speed (m/s) from which the robot stops within `free` metres; 0 if `free` <= 0.

    The inverse of `stopping_distance`.
    """
    if free <= 0.0:
        return 0.0
    if free == float("inf"):
        return free
    return braking * (sqrt(reaction * reaction + 2 * free / braking) - reaction)


def limit_to(twist: Twist, limit: float, now: int) -> Twist:
    """`twist` limited to `limit` m/s forward, with the same curvature."""
    if twist.linear <= limit:
        return Twist(now, twist.linear, twist.angular)
    return Twist(now, limit, twist.angular * limit / twist.linear)
