"""Multi-hypothesis Kalman filter of one wheel's angle, finer than the slots of its encoder."""

from __future__ import annotations

from diffbotctl.estimation.disc_alignment import DiscAlignment
from diffbotctl.estimation.edge_hypothesis import EdgeHypothesis, WheelFrame, prune, update_all
from diffbotctl.estimation.priors import Priors
from diffbotctl.estimation.slot_errors import EdgeErrors, KnownSlotErrors
from diffbotctl.estimation.wheel_kalman import WheelKalman

HYPOTHESES_MAX = 6
LOG_RATIO_MAX = (
    9.0  # natural log; hypotheses less likely than the best by more are dropped (about 1:8000)
)


class WheelFilter:
    """Angle and speed of one wheel. `hypotheses` are the likely ones, best first."""

    def __init__(
        self,
        priors: Priors,
        time: int,
        count: int,
        slots: int,
        known_edges: EdgeErrors | None = None,
    ) -> None:
        """`slots` of the disc; their errors are estimated if the board reports edge times.
        `known_edges`: errors of a measured disc."""
        self.hypotheses = [EdgeHypothesis(WheelKalman(priors, slots), time, count)]
        self.known_edges = known_edges
        self.alignment: DiscAlignment | None = None

    @property
    def motion(self) -> WheelKalman:
        """Estimate of the best hypothesis."""
        return self.hypotheses[0].motion

    def update(self, frame: WheelFrame) -> None:
        """Update all hypotheses with one frame."""
        if (
            self.known_edges is not None
            and frame.edge_time is not None
            and frame.edge_count != self.hypotheses[0].count
        ):
            self.alignment = DiscAlignment(self.known_edges, self.hypotheses)
            self.known_edges = None
        self.hypotheses = update_all(self.hypotheses, frame)
        if len(self.hypotheses) > 1:
            self.hypotheses = prune(
                self.hypotheses, HYPOTHESES_MAX, LOG_RATIO_MAX, lambda hypothesis: hypothesis.key
            )
        if self.alignment is not None:
            self.alignment.update(frame)
            self._adopt_alignment(self.alignment)

    def friction_log_odds(self) -> float:
        """Log odds of dry friction against none (natural logarithm); 0 before the wheel has
        coasted."""
        best = {False: -LOG_RATIO_MAX, True: -LOG_RATIO_MAX}
        top = max(hypothesis.motion.log_likelihood for hypothesis in self.hypotheses)
        for hypothesis in self.hypotheses:
            is_dry = hypothesis.motion.is_dry
            if is_dry is None:
                return 0.0
            best[is_dry] = max(best[is_dry], hypothesis.motion.log_likelihood - top)
        return best[True] - best[False]

    def select_friction(self, is_dry: bool) -> None:
        """Move the best hypothesis with or without dry friction to the front, if there is one."""
        for index, hypothesis in enumerate(self.hypotheses):
            if hypothesis.motion.is_dry is is_dry:
                self.hypotheses.insert(0, self.hypotheses.pop(index))
                return

    def _adopt_alignment(self, alignment: DiscAlignment) -> None:
        """Adopt the measured slot errors once their rotation is known."""
        unaligned = max(self.hypotheses, key=lambda hypothesis: hypothesis.motion.log_likelihood)
        if alignment.has_failed(unaligned):
            self.alignment = None
            return
        aligned = alignment.aligned(unaligned)
        if aligned is None:
            return
        agreeing = [
            hypothesis
            for hypothesis in self.hypotheses
            if hypothesis.last_edge == aligned.last_edge
        ]
        if not agreeing:
            return
        assert isinstance(aligned.motion.disc, KnownSlotErrors)
        for hypothesis in agreeing:
            hypothesis.motion.set_known_slots(aligned.motion.disc)
        self.hypotheses = agreeing
        self.alignment = None
