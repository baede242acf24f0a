"""The lengths that earlier steps of the calibration found, with their standard deviations."""

from __future__ import annotations

from math import pi

from diffbotctl.calibrate.result import LEFT_DIAMETER, RIGHT_DIAMETER
from diffbotctl.config.robot import Robot
from diffbotctl.units import quantity

# Relative standard deviation of one wheel from the mean of both, as tyres of a kit come.
DIFFERENCE_SD = 0.003
MEASURED_DIFFERENCE_SD = 0.0005  # after a step that found the ratio of the wheels
# Systematic error of odometry from rest to rest, in pitches of the encoder: the way before the
# first edge and after the last one is predicted by the motor model. Of simulated drives of a metre:
# 0.01 and 0.19 in the mean. The larger one where the kind of the motors is not known.
REST_SD_PITCHES = {"slow": 0.03, "fast": 0.2}
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


def rest_sd(robot: Robot) -> float:
    """Standard deviation (m) of the way of odometry from rest to rest that all drives share."""
    sds = []
    for side in (robot.drive.left, robot.drive.right):
        pitch = pi * side.wheel.diameter / side.encoder.counts
        sds.append(pitch * REST_SD_PITCHES[side.motor.decay or "fast"])
    return max(sds)


def known_scale_sd(robot: Robot) -> float:
    """Relative standard deviation of the mean diameter, and so of all lengths that are measured in
    multiples of it; 0 where it was not measured."""
    drive = robot.drive
    diameters = {
        RIGHT_DIAMETER: drive.right.wheel.diameter,
        LEFT_DIAMETER: drive.left.wheel.diameter,
    }
    sds = (known_mean_sd(robot, field, value) for field, value in diameters.items())
    return 2 * max(sds) / sum(diameters.values())


def known_mean_sd(robot: Robot, field: str, diameter: float) -> float:
    """Standard deviation (m) of the mean diameter, from the entry `field` of one wheel."""
    sd = known_sd(robot, field)
    entry = robot.calibration.get(field)
    if entry is None or entry.method not in (*MEAN_ONLY_METHODS, "trial"):
        return sd
    return float(max(sd**2 - (DIFFERENCE_SD * diameter) ** 2, 0.0) ** 0.5)
