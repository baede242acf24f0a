"""Talker: a text that is sent each period; with the listener, the smallest pipeline."""

from __future__ import annotations

from diffbotctl.block import Block, Every, Out
from diffbotctl.messages import Text
from diffbotctl.params import Param


class Talker(Block):
    """Send a numbered greeting each period.

    blocks:
      talker: {block: talker, with: {greeting: hello world, period: 100 ms}}
    """

    greeting = Param(str, default="hello world", live=True, help="Text to send.")
    period = Param(float, unit="s", default=0.1, minimum=0.001, help="Time between two messages.")

    tick = Every("period")
    text = Out(Text, help="The greeting and its number, from 1.")

    def reset(self) -> None:
        self.count = 0

    def react(self, now: int, tick: int | None) -> Text | None:
        if tick is None:
            return None
        self.count += 1
        return Text(tick, f"{self.greeting} {self.count}")
