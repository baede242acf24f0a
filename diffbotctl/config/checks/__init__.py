"""Checks of the typed values: wiring, pins, budgets and distances."""

from __future__ import annotations

from collections.abc import Callable

from diffbotctl.config.checks import (
    block_needs,
    board,
    calibration,
    drive,
    encoders,
    graph,
    imu,
    pins,
    proportions,
    sensors,
    world,
)
from diffbotctl.config.checks.context import CheckContext

CHECKS: tuple[Callable[[CheckContext], None], ...] = (
    graph.check_names,
    graph.check_message_types,
    graph.check_wires,
    graph.check_loops,
    block_needs.check_fields,
    pins.check_pins,
    encoders.check_channels,
    encoders.check_slot_errors,
    sensors.check_sensors,
    imu.check_imu,
    board.check_budget,
    drive.check_deadman,
    drive.check_speed,
    drive.check_breakaway,
    drive.check_turn_rate,
    proportions.check_proportions,
    drive.check_outline,
    drive.check_wheelbase,
    drive.check_reach,
    drive.check_tolerance,
    drive.check_missing_encoders,
    drive.check_edges,
    drive.check_glitch,
    drive.check_polarity,
    board.check_radio,
    board.check_led_pin,
    board.check_driver,
    board.check_supply,
    board.check_voltages,
    board.check_battery,
    board.check_stall_current,
    calibration.check_calibration,
    world.check_ranges,
    world.check_slip,
    world.check_unused_keys,
    world.check_walls,
    world.check_scanned_world,
    world.check_start,
    world.check_goals,
    world.check_body,
)
