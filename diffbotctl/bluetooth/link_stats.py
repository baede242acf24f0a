"""Measurement of a radio link: probe frames to the board, and statistics of what arrives. Sans-IO.

Jitter is how much later than the fastest one a frame arrives, by the board's own time stamps: both
clocks run freely, and their offset does not matter.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise
from math import ceil
from typing import NamedTuple

from diffbotctl.links import diffbot_frames as frames
from diffbotctl.links.diffbot_codec import FrameDecoder, encode
from diffbotctl.time import MILLISECOND, SECOND

DRIFT_WINDOW = 20 * SECOND  # in it the clocks of board and host drift by less than 2 ms
QUERY_PERIOD = 250 * MILLISECOND  # an answer takes 18 ms at 9600 baud
REPLY_TIMEOUT = SECOND  # a later answer counts as lost
SEQUENCE_NUMBERS = 64  # of state frames
STAMP_WRAP = (1 << 16) * frames.TICK_NANOSECONDS  # ns after which the board's time stamp wraps


class Arrival(NamedTuple):
    """One state frame: when it arrived, the board's time stamp (ns, own clocks), its number."""

    came: int
    taken: int
    sequence: int


class LinkFigures(NamedTuple):
    """Statistics of a link; times in s, shares of 1."""

    frames: int
    rate: float  # Hz, of the frames that arrived
    lost: float  # share of the frames that did not
    damaged: int
    latency: float  # median time from a query to its answer
    latency_worst: float
    jitter: float  # 95 of 100 frames arrived no later than this after the fastest
    jitter_worst: float
    silence: float  # the longest


def link_figures(
    arrivals: Sequence[Arrival], answers: Sequence[float], damaged: int, sequences: int
) -> LinkFigures:
    """`answers`: seconds each query took; numbers of frames count modulo `sequences`.

    Raises ValueError for fewer than two frames or no answer.
    """
    if len(arrivals) < 2 or not answers:
        raise ValueError("too few frames arrived to measure the link")
    pairs = list(pairwise(arrivals))
    missing = sum((after.sequence - before.sequence - 1) % sequences for before, after in pairs)
    delays = frame_delays(arrivals)
    return LinkFigures(
        len(arrivals),
        (len(arrivals) - 1) / ((arrivals[-1].came - arrivals[0].came) / SECOND),
        missing / (missing + len(arrivals)),
        damaged,
        percentile(answers, 0.5),
        max(answers),
        percentile(delays, 0.95),
        max(delays),
        max(after.came - before.came for before, after in pairs) / SECOND,
    )


def frame_delays(arrivals: Sequence[Arrival]) -> list[float]:
    """How much later than the fastest frame of its DRIFT_WINDOW each one arrived, s."""
    delays: list[float] = []
    while len(delays) < len(arrivals):
        first = arrivals[len(delays)].came
        window = [a for a in arrivals[len(delays) :] if a.came - first < DRIFT_WINDOW]
        fastest = min(arrival.came - arrival.taken for arrival in window)
        delays += [(arrival.came - arrival.taken - fastest) / SECOND for arrival in window]
    return delays


def percentile(values: Sequence[float], share: float) -> float:
    """The value that `share` of all values do not exceed."""
    ordered = sorted(values)
    return ordered[max(ceil(share * len(ordered)), 1) - 1]


class LinkProbe:
    """Sends ASK frames periodically and records what arrives. No motor moves."""

    def __init__(self, now: int) -> None:
        """`now`: ns, as all times."""
        self._decoder = FrameDecoder()
        self._next_query = now
        self._pending_since: int | None = None  # since when an answer is awaited
        self.arrivals: list[Arrival] = []
        self.answers: list[float] = []
        """s that each query took"""

    def due(self) -> int:
        """When `send` has a frame to send."""
        return self._next_query

    def send(self, now: int) -> bytes:
        """A query, when one is due."""
        if now < self._next_query:
            return b""
        self._next_query = now + QUERY_PERIOD
        if self._pending_since is not None and now - self._pending_since < REPLY_TIMEOUT:
            return b""
        self._pending_since = now
        return encode(frames.AskFrame(frames.VERSION))

    def receive(self, now: int, data: bytes) -> None:
        for frame in self._decoder.feed(data):
            if isinstance(frame, frames.HelloFrame) and self._pending_since is not None:
                self.answers.append((now - self._pending_since) / SECOND)
                self._pending_since = None
            elif isinstance(frame, frames.StateFrame | frames.CountsFrame):
                time = self._unwrapped(now, frame.time)
                self.arrivals.append(Arrival(now, time, frame.sequence))

    def figures(self) -> LinkFigures:
        """The statistics. Raises ValueError when too little arrived."""
        damaged = self._decoder.damaged
        return link_figures(self.arrivals, self.answers, damaged, SEQUENCE_NUMBERS)

    def _unwrapped(self, now: int, stamp: int) -> int:
        """The board's time, unwrapped: the one nearest to the time since the last frame."""
        time = stamp * frames.TICK_NANOSECONDS
        if not self.arrivals:
            return time
        last = self.arrivals[-1]
        expected = last.taken + now - last.came
        return time + round((expected - time) / STAMP_WRAP) * STAMP_WRAP
