"""What is expected of the faults of an encoder, and of its motion, before anything was counted."""

from __future__ import annotations

import sys
from math import sqrt

from diffbotctl.estimation.likelihood import normal_density

# Shares of faults that an encoder may have, and their probability before anything was counted.
FAULTY = 0.06
SHARES = (
    (0.003, 0.15),
    (0.006, 0.15),
    (0.0125, 0.15),
    (0.025, 0.2),
    (0.035, 0.1),
    (0.05, 0.1),
    (0.07, 0.07),
    (0.1, 0.05),
    (0.2, 0.03),
)
# Share of the deviations in which the motion itself was not smooth, such as at a start or a seam of
# the floor, and the change of the speed then, relative to it.
ROUGH_SHARE, ROUGH_CHANGE = 0.01, 0.1
SHARE_UNKNOWN = sqrt(FAULTY * sum((share * share * part for share, part in SHARES), 0.0))


def rough_density(square: float, edges: float, noise: float) -> float:
    """Density of a squared deviation of spans with `edges` where the motion was not smooth, times
    its probability. `noise`: variance of one without faults. It is above 0, so that it has a
    logarithm: interference at a wheel that stands gives edges that nothing explains."""
    density = normal_density(square, noise + (ROUGH_CHANGE * edges) ** 2)
    return ROUGH_SHARE * max(density, sys.float_info.min)
