"""What a radio link is like, from the frames that came over it; pure arithmetic.

Jitter is how much later than the fastest one a frame came, by the board's own stamps: both clocks
run freely, and how far they are apart does not matter.

Measuring a link by talking to the board at its other end: questions out, times in. Sans-IO.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise
from math import ceil
from typing import NamedTuple

from diffbotctl.links import diffbot_frames as frames
from diffbotctl.links.diffbot_codec import FrameDecoder, encode
from diffbotctl.time import SECOND

DRIFT_WINDOW = 20 * SECOND  # the clocks of a board and a host drift by less than 2 ms in it


class Arrival(NamedTuple):
    """One state frame: when it came, when the board took it (ns, clocks of their own), its
    number."""

    came: int
    taken: int
    sequence: int


class LinkFigures(NamedTuple):
    """A link in figures; times in s, shares of 1."""

    frames: int
    rate: float  # Hz, of what came
    lost: float  # share of the frames that never came
    damaged: int
    latency: float  # median time from a question to its answer
    latency_worst: float
    jitter: float  # 95 of 100 frames came no later than this after the fastest
    jitter_worst: float
    silence: float  # the longest


def link_figures(
    heard: Sequence[Arrival], answers: Sequence[float], damaged: int, sequences: int
) -> LinkFigures:
    """`answers`: seconds each question took; frames' numbers count modulo `sequences`.

    Raises ValueError for fewer than two frames or no answer.
    """
    if len(heard) < 2 or not answers:
        raise ValueError("too little was heard to measure anything")
    missing = sum((b.sequence - a.sequence - 1) % sequences for a, b in pairwise(heard))
    late = frame_delays(heard)
    span = (heard[-1].came - heard[0].came) / SECOND
    silence = max(b.came - a.came for a, b in pairwise(heard)) / SECOND
    return LinkFigures(
        len(heard),
        (len(heard) - 1) / span,
        missing / (missing + len(heard)),
        damaged,
        percentile(answers, 0.5),
        max(answers),
        percentile(late, 0.95),
        max(late),
        silence,
    )


def frame_delays(heard: Sequence[Arrival]) -> list[float]:
    """How much later than the fastest frame of its time each one came, s."""
    found: list[float] = []
    begin = 0
    while begin < len(heard):
        first = heard[begin].came
        window = [each for each in heard[begin:] if each.came - first < DRIFT_WINDOW]
        fastest = min(each.came - each.taken for each in window)
        found += [(each.came - each.taken - fastest) / SECOND for each in window]
        begin += len(window)
    return found


def percentile(values: Sequence[float], part: float) -> float:
    """The value that `part` of all do not exceed."""
    ordered = sorted(values)
    return ordered[max(ceil(part * len(ordered)), 1) - 1]


QUERY_PERIOD = 250_000_000  # ns; an answer takes 18 ms of a line of 9600 baud
REPLY_TIMEOUT = SECOND  # ns; an answer that comes later is taken for lost
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
        self._ask_at = now + QUERY_PERIOD
        if self._asked is not None and now - self._asked < REPLY_TIMEOUT:
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
