"""What a radio link is like, from the frames that came over it; pure arithmetic.

Jitter is how much later than the fastest one a frame came, by the board's own stamps: both clocks
run freely, and how far they are apart does not matter.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise
from math import ceil
from typing import NamedTuple

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
    late = lateness(heard)
    span = (heard[-1].came - heard[0].came) / SECOND
    silence = max(b.came - a.came for a, b in pairwise(heard)) / SECOND
    return LinkFigures(
        len(heard),
        (len(heard) - 1) / span,
        missing / (missing + len(heard)),
        damaged,
        share(answers, 0.5),
        max(answers),
        share(late, 0.95),
        max(late),
        silence,
    )


def lateness(heard: Sequence[Arrival]) -> list[float]:
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


def share(values: Sequence[float], part: float) -> float:
    """The value that `part` of all do not exceed."""
    ordered = sorted(values)
    return ordered[max(ceil(part * len(ordered)), 1) - 1]
