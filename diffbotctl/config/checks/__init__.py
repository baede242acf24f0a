"""Checks of the typed values: wiring, pins, budgets and distances.

Each module declares its checks by `@check`. What follows from an earlier one is reported after it.
"""

from diffbotctl.config.checks import (
    block_needs,
    board,
    calibration,
    drive,
    encoders,
    faults,
    graph,
    imu,
    pins,
    proportions,
    sensors,
    world,
)
from diffbotctl.config.checks.context import declared_checks

MODULES = (
    *(graph, block_needs, pins, encoders, sensors, imu, proportions, drive, board, calibration),
    *(faults, world),
)
CHECKS = tuple(check for module in MODULES for check in declared_checks(module.__name__))
