"""Edges that an encoder counts, and those that the duty of its motor explains.

The duty is that of a mirror of the board's loop. Its errors do not add up: sums of edges over some
seconds are compared, not positions.
"""

from __future__ import annotations

from collections.abc import Sequence
from math import exp, pi
from typing import NamedTuple

from diffbotctl.control.speed_loop import SpeedLoopMirror, speed_gains
from diffbotctl.estimation.wheel_side import SideConfig, lagged_motion, settled_speed

MEMORY_S = 5.0  # of driving, after which an edge weighs 1/e
# s; the commands within a longer frame are not all known, and a motor follows them within its lag.
SPAN_MAX = 0.12
TRACKING_S = 0.035  # time constant of the rate at which edges without times come
# Of the dead band; with a smaller duty a wheel may stick and slip.
DUTY_RATIO_MIN = 1.3
# A duty. A line through the speeds of a motor that is quick at small duties may show no dead band,
# but the motor has one.
CURVED_MIN = 0.08


class EdgeRatio(NamedTuple):
    """Edges that were counted and explained, and what would change the latter."""

    counted: float
    explained: float
    friction: float
    """edges that would be explained if there were no friction, less `explained`"""
    load: float
    """edges by which a load that takes all of a duty of 1 reduces `explained`"""
    transient: float
    """edges by which the lag of the motor may be wrong: speed changes times the frames' time"""


class EdgeTracker:
    """Times of edges of which frames tell the number only, from their rate over several frames.

    Intervals of a whole number of frames would make the measured speeds too fast on average.
    """

    def __init__(self) -> None:
        self.beyond = 0.5  # edges, from the last one on
        self.rate = 0.0  # edges/s

    def last_edge(self, time: int, edges: int, span: float) -> int:
        """Time (ns) of the last of the `edges` of the frame of `span` (s) that ends at `time`."""
        gain = 1.0 - exp(-span / TRACKING_S)
        predicted = self.beyond + self.rate * span - edges
        residual = 0.5 - predicted
        self.beyond = min(max(predicted + gain * residual, 0.0), 1.0)
        self.rate = max(self.rate + gain * gain / (2.0 - gain) * residual / span, 0.0)
        age = min(self.beyond / self.rate, span) if self.rate > 0.0 else 0.5 * span
        return time - int(age * 1e9)


class ExplainedEdges:
    """Sums of one wheel, over the last seconds in which it was driven."""

    def __init__(self, side: SideConfig) -> None:
        motor, counts = side.motor, side.encoder.counts
        self.static, self.rated, self.lag = motor.loop.static, motor.rated, motor.lag
        self.edges_per_rad = 0.5 * counts / pi
        # d explained / d static, times the static duty: edges/s for each (1 - duty).
        self.curved = max(self.static, CURVED_MIN)
        friction = self.curved / (1.0 - self.curved) ** 2
        self.friction_rate = friction * motor.rated * self.edges_per_rad
        self.load_rate = motor.rated * self.edges_per_rad / (1.0 - self.static)  # edges/s
        self.gains, self.counts = speed_gains(motor), counts
        self.counted = self.explained = self.friction = self.load = self.transient = 0.0
        self.restart(0, 0)

    def restart(self, time: int, count: int) -> None:
        """Go on at `time` (ns) with the board's `count`; what its loop did before is not known."""
        self.mirror = SpeedLoopMirror(self.gains, self.counts, time)
        self.tracker = EdgeTracker()
        self.time, self.count = time, count
        self.speed = 0.0  # edges/s, explained

    @property
    def ratio(self) -> EdgeRatio:
        """The sums."""
        return EdgeRatio(self.counted, self.explained, self.friction, self.load, self.transient)

    def update(
        self,
        time: int,
        count: int,
        edge_time: int | None,
        changes: Sequence[tuple[int, float]],
        is_duty: bool,
        mirrored_duty: float | None = None,
    ) -> bool:
        """Take one frame. `changes`: commands (duties or rad/s) with the times (ns) since when they
        are in effect. `mirrored_duty`: the duty at the end of each frame, where another mirror with
        the same edges has found it. Returns whether the wheel was driven."""
        edges, self.count = abs(count - self.count), count
        before, self.time = self.time, time
        span = (time - before) * 1e-9
        if span <= 0.0:
            return False
        command = changes[-1][1]
        if is_duty:
            duty = command
        elif mirrored_duty is not None:
            duty = mirrored_duty
        else:
            edge = edge_time
            if edge is None:
                edge = self.tracker.last_edge(time, edges, span)
            duty = self.mirror.update(time, edges, edge, changes)[-1]
        target = settled_speed(duty, self.static, self.rated) * self.edges_per_rad
        change = target - self.speed
        self.speed, travel = lagged_motion(self.speed, target, self.lag, span)
        size = abs(duty)
        if not command or size < DUTY_RATIO_MIN * self.curved or span > SPAN_MAX:
            return False
        memory = exp(-span / MEMORY_S)
        self.counted = self.counted * memory + edges
        self.explained = self.explained * memory + abs(travel)
        self.friction = self.friction * memory + (1.0 - size) * self.friction_rate * span
        self.load = self.load * memory + self.load_rate * span
        self.transient = self.transient * memory + abs(change) * span
        return True
