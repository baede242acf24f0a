"""Edges that no command explains, and commands without the edges that they should give.

One channel does not measure the direction: the edges of a wheel that somebody, or the other wheel,
has turned are counted on in its last one, and may as well be those of a turn the other way.

A driven wheel of which a wire or the light barrier fails for a moment counts nothing meanwhile, or
the mains that a loose wire picks up. Neither does one that something holds, but that begins to turn
within the lag of its motor; one whose edges failed turns at once, and so does one with a quick
motor. So it is not known how far it has turned. Times are seconds, rates edges/s, lengths pitches.
"""

from __future__ import annotations

from collections import deque
from math import sqrt

REST_S = 0.3  # without a drive and without an edge, after which a wheel is at rest
# Edges and angle (rad) of a wheel at rest that are reported: one that trembles, or rolls out
# slowly, makes less. While the other wheel is driven, which may drag it along, fewer are reported.
PUSHED_EDGES_MIN, DRAGGED_EDGES_MIN, PUSHED_ANGLE_MIN = 3, 2, 0.1
ONE_EDGE_SD = 0.5  # of a wheel at rest that gives one edge, which may be that of a small motion


class UndrivenEdges:
    """The edges of one wheel without a drive, since it was at rest and since the pose was set."""

    def __init__(self, pitches_per_rad: float) -> None:
        self.pitches_per_rad = pitches_per_rad
        self.rested_for = REST_S  # s, without a drive and without an edge
        self.edges = 0
        """since the wheel was at rest"""
        self.edges_in_all = self.dragged = 0  # since the pose was set; while the other was driven
        self.is_other_driven = False
        """whether the other wheel has a command in the next frame"""
        self.reported = 0  # of `edges`

    def add(self, span: float, edges: int, is_driven: bool) -> None:
        """Take the `edges` of a frame of `span` (s)."""
        if is_driven:
            self.edges, self.rested_for = 0, 0.0
        elif not edges:
            self.rested_for += span
        elif self.rested_for >= REST_S or self.edges:
            self.edges += edges
            self.edges_in_all += edges
            if self.is_other_driven:
                self.dragged += edges
        else:  # it still rolls, perhaps from a kick against friction that ended at once
            self.rested_for = 0.0

    def take_variance(self) -> float:
        """Variance (pitches2) that was added since the last call. The last edges of a wheel that
        comes to rest are none of them."""
        edges = self.edges
        if edges < PUSHED_EDGES_MIN and not self.is_other_driven:
            self.reported = min(self.reported, edges)
            return 0.0
        before, self.reported = self.reported, edges
        if edges <= before:
            return 0.0
        return ONE_EDGE_SD * ONE_EDGE_SD if edges == 1 else pushed_variance(before, edges)

    @property
    def text(self) -> str:
        """That something has turned the wheel, or an empty text."""
        edges = self.edges_in_all
        is_reported = edges >= PUSHED_EDGES_MIN or self.dragged >= DRAGGED_EDGES_MIN
        if not is_reported or edges < PUSHED_ANGLE_MIN * self.pitches_per_rad:
            return ""
        return f"turned by {edges} edges without a command, its encoder does not show which way"

    @property
    def sd(self) -> float:
        """Standard deviation (pitches) of what is reported."""
        return sqrt(pushed_variance(0, self.edges_in_all)) if self.text else 0.0

    def pose_is_set(self) -> None:
        """What happened before does not matter any more."""
        self.edges_in_all = self.dragged = 0


def pushed_variance(before: int, after: int) -> float:
    """Variance (pitches2) that is added when the edges of a pushed wheel grow from `before` to
    `after`: they are counted on in the last direction, and as probable the other way, twice as far
    from there."""
    return 2.0 * (after * after - before * before)


# Before the gap: seconds and edges from which the rate is known.
BEFORE_S, BEFORE_EDGES_MIN = 0.15, 3
# Of that rate, in one of the last two frames: a wheel that slows down comes to rest by itself.
LAST_RATIO_MIN = 0.75
EXPECTED_MIN = 5.0  # edges in the gap at the rate before
QUIET_SHARE_MAX = 0.3  # of the edges that are expected in a frame of the gap
RATED_SHARE_MIN = 0.1  # of the rated speed, before or after; a slower wheel may stick and slip
SECONDS_MAX = 1.5  # a longer one is a fault of its own
# Of the rate before, in the gap: a wheel that is driven more slowly may be held by friction.
COMMANDED_RATIO_MIN = 0.6
# After it: edges that show the rate, and that rate relative to the one before.
AFTER_EDGES_MIN, AFTER_RATIO_MIN = 2, 0.5
# Standard deviation of the lost travel, of what the faster of both rates gives: held, it is none.
LOST_SD = 0.6


class EdgeGaps:
    """What one wheel may have travelled without edges."""

    def __init__(self, rated_rate: float) -> None:
        """`rated_rate`: edges/s at the rated speed."""
        self.least_rate = RATED_SHARE_MIN * rated_rate
        self.frames: deque[tuple[float, int]] = deque()
        """seconds and edges of the last frames, up to the last one that was not quiet"""
        self.before_seconds, self.before_edges = 0.0, 0  # of them all
        self.sign = 0
        """of the drive"""
        self.seconds, self.edges = 0.0, 0
        """of quiet frames, while driven"""
        self.gap, self.rate = 0.0, 0.0
        """s of a gap that has just ended, else 0; the rate before it"""
        self.after = (0.0, 0)
        """seconds and edges since then"""
        self.longest = 0.0
        """s, of those in which it may have turned, since the pose was set"""

    @property
    def text(self) -> str:
        """That edges may be lost, or an empty text."""
        if not self.longest:
            return ""
        return (
            f"hardly an edge came for {self.longest:.2f} s while it was driven: a wire or the "
            "light barrier failed, or something held the wheel"
        )

    def pose_is_set(self) -> None:
        """What happened before does not matter any more."""
        self.longest = 0.0

    def update(self, span: float, edges: int, commanded: float) -> float:
        """Take a frame of `span` s; `commanded`: rate with the sign of the drive that turns the
        wheel, 0 without one.

        Returns the variance (edges2) of travel that was lost until then.
        """
        if span <= 0.0:
            return 0.0
        sign = (commanded > 0.0) - (commanded < 0.0)
        if not sign or sign != self.sign:
            self._restart(sign)
            return 0.0
        if self.gap:
            return self._compare(span, edges)
        rate = self._rate()
        if edges <= QUIET_SHARE_MAX * rate * span:
            self.seconds, self.edges = self.seconds + span, self.edges + edges
            if abs(commanded) < COMMANDED_RATIO_MIN * rate:
                self._restart(sign)
            return 0.0
        if self._is_gap(rate):
            # The last frame before it and the first after it lie partly within it.
            self.gap, self.rate, self.after = self.seconds + span, rate, (0.0, 0)
            self._forget()
        else:
            span, edges = self.seconds + span, self.edges + edges
        self.seconds, self.edges = 0.0, 0
        self._remember(span, edges)
        return 0.0

    def _is_gap(self, rate: float) -> bool:
        """Whether the edges ended at once, and too many are missing."""
        if rate * self.seconds < EXPECTED_MIN or self.seconds > SECONDS_MAX:
            return False
        last = max(edges / seconds for seconds, edges in list(self.frames)[-2:])
        return last >= LAST_RATIO_MIN * rate

    def _compare(self, span: float, edges: int) -> float:
        """The variance of what was lost, once the rate after the gap is known."""
        seconds, counted = self.after
        self.after = seconds, counted = seconds + span, counted + edges
        if counted < AFTER_EDGES_MIN and seconds < BEFORE_S:
            return 0.0
        gap, self.gap = self.gap, 0.0
        self._remember(seconds, counted)
        rate = max(counted / seconds, self.rate)
        if counted < AFTER_RATIO_MIN * self.rate * seconds or rate < self.least_rate:
            return 0.0
        self.longest = max(self.longest, gap)
        return (LOST_SD * gap * rate) ** 2

    def _rate(self) -> float:
        """Before the edges ended; 0 where too few show it."""
        if self.before_edges < BEFORE_EDGES_MIN:
            return 0.0
        return self.before_edges / self.before_seconds

    def _remember(self, seconds: float, edges: int) -> None:
        frames = self.frames
        frames.append((seconds, edges))
        self.before_seconds += seconds
        self.before_edges += edges
        while len(frames) > 1 and self.before_seconds - frames[0][0] >= BEFORE_S:
            first_seconds, first_edges = frames.popleft()
            self.before_seconds -= first_seconds
            self.before_edges -= first_edges

    def _forget(self) -> None:
        self.frames.clear()
        self.before_seconds, self.before_edges = 0.0, 0

    def _restart(self, sign: int) -> None:
        self.sign, self.seconds, self.edges, self.gap = sign, 0.0, 0, 0.0
        self._forget()
