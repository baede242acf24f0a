"""How long the flanks of a slot sensor chatter, from every flank that its wire had."""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Sequence
from math import ceil, pi

from diffbotctl.calibrate.findings import Finding, Reading
from diffbotctl.config.robot import Robot
from diffbotctl.config.sides import SIDES
from diffbotctl.links.diffbot_telemetry import RawEdge

SECONDS = 1e-9
# By hand a slot stays open for 20 ms and more: flanks nearer to each other than this are chatter.
CHATTER = 0.0035  # s
SAFE = 1.5  # times the longest chatter
FINE = 0.0005  # s; glitch times are rounded up to whole ones of it
SHARE = 1 / 3  # of the shortest time that a slot is open, at full speed: more would lose slots
BINS = (0.0001, 0.0002, 0.0005, 0.001, 0.002, 0.0035)  # s, upper ends of the histogram's classes
LEAST = 20  # flanks, fewer tell nothing
BAR = 30  # characters of the longest bar


def bursts(times: Sequence[int]) -> list[float]:
    """How long each flank chattered (s): from its first to the last that followed closely."""
    found: list[float] = []
    first = last = None
    for time in sorted(times):
        if first is None or last is None or (time - last) * SECONDS > CHATTER:
            if first is not None and last is not None:
                found.append((last - first) * SECONDS)
            first = time
        last = time
    if first is not None and last is not None:
        found.append((last - first) * SECONDS)
    return found


def read(edges: Sequence[RawEdge], robot: Robot) -> Reading:
    """Histograms of both wheels, and a longer glitch time where the one in use is too short."""
    made = Reading([], [], [])
    longest = 0.0
    for wheel, side in enumerate(SIDES):
        times = [edge.time for edge in edges if edge.wheel == wheel]
        if len(times) < LEAST:
            continue
        lengths = [each for each in bursts(times) if each > 0.0]
        made.report.extend(_histogram(side, lengths, len(times)))
        longest = max([longest, *lengths])
    encoder = robot.drive.left.encoder
    open_time = pi / encoder.slots / robot.drive.left.motor.rated
    wanted = ceil(SAFE * longest / FINE) * FINE
    if longest <= encoder.glitch / SAFE:
        return made
    if wanted > SHARE * open_time:
        made.faults.append(
            f"the encoders' flanks chatter for {longest * 1000:.1f} ms, too long to be looked away "
            "from at full speed: a capacitor of 100 nF from the signal to ground ends that"
        )
    else:
        made.report.append(
            f"glitch time {wanted * 1000:g} ms instead of {encoder.glitch * 1000:g} ms"
        )
        made.findings.extend(Finding(f"drive.{side}.encoder.glitch", wanted) for side in SIDES)
    return made


def _histogram(side: str, lengths: Sequence[float], flanks: int) -> list[str]:
    if not lengths:
        return [f"{side} encoder: {flanks} flanks, none of them chattered"]
    counts = [0] * (len(BINS) + 1)
    for length in lengths:
        counts[bisect_right(BINS, length)] += 1
    lines = [
        f"{side} encoder: {len(lengths)} flanks chattered, {max(lengths) * 1000:.1f} ms at most"
    ]
    low = 0.0
    for high, count in zip((*BINS, 0.0), counts, strict=True):
        if count:
            name = f"{low * 1000:g} to {high * 1000:g} ms" if high else f"beyond {low * 1000:g} ms"
            lines.append(f"  {name:<15} {count:>4} {'#' * max(1, BAR * count // max(counts))}")
        low = high
    return lines
