"""Lag and dead time of motors whose driver opens between two pulses (fast decay).

No current brakes such a motor in the pauses, so that its lag is longer the lower the duty: after a
step up it is shorter than after a step down, by a ratio that follows from the curve of the motor.
The dead time is the same, so both delays together show both; the shape of one response hardly does.

After a step the battery recovers, or drops, for about half a second, since the current tends to
what friction takes with the lag of the motor. That delays the speed as a dead time does: of usual
batteries by some milliseconds, which no speed distinguishes from a dead time.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from math import hypot

import numpy as np

from diffbotctl.calibrate.motor_fit import (
    LagFit,
    StepEdges,
    StepResponse,
    gather_edges,
    solve_lines,
)
from diffbotctl.control.motor_curve import LAG_DUTY

# s, of a battery that drops by a tenth with both motors stalled; with its standard deviation. Of
# simulated ones that drop by 8 and 20 %: 4 and 12 ms.
BATTERY_DELAY_S, BATTERY_DELAY_SD_S = 0.006, 0.006
VISCOUS_SD = 0.02  # of one motor from that of both, in stall torques at the no-load speed


def fit_fast_lags(
    steps: Sequence[StepResponse],
    slots: Mapping[str, int],
    shares: Mapping[str, tuple[float, float]],
) -> dict[str, LagFit]:
    """The lag of each wheel at LAG_DUTY, and the dead time that both share.

    `slots`: counts per turn; `shares`: of the stated lag, those after a step up and down; all by
    side. Raises ValueError if there are too few edges.
    """
    edges = {side: gather_edges(steps, side == "left", count) for side, count in slots.items()}
    dead_times, variances = [], []
    for side, count in slots.items():
        (_, dead_time), (_, sd) = _delays(edges[side], len(steps), count, shares[side], None)
        dead_times.append(dead_time)
        variances.append(sd**2)
    weights = 1 / np.array(variances)
    mean = float(weights @ dead_times / weights.sum())
    dead_time = max(mean - BATTERY_DELAY_S, 0.0)
    dead_time_sd = hypot(float(weights.sum()) ** -0.5, BATTERY_DELAY_SD_S)
    lags = {}
    for side, count in slots.items():
        (lag,), (lag_sd,) = _delays(
            edges[side], len(steps), count, shares[side], dead_time + BATTERY_DELAY_S
        )
        sd = hypot(lag_sd, lag * VISCOUS_SD / LAG_DUTY)
        lags[side] = LagFit(lag, dead_time, sd, dead_time_sd)
    return lags


def _delays(
    edges: StepEdges,
    count: int,
    slots: int,
    shares: tuple[float, float],
    dead_time: float | None,
) -> tuple[list[float], list[float]]:
    """The lag (s), and the dead time if it is not given, with standard deviations."""
    solution, sd, _ = solve_lines(edges, count, slots, shares, dead_time)
    change = float(solution[count + 1] - solution[count])
    if change <= 0.0:
        raise ValueError("its speed did not increase with the duty")
    last = count + (4 if dead_time is None else 3)
    return (solution[count + 2 : last] / change).tolist(), (sd[count + 2 : last] / change).tolist()
