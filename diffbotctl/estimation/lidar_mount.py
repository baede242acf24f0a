"""Where a lidar really sits and points, from the robot's motion by the map and by the wheels.

Points of the plane are complex numbers. A lidar that points by a further to the left than stated,
and is moved by e, shows the robot's pose g composed with (e, a). While the robot moves by t (in its
frame) and turns by r, the map then shows the way m = exp(-i a) (t + (exp(i r) - 1) e); this is
linear in z = exp(i a) and e:

    z m + (1 - exp(i r)) e = t

Least squares over many such ways gives both; |z| is what the wheels' scale is wrong by. Straight
ways show z, turns e. (Hand-eye calibration: Shiu and Ahmad 1989, in the plane.)
"""

from __future__ import annotations

from cmath import exp, phase
from math import remainder, sqrt, tau
from typing import NamedTuple

from diffbotctl.geometry.deskew import PlanePose

LEG, LEG_TURN = 0.3, 0.5  # m, rad; the longer a way, the less its ends matter
LEGS_MIN = 12
SCATTER_MIN = 0.005  # m, of a way: walls are drawn, and wheels slip, no better


class LidarMount(NamedTuple):
    """By how much a lidar deviates from where the robot file states it, and standard deviations."""

    place: complex
    """m, x + i y in base_link"""
    place_sd: float
    heading: float
    """rad"""
    heading_sd: float


class LidarMountFit:
    """Takes poses of the robot by its wheels and by the map."""

    def __init__(self) -> None:
        self.legs = 0
        self.mm = self.rr = self.tt = 0.0
        self.mr = self.mt = self.rt = 0j  # sums of conjugated products
        self.begin: tuple[PlanePose, PlanePose] | None = None  # of a way; None: the next pose

    def add(self, wheels: PlanePose, seen: PlanePose) -> None:
        """Poses at one time: in odom, and in the map."""
        if self.begin is None:
            self.begin = wheels, seen
            return
        t, wheel_turn = _way(self.begin[0], wheels)
        m, turn = _way(self.begin[1], seen)
        if abs(t) < LEG and abs(turn) < LEG_TURN:
            return
        self.begin = wheels, seen
        # The map knows better than the wheels how far the robot has turned on the way.
        t *= exp(0.5j * remainder(turn - wheel_turn, tau))
        r = 1 - exp(1j * turn)
        self.legs += 1
        self.mm += abs(m) ** 2
        self.rr += abs(r) ** 2
        self.tt += abs(t) ** 2
        self.mr += m.conjugate() * r
        self.mt += m.conjugate() * t
        self.rt += r.conjugate() * t

    def mount(self) -> LidarMount | None:
        """The fit; None while there are too few ways, or turns alone."""
        determinant = self.mm * self.rr - abs(self.mr) ** 2
        if self.legs < LEGS_MIN or determinant < 1e-6 * self.mm * self.rr or not self.rr:
            return None
        z = (self.rr * self.mt - self.mr * self.rt) / determinant
        e = (self.mm * self.rt - self.mr.conjugate() * self.mt) / determinant
        left = self.tt - (z.conjugate() * self.mt + e.conjugate() * self.rt).real
        variance = max(left / (2 * self.legs - 4), SCATTER_MIN**2)
        return LidarMount(
            e,
            sqrt(variance * self.mm / determinant),
            phase(z),
            sqrt(variance * self.rr / determinant) / abs(z) if z else tau,
        )


def _way(first: PlanePose, second: PlanePose) -> tuple[complex, float]:
    """The motion from `first` to `second`, in the frame of `first`."""
    moved = complex(second[0] - first[0], second[1] - first[1]) * exp(-1j * first[2])
    return moved, remainder(second[2] - first[2], tau)
