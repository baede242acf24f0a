"""How long the flanks of a slot sensor chatter, from every flank that its wire had.

The open share of each encoder's disc, from every flank that the wires had.

A disc whose slots are as wide as its bars has 0.5. What light barrier and comparator make of it may
be another share, so it is measured at the wire, where it matters: it tells how far a wheel that
turns back must go until it meets the next flank that counts.

How many slots a disc has, from turns by hand.
"""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Iterator, Mapping, Sequence
from math import ceil, pi, sqrt
from statistics import fmean, median, pstdev

from diffbotctl.calibrate.result import Finding, PartResult
from diffbotctl.config.robot import SIDES, Robot
from diffbotctl.links.diffbot_telemetry import RawEdge

NS = 1e-9
# By hand a slot stays open for 20 ms and more: flanks nearer to each other than this are chatter.
BOUNCE_GAP_MAX_S = 0.0035  # s
GLITCH_MARGIN = 1.5  # times the longest chatter
GLITCH_STEP_S = 0.0005  # s; glitch times are rounded up to whole ones of it
GLITCH_OPEN_TIME_RATIO_MAX = (
    1 / 3
)  # of the shortest time that a slot is open, at full speed: more would lose slots
HISTOGRAM_BINS_S = (
    0.0001,
    0.0002,
    0.0005,
    0.001,
    0.002,
    0.0035,
)  # s, upper ends of the histogram's classes
GLITCH_EDGES_MIN = 20  # flanks, fewer tell nothing
HISTOGRAM_BAR_MAX = 30  # characters of the longest bar


def bounce_times(times: Sequence[int]) -> list[float]:
    """How long each flank chattered (s): from its first to the last that followed closely."""
    found: list[float] = []
    first = last = None
    for time in sorted(times):
        if first is None or last is None or (time - last) * NS > BOUNCE_GAP_MAX_S:
            if first is not None and last is not None:
                found.append((last - first) * NS)
            first = time
        last = time
    if first is not None and last is not None:
        found.append((last - first) * NS)
    return found


def measure_glitch(edges: Sequence[RawEdge], robot: Robot) -> PartResult:
    """Histograms of both wheels, and a longer glitch time where the one in use is too short."""
    made = PartResult([], [], [])
    longest = 0.0
    for wheel, side in enumerate(SIDES):
        times = [edge.time for edge in edges if edge.wheel == wheel]
        if len(times) < GLITCH_EDGES_MIN:
            continue
        lengths = [each for each in bounce_times(times) if each > 0.0]
        made.report.extend(_histogram(side, lengths, len(times)))
        longest = max([longest, *lengths])
    encoder = robot.drive.left.encoder
    open_time = pi / encoder.slots / robot.drive.left.motor.rated
    wanted = ceil(GLITCH_MARGIN * longest / GLITCH_STEP_S) * GLITCH_STEP_S
    if longest <= encoder.glitch / GLITCH_MARGIN:
        return made
    if wanted > GLITCH_OPEN_TIME_RATIO_MAX * open_time:
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
    counts = [0] * (len(HISTOGRAM_BINS_S) + 1)
    for length in lengths:
        counts[bisect_right(HISTOGRAM_BINS_S, length)] += 1
    lines = [
        f"{side} encoder: {len(lengths)} flanks chattered, {max(lengths) * 1000:.1f} ms at most"
    ]
    low = 0.0
    for high, count in zip((*HISTOGRAM_BINS_S, 0.0), counts, strict=True):
        if count:
            name = f"{low * 1000:g} to {high * 1000:g} ms" if high else f"beyond {low * 1000:g} ms"
            lines.append(
                f"  {name:<15} {count:>4} {'#' * max(1, HISTOGRAM_BAR_MAX * count // max(counts))}"
            )
        low = high
    return lines


SLOT_DUTY_PITCHES_MIN = 40  # pitches, fewer tell nothing: two turns of a usual disc
PITCH_RATIO_MAX = 1.8  # times the median pitch: the hand rests or turns back within it
TRIM_RATIO = 0.1  # of the pitches at either end of the order: where a hand jerks
SLOT_DUTY_SD_MIN = 0.003  # the least standard deviation that is stated: a barrier's delay is in it
SLOT_DUTY_RANGE = (0.2, 0.8)  # beyond this the barrier sees the disc's rim, or its threshold is off


def measure_slot_duty(edges: Sequence[RawEdge], robot: Robot) -> PartResult:
    """The share of both discs, where enough pitches were seen.

    `edges` are flanks of wheels that turned one way, at any speed that changes slowly.
    """
    made = PartResult([], [], [])
    for wheel, side in enumerate(SIDES):
        encoder = getattr(robot.drive, side).encoder
        flanks = [each for each in edges if each.wheel == wheel]
        counted = 0 if encoder.edge == "falling" else 1
        parts = sorted(slot_duties(flanks, encoder.glitch, counted))
        if len(parts) < SLOT_DUTY_PITCHES_MIN:
            continue
        cut = int(TRIM_RATIO * len(parts))
        kept = parts[cut : len(parts) - cut]
        share, sd = fmean(kept), max(pstdev(kept) / sqrt(len(kept)), SLOT_DUTY_SD_MIN)
        if not SLOT_DUTY_RANGE[0] <= share <= SLOT_DUTY_RANGE[1]:
            made.faults.append(
                f"the {side} encoder's pin keeps one level for {max(share, 1 - share):.0%} of a "
                "pitch: move the light barrier so that its beam meets the middle of the slots"
            )
            continue
        made.findings.append(Finding(f"drive.{side}.encoder.open_share", share, sd))
        made.report.append(f"{side} disc: open for {share:.1%} of a pitch, from {len(parts)}")
    return made


def slot_duties(flanks: Sequence[RawEdge], glitch: float, counted: int) -> Iterator[float]:
    """Of each whole pitch, the share during which the pin is at level `counted`.

    A pitch lies between two flanks to that level; `glitch` (s) is how long a flank may chatter.
    Pitches in which the wheel rested or turned back are left out.
    """
    clean = list(_debounced(sorted(flanks), glitch))
    found = [
        (third.time - first.time, second.time - first.time)
        for first, second, third in zip(clean, clean[1:], clean[2:], strict=False)
        if first.level == counted
    ]
    usual = median(whole for whole, _ in found) if found else 0.0
    for whole, part in found:
        if whole < PITCH_RATIO_MAX * usual:
            yield part / whole


def _debounced(flanks: Sequence[RawEdge], glitch: float) -> Iterator[RawEdge]:
    """The first flank of each burst, levels in turn."""
    last: RawEdge | None = None
    level = None
    for flank in flanks:
        near = last is not None and (flank.time - last.time) * NS < glitch
        last = flank
        if not near and flank.level != level:
            level = flank.level
            yield flank


# Counts that a roll may be off the others: its two ends, and where the hand stopped.
COUNT_TOLERANCE = 2
SLOTS_TOLERANCE = 0.25  # of a slot, how far the mean may lie from a whole number


def count_slots(rolls: Mapping[str, Sequence[int]], turns: int, robot: Robot) -> PartResult:
    """Counts of each roll of `turns` turns, by side. A roll that is unlike the others is left out;
    slots that differ from the stated ones become findings."""
    made = PartResult([], [], [])
    stated = {
        "left": robot.drive.left.encoder.slots,
        "right": robot.drive.right.encoder.slots,
    }
    found: dict[str, int] = {}
    for side, counts in rolls.items():
        _count_side(made, found, side, counts, turns, stated[side])
    if len(set(found.values())) > 1:
        made.faults.append(
            f"the discs have {found['left']} and {found['right']} slots: the board can only count "
            "with one number for both; fit two equal discs"
        )
    elif found and next(iter(found.values())) not in stated.values():
        slots = next(iter(found.values()))
        # The wheel that could not be counted has the same disc as the other.
        made.findings.extend(Finding(f"drive.{side}.encoder.slots", slots) for side in stated)
    return made


def _count_side(
    made: PartResult,
    found: dict[str, int],
    side: str,
    counts: Sequence[int],
    turns: int,
    stated: int,
) -> None:
    middle = median(counts)
    good = [count for count in counts if abs(count - middle) <= COUNT_TOLERANCE]
    per_turn = sum(good) / len(good) / turns
    for number, count in enumerate(counts, 1):
        if count not in good:
            made.report.append(f"{side} roll {number} left out: {count} counts, not {middle:g}")
    spread = (max(good) - min(good)) / turns
    slots = round(per_turn)
    told = f"{side} disc: {per_turn:.2f} counts a turn from {len(good)} rolls, spread {spread:.2f}"
    if (len(good) < 2 and len(counts) > 1) or abs(per_turn - slots) > SLOTS_TOLERANCE or slots < 1:
        made.faults.append(
            f"{told}: no whole number of slots. Was it turned exactly {turns} times, forward, and "
            "not too fast? If so the encoder loses edges, or bounces"
        )
        return
    found[side] = slots
    made.report.append(f"{told}: {slots} slots" + ("" if slots == stated else f", not {stated}"))
