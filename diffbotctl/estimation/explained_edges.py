"""Edges that an encoder counts, and those that the duty of its motor explains.

The duty is that of a mirror of the board's loop. Its errors do not add up: sums of edges over some
seconds are compared, not positions.
"""

from __future__ import annotations

from bisect import bisect
from collections.abc import Sequence
from math import copysign, exp, log, pi
from typing import NamedTuple

from diffbotctl.control.speed_loop import SpeedLoopMirror, speed_gains
from diffbotctl.estimation.predicted_wheel import LAG_DUTY, VISCOUS
from diffbotctl.estimation.wheel_side import (
    MotorConfig,
    SideConfig,
    lagged_motion,
    settled_speed,
)

MEMORY_S = 5.0  # of driving, after which an edge weighs 1/e
FEW_EDGES = 1.5  # in a frame; the times of more matter less, in inverse proportion
WEIGHT_MAX = 1e6  # of an edge relative to one of the start; then all sums are scaled
# Duties beyond the static one at which classes of sums begin: what friction and a load take of the
# edges depends on the duty, and what a fault of the encoder takes does not.
CLASSES = 0.12, 0.25, 0.5
# s; the commands within a longer frame are not all known, and a motor follows them within its lag.
SPAN_MAX = 0.12
TRACKING_S = 0.035  # time constant of the rate at which edges without times come
# Of the dead band; with a smaller duty a wheel may stick and slip.
DUTY_RATIO_MIN = 1.3
# A duty. A line through the speeds of a motor that is quick at small duties may show no dead band,
# but the motor has one.
CURVED_MIN = 0.08


class DutyCurve(NamedTuple):
    """Motion of a motor by its duty, as far as the robot file states it.

    With `viscous`, the law of `calibrate.motor_curve` for open windings between two pulses.
    """

    static: float
    rated: float
    lag: float
    viscous: float | None = None

    def speed(self, duty: float) -> float:
        """Speed (rad/s) at which it settles with `duty`, 0 to 1."""
        return settled_speed(duty, self.static, self.rated) * self.steepness(duty)

    def steepness(self, duty: float) -> float:
        """Speed over that of a line."""
        return 1.0 if self.viscous is None else (1.0 + self.viscous) / (duty + self.viscous)

    def slowness(self, duty: float) -> float:
        """Lag over the stated one."""
        return 1.0 if self.viscous is None else LAG_DUTY / (duty + self.viscous)

    def moved(self, speed: float, duty: float, span: float) -> tuple[float, float]:
        """Speed (rad/s) after `span` (s) with a signed `duty`, and its travel (rad)."""
        size = abs(duty)
        lag = self.lag * self.slowness(size)
        if self.viscous is None or (size >= self.static and speed * duty >= 0.0):
            return lagged_motion(speed, copysign(self.speed(size), duty), lag, span)
        # Hardly damped, it is stopped by the part of friction that the duty does not overcome.
        left = self.static - copysign(size, speed * duty)
        settled = copysign(left / (1.0 - self.static) * self.rated * self.steepness(size), -speed)
        if not speed:
            return 0.0, 0.0
        span = min(span, lag * log((speed - settled) / -settled))
        after, travel = lagged_motion(speed, settled, lag, span)
        return (after if after * speed > 0.0 else 0.0), travel


def curve_of(motor: MotorConfig) -> DutyCurve:
    """The curve of `motor`."""
    if motor.decay == "fast":
        static = motor.loop.static if motor.friction is None else motor.friction
        return DutyCurve(static, motor.rated, motor.lag, VISCOUS)
    return DutyCurve(motor.loop.static, motor.rated, motor.lag)


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
    untimed: float = 0.0
    """edges explained by the board's loop, whose edges had no times; less for many in a frame"""


def whole(ratios: Sequence[EdgeRatio]) -> EdgeRatio:
    """The sums of all of `ratios`."""
    counted = explained = friction = load = transient = untimed = 0.0
    for edges in ratios:
        counted += edges.counted
        explained += edges.explained
        friction += edges.friction
        load += edges.load
        transient += edges.transient
        untimed += edges.untimed
    return EdgeRatio(counted, explained, friction, load, transient, untimed)


class EdgeState(NamedTuple):
    """The sums of a wheel after `driven` seconds of driving."""

    driven: float
    ratios: list[EdgeRatio]
    """by class of duties"""
    whole: EdgeRatio

    def fade(self, before: EdgeState) -> float:
        """What an edge of `before` weighs now."""
        return exp((before.driven - self.driven) / MEMORY_S)

    def since(self, before: EdgeState) -> list[EdgeRatio]:
        """The sums since `before`."""
        fade = self.fade(before)
        return [
            EdgeRatio(*(value - fade * old for value, old in zip(now, then, strict=True)))
            for now, then in zip(self.ratios, before.ratios, strict=True)
        ]


class EdgeSums:
    """The values of an `EdgeRatio`, which grow."""

    def __init__(self) -> None:
        self.counted = self.explained = self.friction = 0.0
        self.load = self.transient = self.untimed = 0.0

    def ratio(self, weight: float) -> EdgeRatio:
        """The sums, divided by `weight`."""
        share = 1.0 / weight
        return EdgeRatio(
            share * self.counted,
            share * self.explained,
            share * self.friction,
            share * self.load,
            share * self.transient,
            share * self.untimed,
        )

    def set(self, values: EdgeRatio) -> None:
        """Go on with `values`."""
        self.counted, self.explained, self.friction = values[:3]
        self.load, self.transient, self.untimed = values[3:]


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
        self.curve = curve_of(motor)
        self.edges_per_rad = 0.5 * counts / pi
        # d explained / d static, times the static duty: edges/s for each (1 - duty).
        self.curved = max(self.curve.static, CURVED_MIN)
        friction = self.curved / (1.0 - self.curved) ** 2
        self.friction_rate = friction * motor.rated * self.edges_per_rad
        self.load_rate = motor.rated * self.edges_per_rad / (1.0 - self.curve.static)  # edges/s
        self.gains, self.counts = speed_gains(motor), counts
        self.sums = [EdgeSums() for _ in range(len(CLASSES) + 1)]
        self.weight = 1.0  # of an edge of the present frame
        self.driven = 0.0  # s
        self.restart(0, 0)

    def restart(self, time: int, count: int) -> None:
        """Go on at `time` (ns) with the board's `count`; what its loop did before is not known."""
        self.mirror = SpeedLoopMirror(self.gains, self.counts, time)
        self.tracker = EdgeTracker()
        self.time, self.count = time, count
        self.speed = 0.0  # rad/s, explained
        self.unseen = 0.0  # edges, explained since it stands
        self.is_standing = True  # no edge since it was at rest

    @property
    def state(self) -> EdgeState:
        """What a later state is compared with."""
        ratios = [sums.ratio(self.weight) for sums in self.sums]
        return EdgeState(self.driven, ratios, whole(ratios))

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
        change = abs(self.curve.speed(abs(duty)) - abs(self.speed)) * self.edges_per_rad
        travel = self._moved(duty, edges, span)
        size = abs(duty)
        if not command or size < DUTY_RATIO_MIN * self.curved or span > SPAN_MAX:
            return False
        self._fade(span)
        steepness = self.curve.steepness(size)
        weight = self.weight
        sums = self.sums[bisect(CLASSES, size - self.curve.static)]
        sums.counted += weight * edges
        sums.explained += weight * travel
        sums.friction += weight * (1.0 - size) * self.friction_rate * steepness * span
        sums.load += weight * self.load_rate * steepness * span
        sums.transient += weight * change * self.curve.slowness(size) * span
        if not is_duty and edge_time is None:
            sums.untimed += weight * travel * min(FEW_EDGES / max(edges, 1), 1.0)
        return True

    def _moved(self, duty: float, edges: int, span: float) -> float:
        """Edges that `duty` explains in `span` (s), of a wheel that showed `edges`.

        A wheel at rest needs more than the duty that keeps it turning, and how much is not known:
        until its first edge, no more than one is explained.
        """
        self.speed, angle = self.curve.moved(self.speed, duty, span)
        travel = abs(angle) * self.edges_per_rad
        if edges:
            self.is_standing, self.unseen = False, 0.0
        elif not duty and not self.speed:
            self.is_standing = True
        if not self.is_standing:
            return travel
        before, self.unseen = self.unseen, self.unseen + travel
        if self.unseen <= 1.0:
            return travel
        self.speed, self.unseen = 0.0, 1.0
        return 1.0 - before

    def _fade(self, span: float) -> None:
        """Let the edges so far weigh less, relative to those of this frame."""
        self.driven += span
        self.weight *= exp(span / MEMORY_S)
        if self.weight > WEIGHT_MAX:
            for sums in self.sums:
                sums.set(sums.ratio(self.weight))
            self.weight = 1.0
