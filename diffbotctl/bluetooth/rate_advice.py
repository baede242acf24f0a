"""Recommended rates for a link, from its measured statistics."""

from __future__ import annotations

from typing import NamedTuple

from diffbotctl.bluetooth.link_stats import LinkFigures
from diffbotctl.links import link_protocol

BAUD_RATES = (9600, 19200, 38400, 57600, 115200)  # of an HC-05 and of our firmware
TELEMETRY_GOOD_HZ, TELEMETRY_MAX_HZ = 36, 100  # the firmware sends at most 100
TELEMETRY_STEP_HZ = 2
COMMAND_PERIOD_S = 0.1  # between two commands of the same content
DEADMAN_MIN_S, DEADMAN_MAX_S = 0.3, 0.5  # the default, and the maximum
DEADMAN_MARGIN_S = 0.05
LOSS_MAX_RATIO = 0.05  # beyond it two commands in a row are lost each minute or so


class RateAdvice(NamedTuple):
    """What to write into the robot file, and why."""

    telemetry: int  # Hz
    baud: int
    deadman: float  # s
    reasons: tuple[str, ...]


def advise_rate(figures: LinkFigures, baud: int, frame: int) -> RateAdvice:
    """Rates for a link of these figures, now at `baud`; one state frame takes `frame` bytes."""
    reasons = []
    telemetry, best_baud = max_telemetry_rate(baud, frame), baud
    if telemetry < TELEMETRY_GOOD_HZ and baud != BAUD_RATES[-1]:
        fast = (rate for rate in BAUD_RATES if max_telemetry_rate(rate, frame) >= TELEMETRY_GOOD_HZ)
        best_baud = next(fast, baud)
        best_telemetry = max_telemetry_rate(best_baud, frame)
        reasons.append(
            f"{baud} baud carries {telemetry} frames a second, {best_baud} would carry "
            f"{best_telemetry}: `diffbotctl bluetooth baud {best_baud}` changes the module"
        )
        telemetry = best_telemetry
    # One command lost, the next one late.
    gap = 2 * COMMAND_PERIOD_S + figures.jitter_worst + DEADMAN_MARGIN_S
    deadman = min(max(DEADMAN_MIN_S, round(gap + 0.005, 2)), DEADMAN_MAX_S)
    if deadman > DEADMAN_MIN_S:
        reasons.append(
            f"frames arrive up to {figures.jitter_worst * 1000:.0f} ms late: a dead-man "
            "time of 300 ms would stop the robot occasionally"
        )
    if gap > DEADMAN_MAX_S:
        reasons.append(
            "even the longest dead-man time will stop the robot occasionally: reduce the "
            "distance, and move other radios (a wireless network) away"
        )
    if figures.lost > LOSS_MAX_RATIO:
        reasons.append(
            f"{figures.lost:.0%} of the frames are lost: the module's supply voltage drops, or "
            "its rate differs slightly from the board's; check its wires"
        )
    return RateAdvice(telemetry, best_baud, deadman, tuple(reasons))


def max_telemetry_rate(baud: int, frame: int) -> int:
    """Frames a second that fit, in steps of TELEMETRY_STEP_HZ."""
    fitting = int(link_protocol.TELEMETRY_LOAD_MAX * link_protocol.capacity(baud) / frame)
    steps = fitting // TELEMETRY_STEP_HZ * TELEMETRY_STEP_HZ
    return max(min(steps, TELEMETRY_MAX_HZ), TELEMETRY_STEP_HZ)
