"""Checks of the typed values: wiring, pins, budgets and distances."""

from __future__ import annotations

from collections.abc import Callable

from diffbotctl.config.checks import block_needs, board, calibration, drive, graph, pins
from diffbotctl.config.checks.context import CheckContext

CHECKS: tuple[Callable[[CheckContext], None], ...] = (
    graph.check_names,
    graph.check_wires,
    graph.check_loops,
    block_needs.check_fields,
    pins.check_pins,
    board.check_channels,
    board.check_budget,
    drive.check_deadman,
    drive.check_speed,
    drive.check_outline,
    drive.check_reach,
    drive.check_tolerance,
    drive.check_edges,
    drive.check_polarity,
    board.check_radio,
    board.check_led_pin,
    board.check_supply,
    calibration.check_calibration,
)
