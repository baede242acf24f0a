"""Listener: answers a text; with the talker, the smallest pipeline."""

from __future__ import annotations

from diffbotctl.block import Block, In, Out
from diffbotctl.messages import Text


class Listener(Block):
    """Answer each text with `heard: ...`.

    blocks:
      listener: {block: listener, in: {text: talker.text}}
    """

    text = In(Text, help="The text to answer.")
    heard = Out(Text, help="The answer.")

    def react(self, now: int, text: Text | None) -> Text | None:
        return None if text is None else Text(text.time, f"heard: {text.text}")
