"""The open share of each encoder's disc, from every flank that the wires had.

A disc whose slots are as wide as its bars has 0.5. What light barrier and comparator make of it may
be another share, so it is measured at the wire, where it matters: it tells how far a wheel that
turns back must go until it meets the next flank that counts.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from math import sqrt
from statistics import fmean, median, pstdev

from diffbotctl.calibrate.findings import Finding, Reading
from diffbotctl.config.robot import Robot
from diffbotctl.config.sides import SIDES
from diffbotctl.links.diffbot_telemetry import RawEdge

SECONDS = 1e-9
LEAST = 40  # pitches, fewer tell nothing: two turns of a usual disc
PAUSE = 1.8  # times the median pitch: the hand rests or turns back within it
LEFT_OUT = 0.1  # of the pitches at either end of the order: where a hand jerks
PRECISE = 0.003  # the least standard deviation that is stated: a barrier's delay is in it
USUAL = (0.2, 0.8)  # beyond this the barrier sees the disc's rim, or its threshold is off


def read(edges: Sequence[RawEdge], robot: Robot) -> Reading:
    """The share of both discs, where enough pitches were seen.

    `edges` are flanks of wheels that turned one way, at any speed that changes slowly.
    """
    made = Reading([], [], [])
    for wheel, side in enumerate(SIDES):
        encoder = getattr(robot.drive, side).encoder
        flanks = [each for each in edges if each.wheel == wheel]
        counted = 0 if encoder.edge == "falling" else 1
        parts = sorted(pitches(flanks, encoder.glitch, counted))
        if len(parts) < LEAST:
            continue
        cut = int(LEFT_OUT * len(parts))
        kept = parts[cut : len(parts) - cut]
        share, sd = fmean(kept), max(pstdev(kept) / sqrt(len(kept)), PRECISE)
        if not USUAL[0] <= share <= USUAL[1]:
            made.faults.append(
                f"the {side} encoder's pin keeps one level for {max(share, 1 - share):.0%} of a "
                "pitch: move the light barrier so that its beam meets the middle of the slots"
            )
            continue
        made.findings.append(Finding(f"drive.{side}.encoder.open_share", share, sd))
        made.report.append(f"{side} disc: open for {share:.1%} of a pitch, from {len(parts)}")
    return made


def pitches(flanks: Sequence[RawEdge], glitch: float, counted: int) -> Iterator[float]:
    """Of each whole pitch, the share during which the pin is at level `counted`.

    A pitch lies between two flanks to that level; `glitch` (s) is how long a flank may chatter.
    Pitches in which the wheel rested or turned back are left out.
    """
    clean = list(_clean(sorted(flanks), glitch))
    found = [
        (third.time - first.time, second.time - first.time)
        for first, second, third in zip(clean, clean[1:], clean[2:], strict=False)
        if first.level == counted
    ]
    usual = median(whole for whole, _ in found) if found else 0.0
    for whole, part in found:
        if whole < PAUSE * usual:
            yield part / whole


def _clean(flanks: Sequence[RawEdge], glitch: float) -> Iterator[RawEdge]:
    """The first flank of each burst, levels in turn."""
    last: RawEdge | None = None
    level = None
    for flank in flanks:
        near = last is not None and (flank.time - last.time) * SECONDS < glitch
        last = flank
        if not near and flank.level != level:
            level = flank.level
            yield flank
