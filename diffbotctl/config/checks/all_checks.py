"""Every check, in the order in which they are made."""

from __future__ import annotations

from collections.abc import Callable

from diffbotctl.config.check_context import CheckContext
from diffbotctl.config.checks import (
    calibration,
    drive,
    fields,
    geometry,
    graph,
    pins,
    serial_link,
    voltages,
)

CHECKS: tuple[Callable[[CheckContext], None], ...] = (
    graph.check_names,
    graph.check_wires,
    graph.check_loops,
    fields.check_fields,
    pins.check_pins,
    serial_link.check_channels,
    serial_link.check_budget,
    drive.check_deadman,
    drive.check_speed,
    geometry.check_outline,
    drive.check_reach,
    geometry.check_tolerance,
    drive.check_edges,
    drive.check_polarity,
    voltages.check_wiring,
    calibration.check_calibration,
)
