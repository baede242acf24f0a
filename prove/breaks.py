"""A block that raises an exception after a given time, as a user's own block with a bug does."""

from __future__ import annotations

from diffbotctl.block import Block, In, Out
from diffbotctl.messages import Twist
from diffbotctl.params import Param


class Breaks(Block):
    """Pass the twist on; raise ZeroDivisionError after `after` seconds of the run."""

    after = Param(float, default=3.0, unit="s", above=0.0, help="Time at which it raises.")
    requested = In(Twist)
    twist = Out(Twist)

    def react(self, now: int, requested: Twist | None) -> Twist | None:
        if now > self.after * 1e9:
            raise ZeroDivisionError("a mistake of the user's")
        return requested
