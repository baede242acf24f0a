"""How far a wheel has turned, finer than its slots: the likeliest account of its edges."""

from __future__ import annotations

from math import log

from diffbotctl.blocks.known_slots import Flanks
from diffbotctl.blocks.wheel_motion import Spread, WheelMotion
from diffbotctl.blocks.wheel_track import WheelTrack

MOST = 6  # accounts kept at a time
UNLIKELY = 9.0  # an account so far below the best (natural logarithm, about 1 : 8000) is dropped
STRANGE = 0.01  # probability that the disc is not the one that was measured


class WheelFilter:
    """One wheel, with all accounts of its edges that are still likely; the best first."""

    __slots__ = ("flanks", "most", "tracks")

    def __init__(
        self, spread: Spread, time: int, count: int, slots: int, flanks: Flanks | None = None
    ) -> None:
        """`slots` of the disc, whose errors are learnt when the board tells edges' times; its
        `flanks` when they are known."""
        self.tracks = [WheelTrack(spread, time, count, slots)]
        self.flanks = flanks
        self.most = MOST

    @property
    def motion(self) -> WheelMotion:
        """The likeliest."""
        return self.tracks[0].motion

    def frame(
        self, time: int, count: int, edge: int | None, drive: float, since: int | None
    ) -> None:
        """Take one frame, as `WheelTrack.frame` does."""
        if self.flanks is not None and edge is not None and count != self.tracks[0].count:
            self._look_for_the_disc(self.flanks)
        if self.tracks[0].motion.dry is None:
            self.tracks = [twin for track in self.tracks for twin in track.rolling_out(drive)]
        self.tracks = [
            branch
            for track in self.tracks
            for branch in track.frame(time, count, edge, drive, since)
        ]
        if len(self.tracks) > 1:
            self._prune()

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

    def _look_for_the_disc(self, flanks: Flanks) -> None:
        """The first edge: it may be that of any slot, or the disc is a strange one."""
        turned = []
        for track in self.tracks:
            for disc in flanks.turns():
                twin = track.copy()
                twin.motion.disc = disc
                twin.motion.evidence += log((1.0 - STRANGE) / disc.slots)
                turned.append(twin)
            track.motion.evidence += log(STRANGE)
        self.tracks += turned
        self.flanks = None
        self.most = len(self.tracks) + MOST

    def _prune(self) -> None:
        """Keep what is likely; of two accounts that agree, the better."""
        self.tracks.sort(key=lambda track: -track.motion.evidence)
        least = self.tracks[0].motion.evidence - UNLIKELY
        kept: list[WheelTrack] = []
        seen = set()
        for track in self.tracks[: self.most]:
            if track.motion.evidence >= least and track.account not in seen:
                seen.add(track.account)
                kept.append(track)
        self.tracks = kept
        if len(kept) <= MOST:
            self.most = MOST
