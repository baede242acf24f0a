"""Fits of the encoders: bounce and slot duty from captured edges, slots from turns by hand.

A disc whose slots are as wide as its bars has a slot duty of 0.5. Light barrier and comparator
change it, so it is measured at the signal wire: the value determines how far a wheel that reverses
turns before the next counted edge.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from math import ceil, pi, sqrt
from statistics import fmean, median, pstdev

from diffbotctl.calibrate.result import Finding, PartResult
from diffbotctl.calibrate.session import drive_sides
from diffbotctl.config.robot import SIDES, Robot
from diffbotctl.links.diffbot_telemetry import RawEdge

NS = 1e-9  # s
BOUNCE_GAP_MAX_S = 0.0035  # by hand a slot stays open for 20 ms or more
GLITCH_MARGIN = 1.5  # times the longest bounce
GLITCH_STEP_S = 0.0005  # glitch times are rounded up to a multiple
GLITCH_OPEN_TIME_RATIO_MAX = 1 / 3  # of the open time at full speed; more would lose slots
GLITCH_EDGES_MIN = 20

SLOT_DUTY_PITCHES_MIN = 40  # two turns of a usual disc
PITCH_TIME_RATIO_MAX = 1.8  # times the median; longer ones contain a pause or a reversal
TRIM_RATIO = 0.1  # of the sorted slot duties at either end
SLOT_DUTY_SD_MIN = 0.003  # the delay of the light barrier
SLOT_DUTY_MIN, SLOT_DUTY_MAX = 0.2, 0.8  # outside, the beam meets the rim, or the threshold is off

COUNT_TOLERANCE = 2  # between rolls: one count at each end
SLOTS_TOLERANCE = 0.25  # of the mean from a whole number
# By which a hand ends beside the mark, 7 degrees: less than a slot of a coarse disc, many of a fine
# one, whose slots are then known to a thousandth only.
HAND_ERROR_TURNS = 0.02


def bounce_times(times: Sequence[int]) -> list[float]:
    """The duration (s) of each burst of edges; 0 for an edge without bounce. `times` in ns."""
    bursts: list[list[int]] = []
    for time in sorted(times):
        if bursts and (time - bursts[-1][1]) * NS <= BOUNCE_GAP_MAX_S:
            bursts[-1][1] = time
        else:
            bursts.append([time, time])
    return [(last - first) * NS for first, last in bursts]


def measure_glitch(edges: Sequence[RawEdge], robot: Robot) -> PartResult:
    """The bounce of both wheels, and a longer glitch time if the present one is too short."""
    result = PartResult([], [], [])
    longest = 0.0
    for wheel, side in enumerate(SIDES):
        times = [edge.time for edge in edges if edge.wheel == wheel]
        if len(times) < GLITCH_EDGES_MIN:
            continue
        bounces = [bounce for bounce in bounce_times(times) if bounce > 0.0]
        result.report.append(
            f"{side} encoder: {len(bounces)} of {len(times)} edges bounced, for at most "
            f"{max(bounces, default=0.0) * 1000:.1f} ms"
        )
        longest = max([longest, *bounces])
    left = robot.drive.left
    glitch = ceil(GLITCH_MARGIN * longest / GLITCH_STEP_S) * GLITCH_STEP_S
    if longest <= left.encoder.glitch / GLITCH_MARGIN:
        return result
    if glitch > GLITCH_OPEN_TIME_RATIO_MAX * (pi / left.encoder.slots / left.motor.rated):
        result.faults.append(
            f"the encoder edges bounce for {longest * 1000:.1f} ms, too long to be filtered at "
            "full speed: connect 100 nF from the signal to ground"
        )
    else:
        result.report.append(
            f"glitch time {glitch * 1000:g} ms instead of {left.encoder.glitch * 1000:g} ms"
        )
        result.findings.extend(Finding(f"drive.{side}.encoder.glitch", glitch) for side in SIDES)
    return result


def measure_slot_duty(edges: Sequence[RawEdge], robot: Robot) -> PartResult:
    """The slot duty of both discs, where enough pitches were captured.

    `edges` are those of wheels that turned in one direction at a slowly changing speed.
    """
    result = PartResult([], [], [])
    for wheel, side in enumerate(SIDES):
        encoder = drive_sides(robot)[side].encoder
        counted_level = 0 if encoder.edge == "falling" else 1
        wheel_edges = [edge for edge in edges if edge.wheel == wheel]
        duties = sorted(slot_duties(wheel_edges, encoder.glitch, counted_level))
        if len(duties) < SLOT_DUTY_PITCHES_MIN:
            continue
        trim = int(TRIM_RATIO * len(duties))
        kept = duties[trim : len(duties) - trim]
        duty, sd = fmean(kept), max(pstdev(kept) / sqrt(len(kept)), SLOT_DUTY_SD_MIN)
        if not SLOT_DUTY_MIN <= duty <= SLOT_DUTY_MAX:
            result.faults.append(
                f"the {side} encoder has one level for {max(duty, 1 - duty):.0%} of a pitch: "
                "move the light barrier so that its beam passes through the middle of the slots"
            )
            continue
        result.findings.append(Finding(f"drive.{side}.encoder.open_share", duty, sd))
        result.report.append(f"{side} disc: open for {duty:.1%} of a pitch ({len(duties)} pitches)")
    return result


def slot_duties(edges: Sequence[RawEdge], glitch: float, counted_level: int) -> Iterator[float]:
    """For each whole pitch, the share of its time during which the pin is at `counted_level`.

    A pitch lies between two edges to that level; `glitch` (s) is the longest bounce. Pitches in
    which the wheel paused or reversed are left out.
    """
    clean = list(_debounced(sorted(edges), glitch))
    pitches = [
        (third.time - first.time, second.time - first.time)
        for first, second, third in zip(clean, clean[1:], clean[2:], strict=False)
        if first.level == counted_level
    ]
    typical = median(whole for whole, _ in pitches) if pitches else 0.0
    for whole, part in pitches:
        if whole < PITCH_TIME_RATIO_MAX * typical:
            yield part / whole


def _debounced(edges: Sequence[RawEdge], glitch: float) -> Iterator[RawEdge]:
    """The first edge of each burst, with alternating levels."""
    last: RawEdge | None = None
    level = None
    for edge in edges:
        is_bounce = last is not None and (edge.time - last.time) * NS < glitch
        last = edge
        if not is_bounce and edge.level != level:
            level = edge.level
            yield edge


def count_slots(rolls: Mapping[str, Sequence[int]], turns: int, robot: Robot) -> PartResult:
    """The number of slots from the counts of each roll of `turns` turns, by side.

    A roll that differs from the others is left out. The slots become findings, those as stated too:
    from then on they are known to be right.
    """
    result = PartResult([], [], [])
    encoders = {side: section.encoder for side, section in drive_sides(robot).items()}
    stated = {side: encoder.slots for side, encoder in encoders.items()}
    slots = {}
    for side, counts in rolls.items():
        passed = [count / encoders[side].counts_of_slot for count in counts]
        number = _count_side(result, side, passed, turns, stated[side])
        if number is not None:
            slots[side] = number
    numbers = set(slots.values())
    if numbers and max(numbers) - min(numbers) <= HAND_ERROR_TURNS * max(numbers) / turns:
        numbers = {round(fmean(slots.values()))}  # two equal fine discs
    if len(numbers) > 1:
        result.faults.append(
            f"the discs have {slots['left']} and {slots['right']} slots, but the board supports "
            "only one number for both: fit two equal discs"
        )
    elif numbers:
        # A wheel that could not be counted has the same disc as the other.
        value = (numbers & set(stated.values()) or numbers).pop()
        result.findings.extend(Finding(f"drive.{side}.encoder.slots", value) for side in stated)
    return result


def _count_side(
    result: PartResult, side: str, counts: Sequence[float], turns: int, stated: int
) -> int | None:
    """The slots of one disc, added to the report; None and a fault if it is no whole number.

    `counts`: of slots, in fractions where the board counts several edges of one.
    """
    middle = median(counts)
    by_hand = HAND_ERROR_TURNS * middle / turns  # slots
    tolerance = max(COUNT_TOLERANCE, by_hand)
    good = [count for count in counts if abs(count - middle) <= tolerance] or [middle]
    per_turn = sum(good) / len(good) / turns
    for number, count in enumerate(counts, 1):
        if count not in good:
            result.report.append(
                f"{side} wheel, time {number} left out: {count:g} counts instead of {middle:g}"
            )
    spread = (max(good) - min(good)) / turns
    is_fine = by_hand / turns > SLOTS_TOLERANCE
    is_as_stated = is_fine and abs(per_turn - stated) <= by_hand / turns
    slots = stated if is_as_stated else round(per_turn)
    text = f"{side} disc: {per_turn:.2f} counts per turn, spread {spread:.2f}"
    is_single = len(good) < 2 and len(counts) > 1
    is_whole = is_fine or abs(per_turn - slots) <= SLOTS_TOLERANCE
    if is_single or not is_whole or slots < 1:
        result.faults.append(
            f"{text}: not a whole number. Was the wheel turned exactly {turns} times, forward, and "
            "not too fast? If so, the encoder loses edges or bounces"
        )
        return None
    result.report.append(
        f"{text}: {slots} slots" + ("" if slots == stated else f" instead of {stated}")
    )
    return slots
