"""The pose from scan to scan: odometry predicts it, the match of the scan corrects it."""

from __future__ import annotations

import numpy as np

from diffbotctl.mapping.lidar_scan import MappedScan, SurfacePoints
from diffbotctl.mapping.match_field import MatchField
from diffbotctl.mapping.plane_pose import (
    Array,
    apart,
    between,
    compose,
    moved_covariance,
    rotated_covariance,
)
from diffbotctl.mapping.scan_match import match

FLOOR = np.diag([0.01, 0.01, 0.004]) ** 2  # of a match, however many points agree
SLIP_ALONG = (0.005, 0.10, 0.02)  # m; m a metre; m a rad: what wheels add on any floor
SLIP_HEADING = (0.005, 0.10, 0.02)  # rad; rad a rad; rad a metre
OVERLAP_MIN = 0.25  # share of the points at lines of the map; with fewer, a match is not used
# With fewer, wheels may have slipped more than stated on a long way (m, or rad) from scan to scan:
# the match is repeated with a variance of the prediction that is larger by the factor, and used if
# it explains more by the gain. After a short way, the robot was put elsewhere.
POOR_OVERLAP, LONG_WAY, WIDENING, GAIN_MIN = 0.6, (0.5, 0.5), 16.0, 0.15


class ScanTracker:
    """A pose and its covariance, relative to the map that scans are matched with."""

    def __init__(self, pose: Array, covariance: Array) -> None:
        self.pose = np.array(pose, float)
        self.covariance = np.array(covariance, float)
        """of small motions in the frame of `pose`"""
        self._has_gone_far = False  # from scan to scan, at the last prediction

    def predict(self, last: MappedScan, scan: MappedScan) -> None:
        """Move by the odometry from `last` to `scan`."""
        motion = between(last.odometry, scan.odometry)
        self._has_gone_far = apart(last.odometry, scan.odometry, LONG_WAY)
        self.pose = compose(self.pose, motion)
        self.covariance = moved_covariance(self.covariance, motion) + _spread(last, scan, motion)

    def correct(self, field: MatchField, surface: SurfacePoints) -> float:
        """Match the scan. Returns the share of its points that lie at lines of the map."""
        heading = float(self.pose[2])
        covariance = rotated_covariance(self.covariance, heading)
        fit = match(field, surface, self.pose, covariance)
        if fit.overlap < POOR_OVERLAP and self._has_gone_far:
            wide = match(field, surface, self.pose, WIDENING * covariance)
            if wide.overlap > fit.overlap + GAIN_MIN:
                fit, covariance = wide, WIDENING * covariance
        if fit.overlap < OVERLAP_MIN:
            return fit.overlap
        self.pose = fit.pose
        fused = np.linalg.inv(fit.information + np.linalg.inv(covariance))
        self.covariance = rotated_covariance(fused, -float(fit.pose[2])) + FLOOR
        return fit.overlap


def _spread(last: MappedScan, scan: MappedScan, motion: Array) -> Array:
    """Covariance of `motion`, in the frame at `scan`.

    What the odometry's covariance grew by, and at least the slip of wheels.
    """
    dx, dy = scan.odometry[:2] - last.odometry[:2]
    carried = np.array([[1.0, 0.0, -dy], [0.0, 1.0, dx], [0.0, 0.0, 1.0]])
    grown = scan.covariance - carried @ last.covariance @ carried.T
    grown = rotated_covariance(0.5 * (grown + grown.T), -float(scan.odometry[2]))
    values, vectors = np.linalg.eigh(grown)
    grown = np.asarray((vectors * np.maximum(values, 0.0)) @ vectors.T)
    distance, turn = float(np.hypot(motion[0], motion[1])), abs(float(motion[2]))
    along = SLIP_ALONG[0] + SLIP_ALONG[1] * distance + SLIP_ALONG[2] * turn
    heading = SLIP_HEADING[0] + SLIP_HEADING[1] * turn + SLIP_HEADING[2] * distance
    return grown + np.diag([along**2, along**2, heading**2])
