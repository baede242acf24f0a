"""Every check, in the order in which they are made."""

from __future__ import annotations

from collections.abc import Callable

from diffbotctl.config.case import Case
from diffbotctl.config.checks import (
    budget,
    calibrated,
    channels,
    deadman,
    edges,
    fields,
    loops,
    names,
    outline,
    pins,
    polarity,
    reach,
    speed,
    tolerance,
    wires,
    wiring,
)

CHECKS: tuple[Callable[[Case], None], ...] = (
    names.check,
    wires.check,
    loops.check,
    fields.check,
    pins.check,
    channels.check,
    budget.check,
    deadman.check,
    speed.check,
    outline.check,
    reach.check,
    tolerance.check,
    edges.check,
    polarity.check,
    wiring.check,
    calibrated.check,
)
