"""Listener: hears texts and says what it heard."""

from __future__ import annotations

from diffbotctl.block import Block, In, Out
from diffbotctl.messages import Text


class Listener(Block):
    """Answer each text that comes with `heard: ...`.

    blocks:
      listener: {block: listener, in: {text: talker.text}}
    """

    text = In(Text, help="What to listen to.")
    heard = Out(Text, help="What was heard.")

    def react(self, now: int, text: Text | None) -> Text | None:
        return None if text is None else Text(text.time, f"heard: {text.text}")
