"""Which rates suit a link, from what was measured of it."""

from __future__ import annotations

from typing import NamedTuple

from diffbotctl.bluetooth.link_stats import LinkFigures
from diffbotctl.links import bandwidth

RATES = (9600, 19200, 38400, 57600, 115200)  # baud, of an HC-05 and of our firmware
SLOWEST, FASTEST = 20, 100  # Hz of telemetry; the firmware gives no more than 100
ROUND = 5  # Hz
REPEAT = 0.1  # s between two commands that say the same
DEADMAN = (0.3, 0.5)  # s: the usual one, and the longest
GUARD = 0.05  # s in hand
BAD_LOSS = 0.05  # share; beyond it two commands in a row are lost each minute or so


class RateAdvice(NamedTuple):
    """What to write into the robot file, and why."""

    telemetry: int  # Hz
    baud: int
    deadman: float  # s
    reasons: tuple[str, ...]


def advise_rate(figures: LinkFigures, baud: int, frame: int) -> RateAdvice:
    """Rates for a link of these figures, now at `baud`; one state frame takes `frame` bytes."""
    reasons = []
    best = max_telemetry_rate(baud, frame)
    wanted = baud
    if best < 2 * SLOWEST and baud != RATES[-1]:
        wanted = next(
            (rate for rate in RATES if max_telemetry_rate(rate, frame) >= 2 * SLOWEST), baud
        )
        more = max_telemetry_rate(wanted, frame)
        reasons.append(
            f"{baud} baud carry {best} frames a second, {wanted} would carry {more}: "
            f"`diffbotctl bluetooth baud {wanted}` changes the module"
        )
        best = max_telemetry_rate(wanted, frame)
    gap = 2 * REPEAT + figures.jitter_worst + GUARD  # one command lost, the next one late
    deadman = min(max(DEADMAN[0], round(gap + 0.005, 2)), DEADMAN[1])
    if deadman > DEADMAN[0]:
        reasons.append(
            f"frames come up to {figures.jitter_worst * 1000:.0f} ms late: a dead-man "
            "of 300 ms would stop the robot now and then"
        )
    if gap > DEADMAN[1]:
        reasons.append(
            "even the longest dead-man will stop the robot now and then: bring the "
            "antennas nearer, and other radios (a wireless network) away"
        )
    if figures.lost > BAD_LOSS:
        reasons.append(
            f"{figures.lost:.0%} of the frames are lost: the module's supply dips, or "
            "its rate and the board's differ a little; look at its wires"
        )
    return RateAdvice(best, wanted, deadman, tuple(reasons))


def max_telemetry_rate(baud: int, frame: int) -> int:
    """Frames a second that fit, in steps that are easily said."""
    fits = int(bandwidth.COMFORTABLE * bandwidth.capacity(baud) / frame)
    return max(min(fits // ROUND * ROUND, FASTEST), ROUND)
