"""The slip of the wheels, from the scatter of squares that are drawn with a known one."""

from math import nan, pi, sqrt
from statistics import fmean

import numpy as np
import pytest

from diffbotctl.calibrate.dead_reckoning import EndError, Geometry
from diffbotctl.calibrate.slip_fit import POSITION_SD, fit_slip, square_covariance
from diffbotctl.calibrate.umbmark import SquareErrors

GEOMETRY = Geometry(0.065, 0.065, 0.13)
SIDE = 1.0


def squares(slip, seed, runs=5, mean=0.0):
    """Squares of which each direction has another `mean` (m) end."""
    rng = np.random.default_rng(seed)
    directions = []
    for clockwise, centre in ((True, mean), (False, -mean)):
        unit = square_covariance(SIDE, GEOMETRY, clockwise)[:2, :2]
        covariance = slip**2 * unit + POSITION_SD**2 * np.eye(2)
        drawn = rng.multivariate_normal([centre, centre], covariance, runs)
        directions.append([EndError(x, y, nan) for x, y in drawn])
    return SquareErrors(SIDE, *directions)


def test_the_heading_of_a_square_is_spread_by_all_of_its_way():
    # Each wheel rolls four sides and four quarter turns about the middle: 4 + 2 pi 0.065 m.
    way = 4.0 * SIDE + 2.0 * pi * 0.5 * GEOMETRY.track
    covariance = square_covariance(SIDE, GEOMETRY, clockwise=False)
    assert sqrt(covariance[2, 2]) == pytest.approx(sqrt(2.0 * way) / GEOMETRY.track, rel=1e-6)


@pytest.mark.parametrize("slip", [0.0005, 0.0015, 0.003, 0.02, 0.03])
def test_the_slip_is_found_whatever_the_geometry_misses(slip):
    fits = [fit_slip(squares(slip, seed, mean=0.05), GEOMETRY) for seed in range(40)]
    assert fmean(fit.value for fit in fits) == pytest.approx(slip, rel=0.15)
    within = [abs(fit.value - slip) < 2.0 * fit.sd for fit in fits]
    assert sum(within) >= 34


def test_a_floor_without_slip_is_distinguished_from_one_that_slips():
    assert fit_slip(squares(0.0, 1), GEOMETRY).value < 0.0005


def test_one_square_in_each_direction_shows_no_slip():
    assert fit_slip(squares(0.001, 1, runs=1), GEOMETRY) is None
