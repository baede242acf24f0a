"""Answers that the encoder counts contradict are asked again, with the reason.

The person may be right: an encoder may be dead. So an answer that is repeated is accepted.
"""

from __future__ import annotations

from collections.abc import Callable, Generator, Mapping, Sequence
from dataclasses import replace
from statistics import median
from typing import Any

from diffbotctl.calibrate.known_lengths import UNMEASURED_SCALE_SD
from diffbotctl.calibrate.step import Event, Message
from diffbotctl.calibrate.wiring_detection import PULSE_COUNTS_MIN, MotorPulse, WheelMotion
from diffbotctl.config.robot import SIDES
from diffbotctl.prompts.question import Question

ATTEMPTS_MAX = 3
SAME_ANSWER_RATIO = 0.01
SCALE_SDS_MAX = 3.0  # of the first drive, in standard deviations of what is known of the wheels
SCALE_DIFFERENCE_MAX = 0.03  # between drives; slip and tape make a few thousandths
MM = 1000.0


def ask_checked(
    question: Question, contradiction: Callable[[float], str | None]
) -> Generator[Event, Any, float]:
    """The answer to a question of a number; one that is contradicted is asked again."""
    answer = float((yield question))
    for _ in range(ATTEMPTS_MAX - 1):
        reason = contradiction(answer)
        if reason is None:
            break
        yield Message(f"{reason} Measure again; the same answer is accepted.")
        previous, answer = answer, float((yield replace(question, is_repeated=True)))
        if abs(answer - previous) <= SAME_ANSWER_RATIO * abs(previous):
            break
    return answer


def scale_contradiction(
    tape: float, odometry: float, scales: Sequence[float], scale_sd: float = UNMEASURED_SCALE_SD
) -> str | None:
    """Why a distance on the tape (m) does not go with what the wheels counted (m).

    `scales`: tape over odometry of the drives before; `scale_sd`: relative standard deviation of
    the mean wheel diameter.
    """
    expected = median(scales) if scales else 1.0
    limit = SCALE_DIFFERENCE_MAX if scales else max(SCALE_DIFFERENCE_MAX, SCALE_SDS_MAX * scale_sd)
    if abs(tape / (odometry * expected) - 1) <= limit:
        return None
    drives = ", and with the drives before that is" if scales else ":"
    return (
        f"The wheels counted {odometry * MM:.0f} mm{drives} {odometry * expected * MM:.0f} mm on "
        f"the tape, not {tape * MM:.0f} mm."
    )


def pulse_contradiction(
    motion: WheelMotion, counts: Mapping[str, int], noisy: set[str], before: MotorPulse | None
) -> str | None:
    """Why what was seen does not go with the counts of a pulse.

    `noisy`: inputs that count at rest; `before`: the pulse of the other motor, None for the first.
    """
    counted = _counted(counts, noisy)
    if motion is WheelMotion.NONE:
        return "The encoders counted edges, so a wheel turned." if counted else None
    if noisy:
        return None
    if not counted:
        return "No encoder counted an edge, as if no wheel had turned."
    if motion.wheel is None and len(counted) == 1:
        return "Only one encoder counted, as if only one wheel had turned."
    if motion.wheel is not None and len(counted) == 2:
        return "Both encoders counted, as if both wheels had turned."
    if before is None or motion.wheel is None or before.seen.wheel is None:
        return None
    is_same_wheel = motion.wheel == before.seen.wheel
    is_same_input = counted == _counted(before.counts, noisy)
    if is_same_wheel != is_same_input:
        other = "the same encoder" if is_same_input else "another encoder"
        wheel = "the same wheel" if is_same_wheel else "another wheel"
        return f"With the other motor {other} counted, but the answer was {wheel}."
    return None


def _counted(counts: Mapping[str, int], noisy: set[str]) -> list[str]:
    return [side for side in SIDES if side not in noisy and counts[side] >= PULSE_COUNTS_MIN]


def turn_contradiction(side: str, own: int, other: int) -> str | None:
    """Why the counts of turns by hand do not show the wheel of `side`: counts of both inputs."""
    if own >= PULSE_COUNTS_MIN or other < PULSE_COUNTS_MIN:
        return None
    return f"The other encoder counted {other}, and that of the {side} wheel {own}."
