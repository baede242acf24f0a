"""A block that raises after a given time: what a user's own mistake does."""

from __future__ import annotations

from diffbotctl.block import Block, In, Out
from diffbotctl.messages import Twist
from diffbotctl.params import Param


class Breaks(Block):
    """Pass the twist on, and raise when the run is `after` seconds old."""

    after = Param(float, default=3.0, unit="s", above=0.0, help="When it raises.")
    wanted = In(Twist)
    twist = Out(Twist)

    def react(self, now: int, wanted: Twist | None) -> Twist | None:
        if now > self.after * 1e9:
            raise ZeroDivisionError("a mistake of the user's")
        return wanted
