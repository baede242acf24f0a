"""Every check, in the order in which they are made."""

from __future__ import annotations

from collections.abc import Callable

from diffbotctl.config.case import Case
from diffbotctl.config.checks import loops, names, robot_fields, wires

CHECKS: tuple[Callable[[Case], None], ...] = (
    names.check,
    wires.check,
    loops.check,
    robot_fields.check,
)
