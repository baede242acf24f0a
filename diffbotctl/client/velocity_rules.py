"""Rules for velocities that programs publish: who may drive, and when the robot is stopped.

A publisher drives from a velocity that is not zero until its next zero. While it drives it must
publish; when it is silent, the robot is stopped, and a zero of the same publisher allows motion
again. A publisher that is gone, a second one, a flood or a number that is not finite stop the robot
until `resume`.

A state machine without input or output: time is an argument (monotonic, s), and each event returns
the requests to send to the engine.
"""

from __future__ import annotations

from collections.abc import Iterable
from enum import StrEnum
from math import inf, isfinite
from typing import Literal, NamedTuple

from diffbotctl.control_socket.protocol import Fields

SILENCE_MAX_S = 0.3  # while moving; with telemetry period and link the wheels stop within 0.5 s
BEAT_PERIOD_S = 0.05  # of a server that has no thread for these rules
RENEWAL_PERIOD_S = 0.1  # the engine waits 0.3 s for the next command
DRIVE_PERIOD_MIN_S = 0.01  # between two commands; the engine accepts 300 requests a second
FLOOD_HZ = 1000.0  # beyond any controller: a loop without a pause
FLOOD_SPAN_S = 0.1  # over which the rate is measured
REASON_MAX_LENGTH = 200  # of an order
RESUMED = "operator.resume"  # the wire on which permission to move comes


class Limits(NamedTuple):
    """The robot's largest speed (m/s) and turn rate (rad/s); inf where there is none."""

    speed: float = inf
    turn_rate: float = inf

    @classmethod
    def of_run(cls, status: Fields) -> Limits:
        """Those of a run, from the reply to `status`."""
        return cls(status["speed"] or inf, status["turn_rate"] or inf)

    def scaled(self, linear: float, angular: float) -> tuple[float, float]:
        """The velocity within the limits that keeps the radius of the arc."""
        excess = max(abs(linear) / self.speed, abs(angular) / self.turn_rate, 1.0)
        # The quotient may exceed the limit by a rounding error, which the engine would refuse.
        return (
            max(-self.speed, min(linear / excess, self.speed)),
            max(-self.turn_rate, min(angular / excess, self.turn_rate)),
        )


class VelocitySource(NamedTuple):
    """Where a velocity came from.

    `publishers` are the identifiers of all publishers on the topic, `names` their nodes. `sequence`
    is the number that the publisher gave the message; None where the middleware has none.
    """

    publishers: frozenset[str]
    names: str
    sequence: int | None = None


class EngineOrder(NamedTuple):
    """A request to the engine."""

    method: Literal["drive", "release", "operator_lost", "stop", "rearm"]
    linear: float = 0.0
    angular: float = 0.0
    reason: str = ""

    def fields(self) -> Fields:
        match self.method:
            case "drive":
                return {"linear": self.linear, "angular": self.angular}
            case "release" | "rearm":
                return {}
            case _:
                return {"reason": self.reason[:REASON_MAX_LENGTH]}


class DriveState(StrEnum):
    """What the rules allow.

    - resting: anyone may begin to drive.
    - moving: one publisher drives.
    - silent: it fell silent, and its next zero allows motion again.
    - refused: the engine refused its velocity; its next zero or `resume` allows the next one.
    - held: only `resume` allows motion again.
    """

    RESTING = "resting"
    MOVING = "moving"
    SILENT = "silent"
    REFUSED = "refused"
    HELD = "held"


class VelocityRules:
    """Turns velocities of publishers into requests to the engine."""

    def __init__(self, limits: Limits) -> None:
        self.limits = limits
        self.state = DriveState.RESTING
        self.source = VelocitySource(
            frozenset(), ""
        )  # of the last velocity of the publisher that drives
        self.has_lost_some = False  # a publisher has ended since the last velocity
        self.velocity = (0.0, 0.0)
        self.received = self.sent = -inf
        self.flood_start: tuple[float, int | None] = (-inf, None)
        self.count = 0  # messages since flood_start

    def velocity_received(
        self, now: float, linear: float, angular: float, source: VelocitySource
    ) -> list[EngineOrder]:
        """A velocity (m/s, rad/s) was published."""
        if not (isfinite(linear) and isfinite(angular)):
            return self._hold(f"{source.names} sent a velocity that is not a finite number")
        is_zero = linear == 0.0 and angular == 0.0
        match self.state:
            case DriveState.HELD:
                return []
            case DriveState.SILENT | DriveState.REFUSED:
                return self._zero_after_stop(source) if is_zero else []
            case DriveState.RESTING:
                if is_zero:
                    return []
                self.state = DriveState.MOVING
                self.source = source
                self.sent = -inf
                self._restart_rate(now, source)
            case DriveState.MOVING:
                if self._is_other(source):
                    return self._hold(f"several publishers drive: {source.names}")
                if self._is_flood(now, source):
                    return self._hold(f"{source.names} sends more than {FLOOD_HZ:g} velocities/s")
                self.source = source
                if is_zero:
                    self.state = DriveState.RESTING
                    return [EngineOrder("release")]
        self.has_lost_some = False
        self.received = now
        self.velocity = self.limits.scaled(linear, angular)
        return self._drive(now)

    def time_passed(self, now: float) -> list[EngineOrder]:
        """Repeat the velocity, or stop because of silence."""
        if self.state is not DriveState.MOVING:
            return []
        if now >= self.received + SILENCE_MAX_S:
            self.state = DriveState.HELD if self.has_lost_some else DriveState.SILENT
            text = f"{self.source.names} was silent for {SILENCE_MAX_S:g} s; a zero of it, or"
            return [EngineOrder("operator_lost", reason=f"{text} `resume`, allows motion again")]
        return self._drive(now) if now >= self._next_drive() else []

    def deadline(self) -> float:
        """When `time_passed` has something to do; inf for never."""
        if self.state is not DriveState.MOVING:
            return inf
        return min(self.received + SILENCE_MAX_S, self._next_drive())

    def publishers_changed(self, publishers: Iterable[str]) -> list[EngineOrder]:
        """Publishers have come or gone; `publishers` are those that are alive."""
        remaining = self.source.publishers & frozenset(publishers)
        if remaining == self.source.publishers:
            return []
        if self.state is DriveState.MOVING and remaining:
            # Whether the one that drives has ended shows in its next velocity, or in its silence.
            self.has_lost_some = True
            self.source = self.source._replace(publishers=remaining)
            return []
        if self.state is DriveState.MOVING:
            self.state = DriveState.HELD
            reason = f"{self.source.names} has ended while the robot moved"
            return [EngineOrder("operator_lost", reason=reason)]
        if self.state is DriveState.SILENT:
            self.state = DriveState.HELD  # the engine is stopped already
        return []

    def publishers_named(self, publishers: frozenset[str], names: str) -> None:
        """The nodes of `publishers` are called `names`."""
        if self.source.publishers == publishers:
            self.source = self.source._replace(names=names)

    def stop_ended(self) -> None:
        """Someone allowed motion again."""
        if self.state is not DriveState.MOVING:
            self.state = DriveState.RESTING

    def refused(self) -> None:
        """The engine refused to drive: it is stopped, or another client drives."""
        if self.state is DriveState.MOVING:
            self.state = DriveState.REFUSED

    def _zero_after_stop(self, source: VelocitySource) -> list[EngineOrder]:
        if self._is_other(source) or source.publishers != self.source.publishers:
            return []
        is_own_stop = self.state is DriveState.SILENT
        self.state = DriveState.RESTING
        self.source = source
        return [EngineOrder("rearm")] if is_own_stop else []

    def _hold(self, reason: str) -> list[EngineOrder]:
        if self.state is DriveState.HELD:
            return []
        self.state = DriveState.HELD
        return [EngineOrder("stop", reason=reason)]

    def _is_other(self, source: VelocitySource) -> bool:
        """Whether another publisher sent it: the numbers of one publisher only rise."""
        known = self.source.publishers
        if known and source.publishers and not known & source.publishers:
            return True
        before, number = self.source.sequence, source.sequence
        return before is not None and number is not None and number <= before

    def _is_flood(self, now: float, source: VelocitySource) -> bool:
        """Whether too many were published; those that were dropped on the way count, too."""
        self.count += 1
        start, first = self.flood_start
        if now - start < FLOOD_SPAN_S:
            return False
        is_numbered = first is not None and source.sequence is not None
        count = source.sequence - first if is_numbered else self.count  # type: ignore[operator]
        self._restart_rate(now, source)
        return count > FLOOD_HZ * (now - start)

    def _restart_rate(self, now: float, source: VelocitySource) -> None:
        self.flood_start, self.count = (now, source.sequence), 0

    def _next_drive(self) -> float:
        is_new = self.received > self.sent
        return self.sent + (DRIVE_PERIOD_MIN_S if is_new else RENEWAL_PERIOD_S)

    def _drive(self, now: float) -> list[EngineOrder]:
        """Send the velocity, unless the last one was sent just now: then it is sent later."""
        if now < self.sent + DRIVE_PERIOD_MIN_S:
            return []
        self.sent = now
        return [EngineOrder("drive", *self.velocity)]
