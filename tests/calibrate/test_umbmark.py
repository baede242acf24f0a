from math import pi

import pytest
from hypothesis import given
from hypothesis import strategies as some

from diffbotctl.calibrate.dead_reckoning import Geometry
from diffbotctl.calibrate.umbmark import (
    Angles,
    EndError,
    angles_from_headings,
    angles_from_positions,
    correct_geometry,
    mean_end,
    square_end,
    systematic_error,
)

ROBOT = Geometry(0.065, 0.065, 0.140)


@pytest.mark.parametrize(
    ("clockwise", "counter", "alpha", "beta"),
    [
        # L = 1. Each quarter turn misses 0.01 rad, sides are straight: both directions end at
        # x = -2 L alpha, and y mirrors.
        (EndError(-0.02, -0.02), EndError(-0.02, 0.02), 0.01, 0.0),
        # Turns are right, each side gains 0.01 rad to the left.
        (EndError(-0.02, -0.02), EndError(0.02, -0.02), 0.0, 0.01),
        # Both at once: clockwise they add up, counter-clockwise x cancels and so does y.
        (EndError(-0.04, -0.04), EndError(0.0, 0.0), 0.01, 0.01),
        # The two rules differ: by x alpha is 0.08 / 4, by y it is 0.04 / 4.
        (EndError(-0.04, -0.02), EndError(-0.04, 0.02), 0.015, 0.0),
        (EndError(0.0, 0.0), EndError(0.0, 0.0), 0.0, 0.0),
    ],
)
def test_angles_by_positions(clockwise, counter, alpha, beta):
    result = angles_from_positions(1.0, clockwise, counter)
    assert result.alpha == pytest.approx(alpha, abs=1e-12)
    assert result.beta == pytest.approx(beta, abs=1e-12)


def test_angles_by_headings():
    # Four sides gain beta each, whichever way round; four turns miss alpha each, in their own
    # direction: clockwise 4 (beta + alpha), counter-clockwise 4 (beta - alpha).
    result = angles_from_headings(
        1.0, EndError(0, 0, 4 * (0.003 + 0.01)), EndError(0, 0, 4 * (0.003 - 0.01))
    )
    assert result == pytest.approx((0.01, 0.003))


def test_correction_by_hand():
    # alpha = pi/2 / 51: the robot turned 50/51 of each quarter, so its track is 51/50 of the one
    # in use. beta = 2 asin(0.01): half a side of 1 m is r sin(beta/2) = 0.01 r, so r = 50 m and
    # the wheels run at 50.07 and 49.93 m.
    from math import asin

    result = correct_geometry(ROBOT, 1.0, Angles(pi / 2 / 51, 2 * asin(0.01)))
    assert result.track == pytest.approx(0.140 * 1.02)
    assert result.ratio == pytest.approx(50.07 / 49.93)
    assert result.mean == pytest.approx(0.065)


def test_implausible_ends_are_refused():
    with pytest.raises(ValueError, match="too far off"):
        correct_geometry(ROBOT, 1.0, Angles(pi / 2, 0.0))
    with pytest.raises(ValueError, match="at least one run"):
        mean_end([])


def test_systematic_error_is_of_the_centres():
    # Clockwise ends (3, 0) and (3, 8): centre (3, 4), 5 from the origin. Counter-clockwise the
    # single ends are further out, but their centre is the origin.
    clockwise = [EndError(3, 0), EndError(3, 8)]
    counter = [EndError(20, 0), EndError(-20, 0)]
    assert systematic_error(clockwise, counter) == 5


def test_an_exact_square_by_hand():
    # Turns of half the size: the way is a side, a turn by 45 degrees, and so on four times. The
    # sum of unit vectors at 0, 45, 90, 135 degrees is (1, 1 + sqrt 2); half a turn is missing.
    end = square_end(1.0, ROBOT, ROBOT._replace(track=0.280), clockwise=False)
    assert (end.x, end.y) == pytest.approx((1.0, 1 + 2**0.5))
    assert end.heading == pytest.approx(-pi)
    mirrored = square_end(1.0, ROBOT, ROBOT._replace(track=0.280), clockwise=True)
    assert mirrored == pytest.approx((end.x, -end.y, -end.heading))


geometries = some.builds(
    lambda ratio, track: ROBOT.reshaped(ratio, ROBOT.track * track),
    some.floats(0.995, 1.005),
    some.floats(0.97, 1.03),
)


@given(geometries)
def test_rounds_multiply_and_converge(true):
    used, errors = ROBOT, []
    for _ in range(4):
        ends = [square_end(1.0, used, true, clockwise) for clockwise in (True, False)]
        errors.append(systematic_error(ends[:1], ends[1:]))
        used = correct_geometry(used, 1.0, angles_from_positions(1.0, *ends))
    assert errors[1] <= errors[0] / 10 + 1e-6
    assert errors[2] <= errors[1] / 10 + 1e-6
    assert used.track == pytest.approx(true.track, rel=1e-6)
    assert used.ratio == pytest.approx(true.ratio, rel=1e-6)
