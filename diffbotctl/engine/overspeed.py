"""Detects a wheel that turns faster than its commands can make it turn.

Two limits hold. The first is that of a motor that is stronger than stated (GAIN_SPREAD_MAX), at any
command: a motor without load runs at nearly its full speed at a low duty too. It is held for the
delay from a command to telemetry that shows its effect, and decays with the motor's lag after a
stop. The second, SPEED_RATIO times the command, holds for a wheel whose loop has settled; it is at
least the command of the other wheel in the same direction, since an open bridge does not brake a
wheel that the robot carries along in a curve. What the wheel turns beyond a limit is summed (a
one-sided CUSUM). The sum stops the robot when it exceeds what the encoder cannot resolve, and for
the second limit also what the strongest motor turns until the loop has settled. What a late frame
does not use of the limits is left for those that queued up behind it. After a gap, the limits of
its begin hold for all of it and decay from its end: a stop that was sent in the gap may reach the
board only then.

A wheel that was at rest and turns without a command is pushed by hand: this is reported, and is no
fault.
"""

from __future__ import annotations

from collections import deque
from itertools import pairwise
from math import exp, pi
from typing import NamedTuple

from diffbotctl.control.speed_loop import MotorSettings
from diffbotctl.time import MILLISECOND, SECOND

GAIN_SPREAD_MAX = 0.5  # of a motor that was not calibrated, relative to its stated speed
CALIBRATED_SPREAD_MAX = 0.25  # with `loop.speed` measured: a full battery instead of that day's
LAG_MAX_S = 0.4  # of geared motors, where the stated lag is only the default
COASTING_RATIO = 1.5  # lag of a motor without drive, whose gear the wheel has to turn, over its lag
# Counts by which a difference can exceed the angle turned: the counter's phase at each end, and two
# false counts of an edge that chatters.
RESOLUTION_COUNTS = 4.0
FALSE_COUNTS_SHARE = 0.1  # counts of chatter and noise that a usable encoder may add
# Between two edges; the speed of a slower wheel depends on friction more than on the command.
EDGE_INTERVAL_MAX_S = 0.3
SPEED_RATIO = 1.5  # to the command; above it a wheel whose loop has settled is too fast
# Until the loop, on the board or on the host, has corrected the feed-forward; after the lag.
BOARD_SETTLING_S, HOST_SETTLING_S = 0.6, 2.0
STANDSTILL_TIME = 300 * MILLISECOND  # without a count
# Frames queue up when the host stands still, or the radio holds them back. After the first of them
# the others arrive nearly at once, within QUEUE_TIME.
QUEUE_TIME = 300 * MILLISECOND
GAP_TIME = 200 * MILLISECOND  # without counts, in which commands may not have reached the board
SPEED_TIME = 500 * MILLISECOND  # over which the reported speed is averaged
PUSHED_COUNTS_MIN = 2  # a wheel that rests on an edge may give one


class WheelExcess(NamedTuple):
    """A wheel that is too fast: its speed over the last time, and the limit, in rad/s."""

    speed: float
    limit: float


class OverspeedDetector:
    """Watches one wheel; `command` and `counts` in the order of time."""

    def __init__(
        self, motor: MotorSettings, slots: int, lag: float, delay: float, host_loop: bool
    ) -> None:
        """`lag`: time constant of the motor, `delay`: of command and telemetry together (s).

        `host_loop`: the host controls the speed, of a board that takes only a duty.
        """
        self.pitch = 2 * pi / slots
        self.rated = motor.rated
        calibrated = motor.loop.speed is not None
        self.spread = CALIBRATED_SPREAD_MAX if calibrated else GAIN_SPREAD_MAX
        self.delay = round(delay * SECOND)
        longest_lag = max(LAG_MAX_S, 2 * lag)
        self.lag = COASTING_RATIO * longest_lag
        self.strongest = (1.0 + self.spread) * motor.rated
        self.settling = longest_lag + (HOST_SETTLING_S if host_loop else BOARD_SETTLING_S)
        self.slowest_held = self.pitch / EDGE_INTERVAL_MAX_S
        self.counted_share = 1.0 - FALSE_COUNTS_SHARE
        self.resolution = RESOLUTION_COUNTS * self.pitch
        self.target = self.carrying = 0.0
        self.target_limit = self.settled_target_limit = 0.0  # what the target alone allows
        self.settled_speed = 0.0  # limit of the last motion that was commanded
        self.limit = self.settled_limit = 0.0
        self.held_until = self.settled_held_until = 0
        self.excess = self.settled_excess = 0.0  # rad; negative by what a frame has left unused
        self.longest, self.queue_until = 0.0, 0  # s without counts, and for how long that matters
        self.counted_limits = 0.0, 0.0  # in force at the last counts
        self.time: int | None = None  # of the last counts
        self.count = 0
        self.boot = 0
        self.recent: deque[tuple[int, int]] = deque()  # times and counts
        self.moved_at = 0  # at the latest
        self.is_at_rest = True
        self.pushed = 0  # counts without a command since the wheel was at rest

    def command(self, now: int, target: float, carrying: float = 0.0) -> None:
        """Take the speed (rad/s) that is sent at `now`, and that of the other wheel if it has the
        same sign: without drive, a wheel is carried along by the robot."""
        self._decay(now)
        target, carrying = abs(target), abs(carrying)
        if (target, carrying) != (self.target, self.carrying):
            self.target, self.carrying = target, carrying
            self.target_limit, self.settled_target_limit = self._limits_of(target)
        if target:
            self.is_at_rest, self.pushed = False, 0
            self.moved_at = now + self.delay  # a short command moves the wheel after its end
            self.settled_speed = self.settled_target_limit
        self._raise_limits(now)

    def counts(self, now: int, count: int, boot: int) -> WheelExcess | None:
        """Take the count of the time `now`; the excess when the wheel is clearly too fast.

        The time is that of the board's sample, where its clock is known: frames that a standing
        delay of the link, or of the host, lets arrive at once were not sampled at once.
        """
        last, self.time = self.time, now
        steps, self.count = abs(count - self.count), count
        if last is None or boot != self.boot:
            self.boot, self.moved_at = boot, now
            self.recent.clear()
            self.recent.append((now, count))
            return None
        self.recent.append((now, count))
        while len(self.recent) > 2 and self.recent[0][0] < now - SPEED_TIME:
            self.recent.popleft()
        is_gap = now - last > GAP_TIME
        if steps or is_gap:  # a gap does not show that the wheel is at rest
            self.moved_at = max(self.moved_at, now)
        elif not self.target and now - self.moved_at >= STANDSTILL_TIME:
            self.is_at_rest, self.pushed = True, 0
        self._decay(now)
        self._raise_limits(now)
        if is_gap:
            self._resume_after_gap(now)
        self.counted_limits = self.limit, self.settled_limit
        if self.is_at_rest:
            self.excess = self.settled_excess = 0.0
            self.pushed += steps
            return None
        return self._sum(now, steps, (now - last) / SECOND)

    @property
    def is_pushed(self) -> bool:
        """True when the wheel turns by hand."""
        return self.pushed >= PUSHED_COUNTS_MIN

    def _resume_after_gap(self, now: int) -> None:
        """Take the limits of the gap's begin: commands of the gap may reach the board only now."""
        limit, settled_limit = self.counted_limits
        self.limit = max(self.limit, limit)
        self.settled_limit = max(self.settled_limit, settled_limit)
        self.held_until = self.settled_held_until = now + self.delay

    def _sum(self, now: int, steps: int, elapsed: float) -> WheelExcess | None:
        turned = steps * self.counted_share * self.pitch
        if elapsed >= self.longest or now >= self.queue_until:
            self.longest, self.queue_until = elapsed, now + QUEUE_TIME
        limit, settled = self.limit, self.settled_limit
        excess, lowest = self.excess + turned - limit * elapsed, -limit * self.longest
        self.excess = excess = excess if excess > lowest else lowest
        settled_excess = self.settled_excess + turned - settled * elapsed
        lowest = -settled * self.longest
        self.settled_excess = settled_excess = settled_excess if settled_excess > lowest else lowest
        if excess > self.resolution:
            return WheelExcess(self._speed(limit), limit)
        if settled_excess > self.resolution:
            settling = (self.strongest - self.settled_speed) * self.settling
            if settled_excess > self.resolution + settling:
                return WheelExcess(self._speed(settled), settled)
        return None

    def _speed(self, limit: float) -> float:
        """Mean speed over the last SPEED_TIME, or the highest if the mean is within `limit`.

        Counts that jump, or go back and forth, are too fast for a moment only.
        """
        steps = [
            (abs(count - before), (time - last) / SECOND)
            for (last, before), (time, count) in pairwise(self.recent)
        ]
        counted, seconds = (
            sum((count for count, _ in steps), 0),
            sum((elapsed for _, elapsed in steps), 0.0),
        )
        mean = counted * self.pitch / max(seconds, 1e-3)
        if mean > limit:
            return mean
        return max(count * self.pitch / max(elapsed, 1e-3) for count, elapsed in steps)

    def _raise_limits(self, now: int) -> None:
        if self.target_limit >= self.limit:
            self.limit, self.held_until = self.target_limit, now + self.delay
        if self.settled_target_limit >= self.settled_limit:
            self.settled_limit = self.settled_target_limit
            self.settled_held_until = now + self.delay

    def _decay(self, now: int) -> None:
        """Let the limits of earlier, faster commands decay to those of the present one."""
        strongest, settled = self.target_limit, self.settled_target_limit
        if now > self.held_until and self.limit > strongest:
            passed = (now - self.held_until) / SECOND
            self.limit = max(strongest, self.limit * exp(-passed / self.lag))
            self.held_until = now
        if now > self.settled_held_until and self.settled_limit > settled:
            passed = (now - self.settled_held_until) / SECOND
            self.settled_limit = max(settled, self.settled_limit * exp(-passed / self.lag))
            self.settled_held_until = now

    def _limits_of(self, target: float) -> tuple[float, float]:
        """Speed of the strongest motor, and that of a wheel whose loop has settled."""
        if not target:
            return 0.0, 0.0
        return self.strongest, self.settled_limit_of(target)

    def settled_limit_of(self, target: float) -> float:
        """Limit (rad/s) of a wheel whose loop has settled at `target`."""
        limit = max(SPEED_RATIO * max(target, self.slowest_held), self.carrying)
        return min(self.strongest, limit)
