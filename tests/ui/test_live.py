"""The live view: what stands where on the map, in which frame and colour."""

from io import StringIO
from math import pi

import pytest
from rich.console import Console

from diffbotctl.cli.run import scene_of
from diffbotctl.config.load import load
from diffbotctl.hub.latest import Snapshot
from diffbotctl.messages import Canvas, Odometry
from diffbotctl.ui.live import LiveView, Scene
from diffbotctl.ui.map import Map
from diffbotctl.ui.words import located

EXACT = (0.0,) * 6


def pose(x, y, heading=0.0, time=0):
    return Odometry(time, x, y, heading, 0.0, 0.0, EXACT)


def sheet(number=0, pen="#ff0000", is_down=True, turtles=()):
    return Canvas(0, number, "#0000ff", pen, is_down, turtles)


def drawn(view, width=60, height=40, **messages):
    """The view's text for the newest messages by wire (`__` for the dot)."""
    named = {wire.replace("__", "."): message for wire, message in messages.items()}
    console = Console(record=True, width=width, file=StringIO(), color_system="truecolor")
    console.print(view.render(Snapshot(0, named, 0, 0), width, height))
    return console.export_text(styles=True)


def test_a_block_s_pose_goes_before_the_camera_s():
    both = {"robot.pose": pose(5, 5, time=9), "odometry.odometry": pose(1, 1, time=3)}
    assert located(Snapshot(0, both, 0, 0)) == (both["odometry.odometry"], False)
    assert located(Snapshot(0, {"robot.pose": both["robot.pose"]}, 0, 0))[1] is True
    assert located(Snapshot(0, {}, 0, 0)) == (None, False)


@pytest.mark.parametrize(
    ("wire", "at", "wanted"),
    [
        ("robot__pose", pose(9.0, 8.0), (9.0, 8.0)),  # already in the world
        # 2 m ahead and 1 m left of a start at (5, 5) that looks along y
        ("odometry__odometry", pose(2.0, 1.0), (4.0, 7.0)),
    ],
)
def test_the_trail_is_kept_in_the_world_s_frame(wire, at, wanted):
    view = LiveView(Scene("any", "SIMULATED", [], [], (5.0, 5.0, pi / 2)))
    drawn(view, **{wire: at})
    ((place, _),) = view.trail
    assert place == pytest.approx(wanted)


def test_the_pen_draws_in_its_colour_only_while_down():
    view = LiveView(Scene("turtle", "SIMULATED", [], []))
    for x, said in ((0.0, sheet()), (1.0, sheet(is_down=False)), (2.0, sheet(pen="#00ff00"))):
        drawn(view, robot__pose=pose(x, 0.0), canvas__canvas=said)
    assert view.trail == [((0.0, 0.0), "#ff0000"), ((2.0, 0.0), "#00ff00")]
    drawn(view, robot__pose=pose(2.0, 0.0), canvas__canvas=sheet(number=1))
    assert view.trail == []


def test_a_field_is_shown_whole_in_its_colour_with_every_turtle():
    setup = load("turtle")
    scene = scene_of(setup, "sim")
    assert scene.is_field and len(scene.walls) == 4
    assert scene.start == pytest.approx((5.544, 5.544, 0.0))
    text = drawn(
        LiveView(scene), robot__pose=pose(5.5, 5.5), canvas__canvas=sheet(turtles=(2, 9, 9, pi))
    )
    assert "48;2;0;0;255" in text  # the sheet's blue as a background
    assert "→" in text and "←" in text


def test_of_a_real_robot_s_world_nothing_is_drawn():
    scene = scene_of(load("goal"), "/dev/ttyUSB0")
    assert (scene.walls, scene.obstacles, scene.simulated) == ([], [], "")


def test_a_circle_is_drawn_as_round_as_dots_allow():
    around = Map(40, 20, [(-1, -1), (1, 1)])
    around.circle((0.0, 0.0), 1.0)
    lines = str(around.text()).splitlines()
    rows = [line for line in lines if line.strip()]
    wide = max(len(line.rstrip()) for line in rows) - min(
        len(line) - len(line.lstrip()) for line in rows
    )
    # a character is two dots wide and four high
    assert wide * 2 == pytest.approx(len(rows) * 4, abs=6)
