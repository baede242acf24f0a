"""How well a pose is known, and whether that proves a goal."""

from __future__ import annotations

from math import degrees, sqrt
from typing import NamedTuple

from diffbotctl.messages import Odometry

# A pose that is known less well does not prove the goal. Multiple of a tolerance,
UNSURE_RATIO = 3.0
# or of the position, of what the tolerance of the heading is to the side at the end of the way,
UNSURE_ASIDE_RATIO = 1.5
UNSURE_ASIDE_MAX = 0.1  # m, of that
# m; stops within it are one: more than the noise of a reading, less than a robot.
PLACE_RADIUS = 0.05

STRAIGHT_ANGLE = 180.0  # deg


class PoseSd(NamedTuple):
    """How well a pose is known: standard deviations."""

    position: float  # m, in its worst direction
    heading: float  # rad

    @classmethod
    def of(cls, odometry: Odometry, counts_geometry: bool) -> PoseSd:
        """Without `counts_geometry` the error of the geometry is left out: that of a robot that is
        not calibrated would exceed any tolerance."""
        xx, xy, _, yy, _, hh = odometry.covariance
        position = largest_variance(xx, xy, yy)
        if not counts_geometry:
            position -= odometry.geometry_sd * odometry.geometry_sd
            hh -= odometry.geometry_heading_sd * odometry.geometry_heading_sd
        return cls(sqrt(max(position, 0.0)), sqrt(max(hh, 0.0)))

    def doubt(
        self, tolerance: float, heading_tolerance: float, aside: float, has_warning: bool
    ) -> str:
        """What of the pose is known too badly to prove that it is within both tolerances (m, rad);
        empty if nothing is.

        A pose with a warning must be known within the tolerances. Dead reckoning is never as good
        as that over a long way: any other pose must be known within UNSURE_RATIO times them, or the
        position about as well as the tolerance of the heading asks: `aside` (m) is what a robot
        misses the goal by whose heading is off by it on the whole way.
        """
        if not has_warning:
            aside = min(UNSURE_ASIDE_RATIO * aside, UNSURE_ASIDE_MAX)
            tolerance = max(UNSURE_RATIO * tolerance, aside)
            heading_tolerance *= UNSURE_RATIO
        known = []
        if self.position > tolerance:
            known.append(f"the position is known to {length_text(self.position)}")
        if self.heading > heading_tolerance:
            turn = min(degrees(self.heading), STRAIGHT_ANGLE)  # a larger one means as little
            known.append(f"the heading is known to {turn:.1f} deg")
        return f"{' and '.join(known)} (standard deviation)" if known else ""


def length_text(length: float) -> str:
    """A length (m) in millimetres, or from a metre on in metres."""
    return f"{length * 1000:.0f} mm" if length < 1.0 else f"{length:.1f} m"


def largest_variance(xx: float, xy: float, yy: float) -> float:
    """Variance (m2) of a position in its worst direction: the larger eigenvalue."""
    half_difference = 0.5 * (xx - yy)
    return 0.5 * (xx + yy) + sqrt(half_difference * half_difference + xy * xy)
