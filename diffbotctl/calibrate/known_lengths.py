"""The lengths that earlier steps of the calibration found, with their standard deviations."""

from __future__ import annotations

from math import hypot, pi

from diffbotctl.calibrate.result import LEFT_DIAMETER, RIGHT_DIAMETER, TRACK
from diffbotctl.config.robot import Calibrated, Robot
from diffbotctl.units import quantity

# Relative standard deviation of one wheel from the mean of both, as tyres of a kit come.
DIFFERENCE_SD = 0.003
# Relative standard deviation of a mean diameter that was not measured by driving; `calibrate
# from-log` takes the same: a ruler reads a wheel of 65 mm to 1 mm, and a tyre is smaller under its
# load.
UNMEASURED_SCALE_SD = 0.02
# Systematic error of odometry from rest to rest, in pitches of the encoder: the way before the
# first edge and after the last one is predicted by the motor model. Of simulated drives of a metre,
# 0.2 with fast decay or where the driver takes a voltage of its own, 0.01 where neither is so.
REST_SD_PITCHES = 0.2


def known_track_sd(robot: Robot) -> float:
    """Standard deviation (m) of the track from an earlier step, without that of the mean diameter
    where it is stated; 0 if there is none."""
    entry = robot.calibration.get(TRACK)
    if entry is None or entry.sd is None:
        return 0.0
    return _length(entry.sd if entry.own_sd is None else entry.own_sd)


def known_difference_sd(robot: Robot, field: str) -> float:
    """Relative standard deviation of the diameter in `field` from the mean of both wheels."""
    entry = robot.calibration.get(field)
    if entry is None or entry.own_sd is None:
        return DIFFERENCE_SD
    return _length(entry.own_sd) / _length(entry.value)


def rest_sd(robot: Robot) -> float:
    """Standard deviation (m) of the way of odometry from rest to rest that all drives share."""
    sides = (robot.drive.left, robot.drive.right)
    return REST_SD_PITCHES * max(pi * side.wheel.diameter / side.encoder.counts for side in sides)


def known_scale_sd(robot: Robot) -> float:
    """Relative standard deviation of the mean diameter, and so of all lengths that are measured in
    multiples of it; UNMEASURED_SCALE_SD if not measured."""
    entries = [robot.calibration.get(field) for field in (RIGHT_DIAMETER, LEFT_DIAMETER)]
    return max(_scale_sd(entry) or UNMEASURED_SCALE_SD for entry in entries)


def is_scale_measured(robot: Robot) -> bool:
    """Whether a step measured the mean diameter."""
    return known_scale_sd(robot) < 0.9 * UNMEASURED_SCALE_SD  # as written, it is rounded


def _scale_sd(entry: Calibrated | None) -> float:
    """Relative standard deviation of the mean diameter by the entry of one wheel; 0: none."""
    if entry is None or entry.sd is None:
        return 0.0
    own_sd = 0.0 if entry.own_sd is None else _length(entry.own_sd)
    return float(max(_length(entry.sd) ** 2 - own_sd**2, 0.0) ** 0.5) / _length(entry.value)


def with_scale(length: float, own: float, scale: float) -> tuple[float, float]:
    """The standard deviation of `length` (m), and the part of it that is its own (m); from the
    relative ones."""
    return length * hypot(own, scale), length * own


def _length(text: object) -> float:
    return quantity(str(text), "m")
