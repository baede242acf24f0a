"""The map: positions of dots, and what is drawn where, in blocks and in letters."""

from math import pi, sqrt

import pytest
from hypothesis import given
from hypothesis import strategies as st

from diffbotctl.geometry.footprint import arc_motion
from diffbotctl.messages import Goal, Odometry, Range
from diffbotctl.processes.screen import RunSnapshot
from diffbotctl.render.map_scene import Scene, SceneBeam, SceneOutline
from diffbotctl.time import MILLISECOND, SECOND
from diffbotctl.ui.map import layers
from diffbotctl.ui.map.canvas import Camera, MapCanvas, MapLayer, fit_camera, scale_bar
from diffbotctl.ui.map.state import MapState

CERTAIN = (0.0,) * 6
BODY = SceneOutline(0.08, 0.15, 0.14, 0.125, 0.065, 0.065, 0.3, 4.0)


@given(st.integers(0, 79), st.integers(0, 23), st.floats(2.0, 200.0))
def test_a_click_hits_the_character_that_was_clicked(column, row, scale):
    camera = Camera(0.3, -0.7, scale)
    across, down = camera.dot(camera.place(column, row, 80, 24), 80, 24)
    assert (across // 2, down // 4) == (column, row)


@given(st.lists(st.tuples(st.floats(-5, 5), st.floats(-5, 5)), min_size=1, max_size=20))
def test_all_points_are_in_the_window(points):
    camera = fit_camera(points, 60, 20)
    for point in points:
        column, row = camera.dot(point, 60, 20)
        assert 0 <= column < 120 and 0 <= row < 80


def test_x_runs_right_and_y_up():
    camera = Camera(0.0, 0.0, 10.0)
    right, _ = camera.dot((1.0, 0.0), 40, 10)
    _, up = camera.dot((0.0, 1.0), 40, 10)
    assert (right, up) == (40 + 10, 20 - 10)  # the middle is dot 40, 20; ten dots a metre


@pytest.mark.parametrize(
    ("bits_at", "sign"),
    [
        ([(0, 0)], "▘"),
        ([(1, 0)], "▝"),
        ([(0, 3)], "▖"),
        ([(1, 3)], "▗"),
        ([(0, 0), (0, 3)], "▌"),
        ([(0, 0), (1, 0)], "▀"),
        ([(0, 1), (1, 2)], "▚"),
        ([(0, 0), (1, 0), (0, 3), (1, 3)], "█"),
    ],
)
def test_walls_are_drawn_in_quarters(bits_at, sign):
    drawing = MapCanvas(Camera(0, 0, 1.0), 1, 1)
    for column, row in bits_at:
        drawing.layer_dot(column, row, MapLayer.WALL)
    assert drawing.text().plain == sign


def test_the_highest_layer_gives_the_letter():
    drawing = MapCanvas(Camera(0, 0, 1.0), 1, 1, plain=True)
    for layer in (MapLayer.ROBOT, MapLayer.TRAIL):
        drawing.point((0.0, 0.0), layer)
    assert drawing.text().plain == "o"


def picture(**messages):
    return RunSnapshot(0, {name.replace("_", "."): each for name, each in messages.items()}, 0, 0)


def test_everything_is_on_the_map_in_letters():
    scene = Scene(
        "t",
        "",
        ((1.0, -1.0, 1.0, 1.0),),
        ((0.0, 0.7, 0.1),),
        BODY,
        (SceneBeam("range.range", 0.08, 0.0, 0.0, 0.3),),
    )
    here = Odometry(0, 0.0, 0.0, 0.0, 0.0, 0.0, (0.01, 0.0, 0.0, 0.0025, 0.0, 0.0))
    seen = picture(
        odometry=here, goal=Goal(0, 1, 0.7, -0.5, pi / 2), range_range=Range(0, 0.2, "measured")
    )
    trail = [(-0.5 + 0.01 * i, -0.4) for i in range(30)]
    camera = fit_camera([(-1.2, -1.2), (1.2, 1.2)], 70, 35)
    state = MapState(scene)
    state.snapshot = seen
    state.trail.points.extend(trail)
    text = layers.draw_map(state, camera, 70, 35, plain=True).text().plain
    for (
        sign
    ) in "#.o>X+:x~,|":  # wall, trail, outline, robot, goal, heading, beam, hit, doubt, way, bar
        assert sign in text, f"no {sign} on\n{text}"
    assert text.isascii()
    lines = text.split("\n")
    assert lines[-1].rstrip().endswith(" m   # wall")
    row = next(i for i, line in enumerate(lines) if ">" in line)
    assert lines[row].index(">") == pytest.approx(35, abs=1) and row == pytest.approx(17, abs=1)


@pytest.mark.parametrize(
    ("covariance", "axes", "turn"),
    [
        # xx, xy, xh, yy, yh, hh; half axes are three sigmas
        ((0.04, 0, 0, 0.01, 0, 0), (0.6, 0.3), 0.0),
        ((0.01, 0, 0, 0.04, 0, 0), (0.6, 0.3), pi / 2),
        ((0.02, 0.01, 0, 0.02, 0, 0), (3 * sqrt(0.03), 3 * sqrt(0.01)), pi / 4),
        (CERTAIN, (0.0, 0.0), 0.0),
    ],
)
def test_the_ellipse_has_three_sigmas(covariance, axes, turn):
    long, short, found = layers.covariance_ellipse(covariance)
    assert (long, short) == pytest.approx(axes)
    assert found == pytest.approx(turn)


@pytest.mark.parametrize(
    ("scale", "words"),
    [
        # 60 wide: a third is 20 characters, 40 dots
        (40.0, "├──────────────────┤ 1 m"),
        (41.0, "├─────────┤ 0.5 m"),  # 20.5 dots are 11 characters
        (400.0, "├──────────────────┤ 0.1 m"),
    ],
)
def test_the_scale_bar_has_a_round_length(scale, words):
    assert scale_bar(Camera(0, 0, scale), 60) == words


@given(st.floats(-1.0, 1.0), st.floats(-3.0, 3.0), st.integers(0, 400))
def test_a_scan_is_drawn_from_the_pose_at_its_time(linear, angular, since_ms):
    """The robot that drives on from there at the same velocity comes to the pose of now."""
    now = Odometry(2 * SECOND, 0.3, -0.2, 0.7, linear, angular, CERTAIN)
    time = now.time - since_ms * MILLISECOND
    then = layers.pose_at(now, time)
    x, y, turn = arc_motion(linear, angular, since_ms / 1000)
    place = layers.to_odom(then, x, y)
    assert (*place, then.heading + turn) == pytest.approx((now.x, now.y, now.heading))
    assert then.time == time


def test_a_scan_that_is_newer_than_the_pose_is_drawn_from_it():
    now = Odometry(SECOND, 0.3, -0.2, 0.7, 0.1, 1.0, CERTAIN)
    then = layers.pose_at(now, now.time + SECOND)
    assert (then.x, then.y, then.heading) == (now.x, now.y, now.heading)
