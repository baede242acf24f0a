"""Periods without edges of a driven wheel that turned just before, and turns just after.

A wheel of which a wire or the light barrier fails for a moment counts nothing meanwhile, or the
mains that a loose wire picks up. Neither does one that something holds, but that begins to turn
within the lag of its motor; one whose edges failed turns at once, and so does one with a quick
motor. So it is not known how far it has turned. Times are seconds, rates edges/s.
"""

from __future__ import annotations

from collections import deque

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
            self.frames.clear()
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
        edges = sum((edges for _, edges in self.frames), 0)
        if edges < BEFORE_EDGES_MIN:
            return 0.0
        return edges / sum((seconds for seconds, _ in self.frames), 0.0)

    def _remember(self, seconds: float, edges: int) -> None:
        frames = self.frames
        frames.append((seconds, edges))
        while len(frames) > 1 and sum((each for each, _ in frames), 0.0) - frames[0][0] >= BEFORE_S:
            frames.popleft()

    def _restart(self, sign: int) -> None:
        self.sign, self.seconds, self.edges, self.gap = sign, 0.0, 0, 0.0
        self.frames.clear()
