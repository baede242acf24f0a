"""How a measured disc stands under its light barrier, found from the first edges after power-on.

Each turn of the pattern is an account of its own until the edges have told them apart. That takes
half a dozen: two neighbouring slots are about 4 % of a pitch off each other, and a rolling wheel is
foreseen to a few thousandths.
"""

from __future__ import annotations

from math import exp, log

from diffbotctl.estimation.edge_hypothesis import EdgeHypothesis, sort_hypotheses
from diffbotctl.estimation.known_slot_errors import EdgeErrors, KnownSlotErrors

UNLIKELY = 9.0  # an account so far below the best (natural logarithm, about 1 : 8000) is dropped
MOST = 40  # accounts kept at a time: two for each turn of a disc with 20 slots
SURE = 0.99  # probability from which on the likeliest turn is believed
PATIENCE = 80  # edges, four turns of the wheel; after that the disc is another one
STRANGE = 0.05  # probability that the disc is not the one that was measured
LEAST_EDGES = 8  # fewer are not believed: one of twenty turns of any pattern fits a few by chance


class DiscAlignment:
    """Follows a wheel once for each turn of its pattern, beside the account that leans on none."""

    __slots__ = ("count", "edges", "tracks")

    def __init__(self, flanks: EdgeErrors, tracks: list[EdgeHypothesis]) -> None:
        """Begin from the accounts before the first edge."""
        self.count = tracks[0].count
        self.edges = 0
        self.tracks = []
        for track in tracks:
            for disc in flanks.turns():
                twin = track.copy()
                twin.motion.disc = disc
                twin.motion.evidence += log((1.0 - STRANGE) / disc.slots / STRANGE)
                self.tracks.append(twin)

    def frame(
        self, time: int, count: int, edge: int | None, drive: float, since: int | None
    ) -> None:
        """Take one frame, as `WheelTrack.frame` does."""
        self.edges += abs(count - self.count)
        self.count = count
        self.tracks = sort_hypotheses(self.tracks, time, count, edge, drive, since)
        self._prune()

    def found(self, plain: EdgeHypothesis) -> EdgeHypothesis | None:
        """The account with the right turn, once it is known; `plain` leans on no pattern."""
        if self.edges < LEAST_EDGES:
            return None
        best = self.tracks[0]
        if best.motion.evidence < plain.motion.evidence:
            return None
        weights: dict[int, float] = {}
        for track in self.tracks:
            # By the slot that is under the barrier now: accounts may count the edges differently.
            place = standing(track)
            weight = exp(track.motion.evidence - best.motion.evidence)
            weights[place] = weights.get(place, 0.0) + weight
        strange = exp(plain.motion.evidence - best.motion.evidence)
        likely = weights[standing(best)] / (sum(weights.values()) + strange)
        return best if likely >= SURE else None

    def is_vain(self, plain: EdgeHypothesis) -> bool:
        """True when the disc seems to be another one than was measured."""
        if self.edges > PATIENCE:
            return True
        return self.tracks[0].motion.evidence < plain.motion.evidence - UNLIKELY

    def _prune(self) -> None:
        self.tracks.sort(key=lambda track: -track.motion.evidence)
        least = self.tracks[0].motion.evidence - UNLIKELY
        kept: dict[object, EdgeHypothesis] = {}
        for track in self.tracks[:MOST]:
            if track.motion.evidence >= least:
                kept.setdefault((track.account, standing(track)), track)
        self.tracks = list(kept.values())


def standing(track: EdgeHypothesis) -> int:
    """Which slot of the pattern is under the light barrier."""
    disc = track.motion.disc
    assert isinstance(disc, KnownSlotErrors)
    return (track.slot + disc.first) % disc.slots
