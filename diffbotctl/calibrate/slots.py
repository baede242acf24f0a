"""How many slots a disc has, from turns by hand."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from statistics import median

from diffbotctl.calibrate.findings import Finding, Reading
from diffbotctl.config.robot import Robot

# Counts that a roll may be off the others: its two ends, and where the hand stopped.
ENDS = 2
NEAR = 0.25  # of a slot, how far the mean may lie from a whole number


def read(rolls: Mapping[str, Sequence[int]], turns: int, robot: Robot) -> Reading:
    """Counts of each roll of `turns` turns, by side. A roll that is unlike the others is left out;
    slots that differ from the stated ones become findings."""
    made = Reading([], [], [])
    stated = {
        "left": robot.drive.left.encoder.slots,
        "right": robot.drive.right.encoder.slots,
    }
    found: dict[str, int] = {}
    for side, counts in rolls.items():
        _one(made, found, side, counts, turns, stated[side])
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


def _one(
    made: Reading, found: dict[str, int], side: str, counts: Sequence[int], turns: int, stated: int
) -> None:
    middle = median(counts)
    good = [count for count in counts if abs(count - middle) <= ENDS]
    per_turn = sum(good) / len(good) / turns
    for number, count in enumerate(counts, 1):
        if count not in good:
            made.report.append(f"{side} roll {number} left out: {count} counts, not {middle:g}")
    spread = (max(good) - min(good)) / turns
    slots = round(per_turn)
    told = f"{side} disc: {per_turn:.2f} counts a turn from {len(good)} rolls, spread {spread:.2f}"
    if (len(good) < 2 and len(counts) > 1) or abs(per_turn - slots) > NEAR or slots < 1:
        made.faults.append(
            f"{told}: no whole number of slots. Was it turned exactly {turns} times, forward, and "
            "not too fast? If so the encoder loses edges, or bounces"
        )
        return
    found[side] = slots
    made.report.append(f"{told}: {slots} slots" + ("" if slots == stated else f", not {stated}"))
