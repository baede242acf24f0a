"""How far a wheel has turned, finer than its slots: the likeliest account of its edges."""

from __future__ import annotations

from diffbotctl.estimation.disc_alignment import DiscAlignment
from diffbotctl.estimation.edge_hypothesis import EdgeHypothesis, sort_hypotheses
from diffbotctl.estimation.known_slot_errors import EdgeErrors
from diffbotctl.estimation.wheel_kalman import Priors, WheelKalman

MOST = 6  # accounts kept at a time
UNLIKELY = 9.0  # an account so far below the best (natural logarithm, about 1 : 8000) is dropped


class WheelFilter:
    """One wheel, with all accounts of its edges that are still likely; the best first."""

    __slots__ = ("flanks", "search", "tracks")

    def __init__(
        self, spread: Priors, time: int, count: int, slots: int, flanks: EdgeErrors | None = None
    ) -> None:
        """`slots` of the disc, whose errors are learnt when the board tells edges' times; its
        `flanks` when they are known."""
        self.tracks = [EdgeHypothesis(spread, time, count, slots)]
        self.flanks = flanks
        self.search: DiscAlignment | None = None

    @property
    def motion(self) -> WheelKalman:
        """The likeliest."""
        return self.tracks[0].motion

    def frame(
        self, time: int, count: int, edge: int | None, drive: float, since: int | None
    ) -> None:
        """Take one frame, as `WheelTrack.frame` does."""
        if self.flanks is not None and edge is not None and count != self.tracks[0].count:
            self.search = DiscAlignment(self.flanks, self.tracks)
            self.flanks = None
        self.tracks = sort_hypotheses(self.tracks, time, count, edge, drive, since)
        if len(self.tracks) > 1:
            self._prune()
        if self.search is not None:
            self.search.frame(time, count, edge, drive, since)
            self._look_for_the_disc(self.search)

    def likely_edge(self, time: int, steps: int) -> int:
        """When the last of `steps` edges came that a frame at `time` counts (ns)."""
        return self.tracks[0].likely_edge(time, steps)

    def leaning(self) -> float:
        """How much better dry friction tells the wheel's rolling out than its lag does (natural
        logarithm); 0 before it has rolled out."""
        best = {False: -UNLIKELY, True: -UNLIKELY}
        top = max(track.motion.evidence for track in self.tracks)
        for track in self.tracks:
            dry = track.motion.dry
            if dry is None:
                return 0.0
            best[dry] = max(best[dry], track.motion.evidence - top)
        return best[True] - best[False]

    def prefer(self, dry: bool) -> None:
        """Let an account with or without dry friction speak for the wheel, if there is one."""
        for place, track in enumerate(self.tracks):
            if track.motion.dry is dry:
                self.tracks.insert(0, self.tracks.pop(place))
                return

    def _look_for_the_disc(self, search: DiscAlignment) -> None:
        """Take the pattern as it stands, once that is known."""
        plain = max(self.tracks, key=lambda track: track.motion.evidence)
        if search.is_vain(plain):
            self.search = None
            return
        found = search.found(plain)
        if found is None:
            return
        agree = [track for track in self.tracks if track.where == found.where]
        if not agree:
            return
        for track in agree:
            track.motion.know(found.motion.disc)
        self.tracks = agree
        self.search = None

    def _prune(self) -> None:
        """Keep what is likely; of two accounts that agree, the better."""
        self.tracks.sort(key=lambda track: -track.motion.evidence)
        least = self.tracks[0].motion.evidence - UNLIKELY
        kept: list[EdgeHypothesis] = []
        seen = set()
        for track in self.tracks[:MOST]:
            if track.motion.evidence >= least and track.account not in seen:
                seen.add(track.account)
                kept.append(track)
        self.tracks = kept
