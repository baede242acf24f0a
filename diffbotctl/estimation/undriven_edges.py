"""Edges of a wheel at rest that no command explains: somebody, or the other wheel, has turned it.

One channel does not measure the direction: the edges are counted on in the last one, and may as
well be those of a turn the other way. Lengths are pitches.
"""

from __future__ import annotations

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
