"""Measuring a link by talking to the board at its other end: questions out, times in. Sans-IO."""

from __future__ import annotations

from diffbotctl.bluetooth.link_stats import Arrival, LinkFigures, link_figures
from diffbotctl.links import diffbot_frames as frames
from diffbotctl.links.diffbot_codec import FrameDecoder, encode
from diffbotctl.time import SECOND

ASK_EVERY = 250_000_000  # ns; an answer takes 18 ms of a line of 9600 baud
FORGOTTEN = SECOND  # ns; an answer that comes later is taken for lost
SEQUENCES = 64  # of state frames
WRAP = (1 << 16) * frames.TICK_NANOSECONDS  # ns after which a board's stamp begins anew


class LinkProbe:
    """Asks who is there, over and over, and looks at what comes. No motor moves."""

    def __init__(self, now: int) -> None:
        """`now`: ns, as all times."""
        self._decoder = FrameDecoder()
        self._ask_at = now
        self._asked: int | None = None  # since when an answer is awaited
        self.heard: list[Arrival] = []
        self.answers: list[float] = []
        """s that each question took"""

    def due(self) -> int:
        """When `send` has something to say."""
        return self._ask_at

    def send(self, now: int) -> bytes:
        """A question, when one is due."""
        if now < self._ask_at:
            return b""
        self._ask_at = now + ASK_EVERY
        if self._asked is not None and now - self._asked < FORGOTTEN:
            return b""
        self._asked = now
        return encode(frames.AskFrame(frames.VERSION))

    def receive(self, now: int, data: bytes) -> None:
        """Take what came."""
        for frame in self._decoder.feed(data):
            if isinstance(frame, frames.HelloFrame) and self._asked is not None:
                self.answers.append((now - self._asked) / SECOND)
                self._asked = None
            elif isinstance(frame, frames.StateFrame | frames.CountsFrame):
                self.heard.append(Arrival(now, self._taken(now, frame.time), frame.sequence))

    def figures(self) -> LinkFigures:
        """What the link is like. Raises ValueError when too little was heard."""
        return link_figures(self.heard, self.answers, self._decoder.damaged, SEQUENCES)

    def _taken(self, now: int, stamp: int) -> int:
        """The board's time, unwrapped: the one nearest to what has passed since the last frame."""
        low = stamp * frames.TICK_NANOSECONDS
        if not self.heard:
            return low
        last = self.heard[-1]
        expected = last.taken + now - last.came
        return low + round((expected - low) / WRAP) * WRAP
