"""The lengths that earlier steps of the calibration found, with their standard deviations."""

from __future__ import annotations

from diffbotctl.config.robot import Robot
from diffbotctl.units import quantity

# Relative standard deviation of one wheel from the mean of both, as tyres of a kit come.
DIFFERENCE_SD = 0.003
MEASURED_DIFFERENCE_SD = 0.0005  # after a step that found the ratio of the wheels
MEAN_ONLY_METHODS = ("distance",)


def known_sd(robot: Robot, field: str) -> float:
    """Standard deviation (m) of a length from an earlier step; 0 if there is none."""
    entry = robot.calibration.get(field)
    return 0.0 if entry is None or entry.sd is None else quantity(str(entry.sd), "m")


def known_difference_sd(robot: Robot, field: str) -> float:
    """Relative standard deviation of the diameter in `field` from the mean of both wheels."""
    entry = robot.calibration.get(field)
    is_measured = entry is not None and entry.method not in MEAN_ONLY_METHODS
    return MEASURED_DIFFERENCE_SD if is_measured else DIFFERENCE_SD


def known_mean_sd(robot: Robot, field: str, diameter: float) -> float:
    """Standard deviation (m) of the mean diameter, from the entry `field` of one wheel."""
    sd = known_sd(robot, field)
    entry = robot.calibration.get(field)
    if entry is None or entry.method not in (*MEAN_ONLY_METHODS, "trial"):
        return sd
    return float(max(sd**2 - (DIFFERENCE_SD * diameter) ** 2, 0.0) ** 0.5)
