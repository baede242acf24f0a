"""Where the slots of both encoders' discs lie, learnt from what the board told of a drive.

It is what odometry does while it drives (`estimation/slot_errors.py`), with two differences: the
flanks that are seen going backward are learnt slot by slot too, and it never leaves off learning.
Any recording will do in which the wheels turn a few times each way; lifted wheels are best.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from math import sqrt
from statistics import fmean
from typing import NamedTuple

from diffbotctl.blocks.odometry import OdometryBlock
from diffbotctl.estimation.slot_errors import SlotErrors
from diffbotctl.estimation.wheel_odometer import WheelOdometer
from diffbotctl.messages import Encoders

CALM = 0.35  # of what odometry expects the wheels' speeds to wander: nothing gets in their way
SURE = 0.015  # pitches: half of what slots are usually cut to; less sure than this is not learnt
NO_EDGES = "the board does not tell when edges came: set `board: {edge_times: true}`"


class LearntDisc(NamedTuple):
    """One wheel's disc, its slots in the order of turning forward from an unknown one."""

    forward: tuple[float, ...]
    """(slots,): pitches, how far each flank lies from its even place, on average nothing"""
    backward: tuple[float, ...]
    """the same of the flanks seen going backward, about the mean of these; empty: not learnt.
    How far apart both means lie, the open share, is not told: that hangs on a single reversal"""
    sd: float
    """pitches, of a place, one standard deviation"""


class LearningWheel(WheelOdometer):
    """A wheel whose both flanks are learnt, for as long as it turns."""

    __slots__ = ()

    def learn(self, slots: int) -> LearningWheel:
        """Begin to."""
        self.filter.flanks = None  # what was learnt before is not leant on
        motion = self.filter.motion
        motion.spread = motion.spread._replace(rough=CALM * motion.spread.rough)
        spread = motion.spread
        motion.disc = SlotErrors(slots, spread.slot, spread.open, spread.share, both=True)
        return self

    def disc(self) -> LearntDisc:
        """What is learnt so far. Raises ValueError with the reason when that is too little."""
        places = self.filter.motion.disc
        assert isinstance(places, SlotErrors)
        slots = places.slots
        forward, sd = _centred(places, range(slots))
        if sd > SURE:
            raise ValueError(
                f"places are known to {sd:.1%} of a pitch only; let the wheel turn a few times more"
            )
        backward, doubt = _centred(places, range(slots, 2 * slots))
        if doubt > SURE:
            return LearntDisc(forward, (), sd)
        return LearntDisc(forward, backward, max(sd, doubt))


class Learning(OdometryBlock):
    """Odometry that learns the discs of both wheels."""

    def _start(self, encoders: Encoders) -> tuple[WheelOdometer, WheelOdometer]:
        link = (0.0, 0.0, True)
        left = LearningWheel(self.left_side, encoders.time, encoders.left, *link)
        right = LearningWheel(self.right_side, encoders.time, encoders.right, *link)
        return left.learn(self.left_side.encoder.slots), right.learn(self.right_side.encoder.slots)


def learn_discs(odometry: Learning, frames: Iterable[Encoders]) -> tuple[LearntDisc, LearntDisc]:
    """The discs of the left and the right wheel.

    Raises ValueError with the reason when the frames do not tell them.
    """
    boot = None
    for frame in frames:
        if boot is not None and frame.boot != boot:
            raise ValueError("the board restarted meanwhile, and the discs may have turned")
        boot = frame.boot
        odometry.react(frame.time, frame)
    if odometry.wheels is None:
        raise ValueError("the board told no counts")
    found = []
    for side, wheel in zip(("left", "right"), odometry.wheels, strict=True):
        assert isinstance(wheel, LearningWheel)
        try:
            found.append(wheel.disc())
        except ValueError as error:
            raise ValueError(f"{side} wheel: {error}") from None
    return found[0], found[1]


def _centred(places: SlotErrors, entries: Sequence[int]) -> tuple[tuple[float, ...], float]:
    """Errors of some entries about their mean, and their standard deviation."""
    errors = [places.error[each] for each in entries]
    middle, count = fmean(errors), len(errors)
    own = [fmean(places.own[one][each] for each in entries) for one in entries]
    whole = fmean(own)
    variance = sum(places.own[each][each] for each in entries) / count - whole
    return tuple(each - middle for each in errors), sqrt(max(variance, 0.0))
