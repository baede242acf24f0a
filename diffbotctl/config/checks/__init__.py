"""Checks of the typed values: wiring, pins, budgets and distances.

Each module declares its checks by `@check`.
"""

from diffbotctl.config.checks import (  # noqa: F401
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
from diffbotctl.config.checks.context import CHECKS as CHECKS
