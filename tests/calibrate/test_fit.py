from dataclasses import replace
from math import pi

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as some

from diffbotctl.calibrate.dead_reckoning import Geometry, cut_segments, dead_reckon, whole_drive
from diffbotctl.calibrate.geometry_fit import fit_geometry, geometry_findings
from tests.calibrate.driven import STATED, drive, squares, wander
from tests.sampling import by_day

TRUE = STATED.reshaped(1.004, 0.140 * 1.02)
TRACK_WITHIN, RATIO_WITHIN = 0.0015, 0.0005


def assert_near(fit, true, share=1.0):
    assert fit.track == pytest.approx(true.track, rel=TRACK_WITHIN * share)
    assert fit.ratio == pytest.approx(true.ratio, rel=RATIO_WITHIN * share)


@settings(max_examples=3, deadline=None)
@given(some.floats(0.995, 1.005), some.floats(0.97, 1.03))
@example(1.0, 1.0)  # other tracks close the same squares: this is no mistake
def test_exact_squares_give_the_geometry(ratio, track):
    true = STATED.reshaped(ratio, STATED.track * track)
    fit = fit_geometry(squares(true, each_way=1), STATED)
    assert_near(fit.geometry, true, share=0.01)
    assert fit.geometry.mean == pytest.approx(STATED.mean, rel=1e-3)


@pytest.mark.parametrize("every", [1, 7, 50])
def test_exact_paths_give_every_length_at_any_rate_of_rows(every):
    # The mean diameter is off too: a path of a known length shows it, a square would not. A
    # step of steady curvature is a chord, exactly; the curvature changes every 100 rows, so steps
    # of 7 rows see it change within them, and are a little off.
    true = Geometry(0.0655, 0.0652, 0.1417)
    fit = fit_geometry([drive("one", wander(5), true, all_poses=True, every=every)], STATED)
    assert fit.sees_diameter
    share = 1.0 if every == 7 else 0.25
    assert_near(fit.geometry, true, share)
    assert fit.geometry.mean == pytest.approx(true.mean, rel=1e-3)


def test_the_end_of_one_drive_proves_little():
    # Three figures, three unknowns: they fit exactly, and the tape may still be 5 mm off in 3 m.
    true = Geometry(0.0655, 0.0652, 0.1417)
    fit = fit_geometry([drive("one", wander(5), true)], STATED)
    assert not fit.sees_diameter
    assert fit.confidence.track.half_width > 0.002


@pytest.mark.nightly
def test_slip_leaves_the_truth_within_the_stated_confidence():
    fit = fit_geometry(squares(TRUE, slip=0.0005), STATED)
    assert fit.outliers == []
    assert abs(fit.geometry.ratio / TRUE.ratio - 1) < fit.confidence.ratio.half_width
    shape = fit.confidence.track_over_mean
    fitted, true = fit.geometry, TRUE
    assert abs(fitted.track / fitted.mean / (true.track / true.mean) - 1) < shape.half_width
    assert fit.confidence.ratio.half_width < 0.001
    assert shape.half_width < 0.003
    # The drives do not show the size of the wheels: all lengths are as uncertain as the stated one.
    assert 0.02 < fit.confidence.track.half_width < 0.05


@pytest.mark.parametrize("sees_diameter", by_day(1, [False, True]))
def test_what_is_left_of_the_deviations_for_an_exact_mean_diameter(sees_diameter):
    lines = [drive(f"arc-{k}", wander(k), TRUE, slip=0.0005, seed=k) for k in (1, 2, 3)]
    drives = squares(TRUE, slip=0.0005, each_way=3) + (lines if sees_diameter else [])
    fit = fit_geometry(drives, STATED)
    assert fit.sees_diameter == sees_diameter
    errors = fit.confidence
    right, left, track = geometry_findings(fit)
    assert right.own_sd / right.value == pytest.approx(errors.ratio.sd / 2, rel=0.01)
    assert left.own_sd / left.value == pytest.approx(errors.ratio.sd / 2, rel=0.01)
    assert track.own_sd / track.value == pytest.approx(errors.track_over_mean.sd)
    for each in (right, left, track):
        assert each.own_sd <= each.sd
        assert each.sd / each.value >= errors.mean.sd * 0.9


@pytest.mark.nightly
def test_squares_leave_the_mean_diameter_as_stated():
    fit = fit_geometry(squares(TRUE, slip=0.001), STATED)
    assert not fit.sees_diameter
    assert fit.geometry.mean == pytest.approx(STATED.mean, rel=1e-4)


@pytest.mark.nightly
def test_odd_drives_are_named_and_change_little():
    drives = squares(TRUE, slip=0.0005)
    poses = drives[3].poses + np.array([[0, 0, 0], [0.3, -0.2, 0.1]])  # it was kicked
    drives[3] = replace(drives[3], poses=poses)
    drives[7] = replace(drives[7], turns=drives[7].turns * (1.05, 1.0))  # a wheel slipped
    fit = fit_geometry(drives, STATED)
    assert {stray.name for stray in fit.outliers} == {drives[3].name, drives[7].name}
    assert len(fit.drives) == len(fit.offsets) == 8
    assert_near(fit.geometry, TRUE, share=2)


@pytest.mark.nightly
@pytest.mark.parametrize("all_poses", by_day(1, [True, False]))
def test_swapped_columns_are_named_and_not_corrected_silently(all_poses):
    drives = squares(TRUE, slip=0.0003, each_way=2, all_poses=all_poses)
    # An arc at the end, or the mirror image of a square is a square.
    drives += [
        drive(f"arc-{k}", wander(k), TRUE, slip=0.0003, seed=k, all_poses=all_poses) for k in (1, 2)
    ]
    with pytest.raises(ValueError, match="left and the right wheel are exchanged"):
        swapped = [
            replace(each, turns=each.turns[:, ::-1], tick=each.tick[::-1]) for each in drives
        ]
        fit_geometry(swapped, STATED)
    assert_near(fit_geometry(drives, STATED).geometry, TRUE, share=4)


@pytest.mark.parametrize("times", by_day(1, [0.5, 2.0]))
def test_a_track_of_half_or_twice_the_stated_one_is_refused(times):
    used = STATED._replace(track=STATED.track / times)
    with pytest.raises(ValueError):
        fit_geometry(squares(TRUE, used, slip=0.0003, each_way=2), used)


def test_a_late_clock_is_found_and_costs_nothing():
    # Rows are 20 ms apart; the counts come five of them late, which is 100 ms.
    true = drive("late", wander(8), TRUE, all_poses=True)
    turns = np.concatenate([np.zeros((5, 2)), true.turns[:-5]])
    fit = fit_geometry([replace(true, turns=turns)], STATED)
    assert fit.offsets == [pytest.approx(-0.1, abs=0.006)]
    assert_near(fit.geometry, TRUE, share=4)


@pytest.mark.nightly
def test_twenty_slots_on_known_paths():
    # 10 mm a count: the fit still finds the geometry within what it claims.
    drives = [
        drive(f"run-{k}", wander(k, 2000), TRUE, ticks=20, seed=k, all_poses=True) for k in range(6)
    ]
    fit = fit_geometry(drives, STATED)
    assert abs(fit.geometry.track / TRUE.track - 1) < fit.confidence.track.half_width
    assert abs(fit.geometry.ratio / TRUE.ratio - 1) < fit.confidence.ratio.half_width


def test_slopes_are_those_of_the_end():
    piece = whole_drive(drive("one", wander(3), TRUE))
    here = dead_reckon(piece, STATED)
    for which in range(3):
        step = 1e-7
        moved = list(STATED)
        moved[which] += step
        change = (dead_reckon(piece, Geometry(*moved)).end - here.end) / step
        assert here.jacobian[:, which] == pytest.approx(change, rel=1e-3, abs=1e-2)


def test_a_spin_by_hand():
    # Both wheels of 0.1 m turn half a turn, against each other, on a track of 0.1 m: each rolls
    # 0.05 pi m, so the robot turns by pi and stays where it is. The heading's slopes: pi/2 over
    # the track for each wheel, minus pi over the track for the track.
    spin = drive(
        "spin",
        [(0.05 * pi / 100, -0.05 * pi / 100)] * 100,
        Geometry(0.1, 0.1, 0.1),
        Geometry(0.1, 0.1, 0.1),
    )
    fit = dead_reckon(whole_drive(spin), Geometry(0.1, 0.1, 0.1))
    assert fit.end == pytest.approx((0, 0, pi), abs=1e-12)
    assert fit.jacobian[2] == pytest.approx((pi / 2 / 0.1, pi / 2 / 0.1, -pi / 0.1))


def test_too_little_to_fit():
    with pytest.raises(ValueError, match="no drives"):
        fit_geometry([], STATED)
    one = drive("one", wander(1), TRUE)
    with pytest.raises(ValueError, match="start pose and an end"):
        cut_segments(replace(one, rows=one.rows[:1], poses=one.poses[:1]), STATED.mean, 1.0)
