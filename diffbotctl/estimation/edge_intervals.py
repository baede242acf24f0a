"""Missing edges of an encoder with few slots, from the times between its edges.

A wheel that turns on gives its edges at nearly equal intervals, and an interval that is about twice
as long as the one before and the one after it lacks an edge: no motor stops and starts within one
pitch. It takes no model of the motor, so it also shows where that model does not fit.
"""

from __future__ import annotations

from collections import deque

# The intervals around must be alike, and the one between them so much longer than their mean.
EVEN_RATIO_MAX, LONG_RATIO_MIN = 1.35, 1.6
LONG_MIN = 4  # before a fault is told: a seam of the floor gives one
SHARE_MIN = 0.03  # of missing edges; below it jolts may be the reason
# Frames in an interval, where the time of an edge is that of its frame.
FRAMES_MIN = 4
EDGES_MAX = 2  # missing in one interval; longer ones are stops
JUDGED_MIN, JUDGED_SHARE_MIN = 20, 0.3  # intervals, also of all edges: enough to show any fault


class EdgeIntervals:
    """Intervals of one wheel, each judged by its neighbours."""

    def __init__(self) -> None:
        self.edge: int | None = None  # ns, time of the last edge
        self.direction = 0
        self.recent: deque[int] = deque(maxlen=3)  # ns
        self.edges = self.judged = self.long = self.missing = 0

    def add(self, time: int, steps: int, resolution: int = 0) -> None:
        """Take `steps` counts of a frame, the last of them at `time` (ns), which is known to
        `resolution` (ns)."""
        self.edges += abs(steps)
        direction = 1 if steps > 0 else -1
        if abs(steps) > 1 or direction != self.direction or self.edge is None:
            self.recent.clear()
        else:
            self.recent.append(time - self.edge)
            if len(self.recent) == 3 and min(self.recent) >= FRAMES_MIN * resolution:
                self._judge(*self.recent)
        self.edge, self.direction = time, direction

    def restart(self) -> None:
        """Judge no interval that begins before the next edge."""
        self.edge = None

    def _judge(self, before: int, between: int, after: int) -> None:
        if min(before, after) <= 0:  # frames that queued up have one time
            return
        if max(before, after) > EVEN_RATIO_MAX * min(before, after):
            return
        self.judged += 1
        ratio = 2.0 * between / (before + after)
        if ratio >= LONG_RATIO_MIN and ratio < EDGES_MAX + 1.5:
            self.long += 1
            self.missing += round(ratio) - 1

    @property
    def shows_faults(self) -> bool:
        """Whether missing edges would have shown, had there been more than a few."""
        return self.judged >= max(JUDGED_MIN, JUDGED_SHARE_MIN * self.edges)

    @property
    def share(self) -> float:
        """Missing edges per counted one; 0 until they are certain."""
        # A long interval makes those of its neighbours uneven, which are not judged therefore.
        number = self.judged + 2 * self.long
        if self.long < LONG_MIN or self.missing < SHARE_MIN * number:
            return 0.0
        return self.missing / number

    @property
    def text(self) -> str:
        """What is wrong with the encoder, or an empty text."""
        share = self.share
        return f"edges are missing: about {share:.0%}" if share else ""
