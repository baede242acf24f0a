"""Track, wheel ratio and slip from squares that are drawn with known ones."""

from math import asin, nan, pi, sqrt
from statistics import fmean

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as some

from diffbotctl.calibrate import umbmark
from diffbotctl.calibrate.dead_reckoning import EndError, Geometry, dead_reckon
from diffbotctl.calibrate.end_noise import POSITION
from diffbotctl.calibrate.umbmark import Angles, DrivenSquare, SquareErrors, fit_squares

USED = Geometry(0.065, 0.065, 0.130)
NO_ERROR = EndError(0.0, 0.0)


def reckoned(true, clockwise, used=USED):
    """The end of a square of 1 m that odometry with `used` closes, and its end error."""
    segment = DrivenSquare("", 1.0, used, clockwise, NO_ERROR).segment
    end = dead_reckon(segment, true)
    return end, EndError(*(end.end - segment.motion))


def exact(true, used=USED, runs=5):
    """Squares without noise."""
    return SquareErrors(1.0, *([reckoned(true, way, used)[1]] * runs for way in (True, False)))


def drawn(true, slip, seed, runs=5):
    """Squares whose ends scatter by slip (m after 1 m) and by how they are read."""
    rng = np.random.default_rng(seed)
    directions = []
    for clockwise in (True, False):
        end, error = reckoned(true, clockwise)
        covariance = slip**2 * end.slip[:2, :2] + POSITION.typical**2 * np.eye(2)
        places = rng.multivariate_normal(error[:2], covariance, runs)
        directions.append([EndError(x, y, nan) for x, y in places])
    return SquareErrors(1.0, *directions)


ERROR = some.floats(-1.0, 1.0)


@settings(max_examples=30, deadline=None)
@given(ERROR, ERROR)
def test_squares_without_noise_tell_track_and_ratio(track, ratio):
    true = USED.reshaped(1 + 0.005 * ratio, USED.track * (1 + 0.03 * track))
    fit = fit_squares([(USED, exact(true))])
    assert fit.geometry.track == pytest.approx(true.track, rel=2e-5)
    assert fit.geometry.ratio == pytest.approx(true.ratio, abs=1e-5)
    assert fit.geometry.mean == pytest.approx(USED.mean, rel=1e-6)
    assert fit.after <= 1e-3 * fit.before + 1e-6
    angles = umbmark.angles_between(USED, true, 1.0)
    assert umbmark.correct_geometry(USED, 1.0, angles) == pytest.approx(true)


def test_all_rounds_count_alike():
    # Each round with what odometry used in it: the second one closes, and proves the same geometry.
    true = USED.reshaped(1.005, USED.track * 1.02)
    rounds = [(USED, exact(true)), (true, exact(true, true))]
    fit = fit_squares(rounds)
    assert fit.geometry.track == pytest.approx(true.track, rel=1e-5)
    assert fit.before < 1e-6 and fit.after < 1e-4
    assert fit.track_sd < fit_squares(rounds[:1]).track_sd


def test_headings_alone_serve():
    true = USED.reshaped(1.002, USED.track * 1.01)
    blind = (
        [end._replace(x=nan, y=nan) for end in ends]
        for ends in (exact(true).clockwise, exact(true).counter)
    )
    fit = fit_squares([(USED, SquareErrors(1.0, *blind))])
    assert fit.geometry.track == pytest.approx(true.track, rel=1e-3)
    assert fit.slip_sd is None and not fit.is_contradicting


def test_exchanged_directions_contradict_each_other():
    right = exact(USED.reshaped(1.004, USED.track * 1.02))
    assert not fit_squares([(USED, right)]).is_contradicting
    with pytest.raises(ValueError, match="no track and no wheels explain"):
        fit_squares([(USED, right._replace(clockwise=right.counter, counter=right.clockwise))])
    aside = [end._replace(x=end.x + 0.06, y=end.y - 0.06) for end in right.clockwise]
    assert fit_squares([(USED, right._replace(clockwise=aside))]).is_contradicting


@pytest.mark.parametrize("slip", [0.0005, 0.0015, 0.003, 0.02, 0.03])
def test_slip_track_and_ratio_are_found_within_their_standard_deviations(slip):
    true = USED.reshaped(1.003, USED.track * 1.02)
    fits = [fit_squares([(USED, drawn(true, slip, seed))]) for seed in range(40)]
    assert fmean(fit.slip for fit in fits) == pytest.approx(slip, rel=0.15)
    deviations = [
        (
            (fit.slip - slip) / fit.slip_sd,
            (fit.geometry.track / true.track - 1) / fit.track_sd,
            (fit.geometry.ratio / true.ratio - 1) / fit.ratio_sd,
        )
        for fit in fits
    ]
    within = (np.abs(deviations) < 2.0).sum(axis=0)
    assert within.min() >= 34
    assert sum(len(fit.left_out) for fit in fits) <= 10  # of 400 squares


def test_a_floor_without_slip_is_distinguished_from_one_that_slips():
    assert fit_squares([(USED, drawn(USED, 0.0, 1))]).slip < 0.0005


def test_one_square_in_each_direction_shows_no_slip():
    assert fit_squares([(USED, drawn(USED, 0.001, 1, runs=1))]).slip_sd is None


@pytest.mark.parametrize("count", [1, 2])
def test_ends_of_edges_in_a_wrong_slot_are_left_out_and_named(count):
    squares = drawn(USED, 0.0005, 3)
    # One slot of 20 turns the robot by so many rad; the end is a side ahead and one to the left.
    step = pi * USED.right / 20 / USED.track
    wrong = [end._replace(x=end.x - step, y=end.y + step) for end in squares.counter[:count]]
    squares = squares._replace(counter=[*wrong, *squares.counter[count:]])
    fit = fit_squares([(USED, squares)])
    names = [line.partition(" left out")[0] for line in fit.left_out]
    assert names == [f"square {number + 1} counter-clockwise" for number in range(count)]
    assert abs(fit.slip - 0.0005) < 2.0 * fit.slip_sd
    assert fit.geometry.track == pytest.approx(USED.track, rel=0.005)


def test_the_heading_of_a_square_is_spread_by_all_of_its_way():
    # Each wheel rolls four sides and four quarter turns about the middle: 4 + 2 pi 0.065 m.
    way = 4.0 + 2.0 * pi * 0.5 * USED.track
    end, _ = reckoned(USED, clockwise=False)
    assert sqrt(end.slip[2, 2]) == pytest.approx(sqrt(2.0 * way) / USED.track, rel=1e-6)


def test_an_exact_square_by_hand():
    # Turns of half the size: the way is a side, a turn by 45 degrees, and so on four times. The
    # sum of unit vectors at 0, 45, 90, 135 degrees is (1, 1 + sqrt 2); half a turn is missing.
    _, error = reckoned(USED._replace(track=2 * USED.track), clockwise=False)
    assert error == pytest.approx((1.0, 1 + 2**0.5, -pi))


def test_correction_by_hand():
    # alpha = pi/2 / 51: the robot turned 50/51 of each quarter, so its track is 51/50 of the one
    # in use. beta = 2 asin(0.01): half a side of 1 m is r sin(beta/2) = 0.01 r, so r = 50 m and
    # the wheels run at 50.065 and 49.935 m.
    result = umbmark.correct_geometry(USED, 1.0, Angles(pi / 2 / 51, 2 * asin(0.01)))
    assert result.track == pytest.approx(0.130 * 1.02)
    assert result.ratio == pytest.approx(50.065 / 49.935)
    assert result.mean == pytest.approx(0.065)


def test_implausible_ends_are_refused():
    with pytest.raises(ValueError, match="too far off"):
        umbmark.correct_geometry(USED, 1.0, Angles(pi / 2, 0.0))
    with pytest.raises(ValueError, match="at least one run"):
        fit_squares([(USED, SquareErrors(1.0, [], []))])


def test_systematic_error_is_of_the_centres():
    # Clockwise ends (3, 0) and (3, 8): centre (3, 4), 5 from the origin. Counter-clockwise the
    # single ends are further out, but their centre is the origin.
    clockwise = [EndError(3, 0), EndError(3, 8)]
    counter = [EndError(20, 0), EndError(-20, 0)]
    assert umbmark.systematic_error(clockwise, counter) == 5


@pytest.mark.parametrize("track, side", [(0.125, 1.0), (0.1, 0.8), (0.5, 1.0)])
def test_the_side_suits_the_track(track, side):
    assert umbmark.advised_side(track) == pytest.approx(side)  # no more than eight tracks
