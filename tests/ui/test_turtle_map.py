"""The map of the simulated robots: frames, colours, the lines of the turtle."""

from io import StringIO
from math import inf, pi

import pytest
from rich.console import Console

from diffbotctl.config.load import load
from diffbotctl.messages import Canvas, Odometry, Scan, TurtlePose
from diffbotctl.processes.screen import RunSnapshot
from diffbotctl.render.map_scene import Scene, describe_scene, parse_scene
from diffbotctl.runs.build_graph import assemble
from diffbotctl.ui.live_view import LiveView
from diffbotctl.ui.map import layers
from diffbotctl.ui.map.canvas import Camera, MapLayer
from diffbotctl.ui.map.state import TURTLE_MAX_LINES, MapState, TurtleTrail
from diffbotctl.ui.run_text import newest_odometry

EXACT = (0.0,) * 6


def pose(x, y, heading=0.0, time=0):
    return Odometry(time, x, y, heading, 0.0, 0.0, EXACT)


def looks(sheet=0, pen="#ff0000", is_down=True, turtles=(), **others):
    return Canvas(0, sheet, "#0000ff", pen, is_down, turtles, **others)


def picture(**messages):
    """The newest messages by wire, `__` for the dot."""
    named = {wire.replace("__", "."): message for wire, message in messages.items()}
    return RunSnapshot(0, named, 0, 0)


def drawn(view, shown, width=60, height=40):
    """The view as a terminal would get it, colours included."""
    console = Console(record=True, width=width, file=StringIO(), color_system="truecolor")
    console.print(view.render(shown, width, height))
    return console.export_text(styles=True)


def test_the_pose_of_a_block_has_priority_over_the_camera():
    camera, reckoned = pose(5, 5, time=9), pose(1, 1, time=3)
    assert newest_odometry(picture(robot__pose=camera, odometry__odometry=reckoned)) == reckoned
    assert newest_odometry(picture(robot__pose=camera)) == camera
    assert newest_odometry(picture()) is None


def test_a_further_turtle_is_at_its_own_pose():
    sheet = TurtleTrail()
    moved = TurtlePose(0, 3, 7.0, 8.0, 1.0, 0.5, 0.0)
    looked = looks(turtles=(2, 1.0, 2.0, 0.5, 3, 4.0, 5.0, 0.0))
    sheet.update(picture(canvas__canvas=looked, robot__pose=pose(0, 0), turtle3__pose=moved))
    assert sheet.others == [((1.0, 2.0), 0.5), ((7.0, 8.0), 1.0)]


def test_the_pen_draws_in_its_colour_only_while_down():
    sheet = TurtleTrail()
    way = [
        (0.0, looks()),
        (0.2, looks()),
        (0.4, looks(is_down=False)),
        (0.6, looks(pen="#00ff00")),
        (5.0, looks()),  # it was put there
    ]
    for x, drawing in way:
        sheet.update(picture(robot__pose=pose(x, 0.0), canvas__canvas=drawing))
    assert list(sheet.lines) == [
        ((0.0, 0.0), (0.2, 0.0), "#ff0000", 0.07),
        ((0.4, 0.0), (0.6, 0.0), "#00ff00", 0.07),
    ]
    sheet.update(picture(robot__pose=pose(5.0, 0.0), canvas__canvas=looks(sheet=1)))
    assert not sheet.lines


def test_every_turtle_that_is_driven_draws_with_the_pen_of_the_canvas():
    sheet = TurtleTrail()
    two, gone = looks(turtles=(2, 1.0, 1.0, 0.0)), looks()
    for drawing, x in ((two, 1.0), (two, 1.2), (gone, 1.4), (two, 1.6), (two, 1.8)):
        moved = TurtlePose(0, 2, x, 1.0, 0.0, 0.5, 0.0)
        sheet.update(picture(canvas__canvas=drawing, robot__pose=pose(x, 5.0), turtle2__pose=moved))
    lines = [(line.start, line.end) for line in sheet.lines]
    assert [line for line in lines if line[0][1] == 1.0] == [
        ((1.0, 1.0), (1.2, 1.0)),
        ((1.6, 1.0), (1.8, 1.0)),  # none while there was no turtle 2
    ]
    assert len([line for line in lines if line[0][1] == 5.0]) == 4


def test_a_wide_pen_draws_more_dots_across():
    camera = Camera(0.0, 0.0, 20.0)
    rows = []
    for width in (0.01, 0.4):
        state = MapState(Scene("", ""))
        for x in (-0.2, 0.2):
            drawing = looks(pen_width=width)
            state.update(picture(robot__pose=pose(x, 0.0), canvas__canvas=drawing))
        made = layers.draw_map(state, camera, 60, 40)
        trail = {cell for cell, layer in made.layers.items() if layer is MapLayer.TRAIL}
        rows.append({row for _, row in trail})
    assert len(rows[0]) == 1 and len(rows[1]) >= 2 and rows[0] < rows[1]


def test_a_killed_turtle_1_is_not_drawn():
    state = MapState(Scene("", ""))
    for x, first in ((0.0, True), (0.2, False), (0.4, False)):
        drawing = looks(has_first=first)
        state.update(picture(robot__pose=pose(x, 0.0), canvas__canvas=drawing))
    made = layers.draw_map(state, Camera(0.0, 0.0, 20.0), 60, 40)
    assert "→" not in made.text().plain and not state.turtle.lines


def test_a_run_without_a_canvas_has_no_turtle_lines():
    sheet = TurtleTrail()
    sheet.update(picture(robot__pose=pose(1.0, 0.0)))
    assert sheet.canvas is None and not sheet.last


def test_a_long_line_loses_its_beginning():
    sheet = TurtleTrail()
    for step in range(TURTLE_MAX_LINES + 10):
        sheet.update(picture(robot__pose=pose(0.1 * step, 0.0), canvas__canvas=looks()))
    assert len(sheet.lines) == TURTLE_MAX_LINES


def test_a_field_is_shown_whole_in_its_colour_with_every_turtle():
    setup = load("turtle")
    shown = parse_scene(describe_scene(setup, None, "sim"))
    assert len(shown.walls) == 4
    assert shown.field == ((0.0, 0.0), (11.09, 0.0), (11.09, 11.09), (0.0, 11.09))
    text = drawn(
        LiveView(shown),
        picture(robot__pose=pose(5.5, 5.5), canvas__canvas=looks(turtles=(2, 9, 9, pi))),
    )
    assert "48;2;0;0;255" in text  # the sheet's blue behind every character
    assert "→" in text and "←" in text


@pytest.mark.parametrize(
    ("robot", "expected"),
    [
        # the wall of `goal` from (2.5, -1) to (2.5, 2), the robot's start being the world's
        ("book_2wd", (2.5, -1.0, 2.5, 2.0)),
        # this one begins at (5.544, 5.544), and its block reckons from there
        ("turtle", (2.5 - 5.544, -1.0 - 5.544, 2.5 - 5.544, 2.0 - 5.544)),
    ],
)
def test_walls_are_in_the_frame_of_the_pose(robot, expected):
    (wall,) = parse_scene(describe_scene(load("goal", robot), None, "sim")).walls
    assert wall == pytest.approx(expected)


def test_the_world_of_a_real_robot_is_not_drawn():
    drawing = describe_scene(load("goal"), None, "/dev/ttyUSB0")
    assert (drawing["walls"], drawing["rounds"], drawing["field"]) == ([], [], [])


def test_a_laser_scan_is_drawn_where_its_rays_met_something():
    setup = load("wander")
    shown = parse_scene(describe_scene(setup, assemble(setup, False).graph, "sim"))
    (eye,) = shown.beams
    assert (eye.topic, eye.x) == ("robot.scan", -0.032)
    # ahead 1.032 m, clear to the left, too close behind, 0.5 m to the right of the eye
    scan = Scan(0, 0.0, pi / 2, (1.032, inf, 0.0, 0.5))
    camera = Camera(0.0, 0.0, 20.0)
    state = MapState(Scene("", "", beams=shown.beams))
    state.update(picture(o__o=pose(0, 0), robot__scan=scan))
    made = layers.draw_map(state, camera, 60, 40)
    dots = {cell for cell, layer in made.layers.items() if layer is MapLayer.SCAN}
    expected = {camera.dot(at, 60, 40) for at in ((1.0, 0.0), (-0.032, -0.5))}
    assert dots == {(column // 2, row // 4) for column, row in expected}
