"""A disc that was measured once: where its slots lie is known, but not which one comes first.

At power-on nobody knows how the disc stands under the light barrier. So each turn of the pattern is
an account of its own until the edges have told them apart, which takes a few: two neighbouring
slots are about 4 % of a pitch off each other, and a rolling wheel is foreseen to a tenth of that.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from diffbotctl.estimation.slot_errors import SlotErrors, SlotEstimate
from diffbotctl.estimation.wheel_transition import Transition

KNOWN = 0.008  # pitches; sd of a learnt place
# What is left after learning goes with the motor's ripple: it does not scatter from slot to slot,
# and taken for scatter it would be trusted too much.
TAKEN = 0.015  # pitches


class KnownSlotErrors:
    """The slots' errors (pitches, true place minus nominal) of one turn of the disc.

    It learns nothing more, so all that `SlotPlaces` shares with the motion is nothing here.
    """

    __slots__ = ("first", "flanks", "slots", "waiting")

    learnt = True

    def __init__(self, flanks: EdgeErrors, first: int) -> None:
        """`first`: which slot of the pattern is slot 0 of the count."""
        self.flanks = flanks
        self.slots = len(flanks.forward)
        self.first = first
        self.waiting = Transition()  # never filled

    def begin(self) -> None:
        """Nothing is left to begin with."""

    def copy(self) -> KnownSlotErrors:
        """Itself: it never changes."""
        return self

    def told(self, slot: int, forward: bool) -> SlotEstimate:
        """Error of the flank of `slot`, and the error's variance."""
        place = (slot + self.first) % self.slots
        if forward:
            return SlotEstimate(self.flanks.forward[place], self.flanks.variance)
        flanks = self.flanks
        error = flanks.backward[place] + flanks.beyond.error
        return SlotEstimate(error, flanks.beyond_variance)

    def beyond(self) -> tuple[list[float], float]:
        """By slot, what each flank seen backward lies off beyond the open share; the variance."""
        flanks = self.flanks
        turned = [flanks.backward[(slot + self.first) % self.slots] for slot in range(self.slots)]
        return turned, flanks.beyond_variance

    def halt(self) -> None:
        """Nothing is shared with a speed."""


class EdgeErrors:
    """Both flanks of each slot as they are seen going forward and backward, in pitches."""

    __slots__ = ("backward", "beyond", "beyond_variance", "forward", "variance")

    def __init__(
        self, forward: Sequence[float], backward: Sequence[float], share: SlotEstimate, slot: float
    ) -> None:
        """Errors of the flanks seen `forward`; of those seen `backward` beyond the open `share`,
        which is told as its error from half a pitch. None of the latter where they are not known:
        then they scatter by `slot` (sd)."""
        self.forward = tuple(forward)
        self.backward = tuple(backward) or (0.0,) * len(self.forward)
        self.variance = KNOWN * KNOWN
        self.beyond_variance = self.variance if backward else slot * slot
        self.beyond = share

    def turns(self) -> Iterator[KnownSlotErrors]:
        """The disc as it may stand at power-on."""
        for first in range(len(self.forward)):
            yield KnownSlotErrors(self, first)


Slots = SlotErrors | KnownSlotErrors
