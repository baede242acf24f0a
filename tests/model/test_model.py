"""The model of a robot: poses and inertia worked out by hand, and what its drawings contain."""

import re
from math import atan2, hypot, pi
from xml.etree import ElementTree

import pytest

from diffbotctl.config import lookup
from diffbotctl.config.load import load_robot
from diffbotctl.model.frames import Box, Cylinder, Sphere, caster_x, robot_frames, robot_solids
from diffbotctl.model.urdf import urdf
from diffbotctl.render import robot_drawing
from diffbotctl.render.robot_drawing import drawing_svg

ROBOTS = lookup.names("robots")
EXACT = 1e-9  # m or rad


@pytest.fixture(params=ROBOTS)
def robot(request):
    """Every shipped robot."""
    return load_robot(request.param).robot


MOMENTS = [
    # 12 kg, 1 x 2 x 3 m: m/12 (y2 + z2) = 4 + 9, (1 + 9), (1 + 4)
    (Box((1.0, 2.0, 3.0)), 12.0, (13.0, 10.0, 5.0)),
    # 12 kg, r 1 m, 2 m long: about its own axis m r2 / 2 = 6, across m/12 (3 r2 + l2) = 7
    (Cylinder(1.0, 2.0), 12.0, (7.0, 6.0, 7.0)),
    # 5 kg, r 1 m: 2/5 m r2
    (Sphere(1.0), 5.0, (2.0, 2.0, 2.0)),
]


@pytest.mark.parametrize(("shape", "mass", "expected"), MOMENTS)
def test_moments_of_inertia(shape, mass, expected):
    assert shape.moments(mass) == pytest.approx(expected)


# Unequal wheels, a sensor that looks aside, a caster that is placed: 60 and 70 mm stand on the
# ground, so the axle's middle is at (30 + 35) / 2 = 32.5 mm and the hubs at -2.5 and +2.5 mm of it.
LOPSIDED = """
format: 1
kind: robot
include: book_2wd
drive:
  left: {wheel: {diameter: 60 mm}}
  right: {wheel: {diameter: 70 mm}}
sensors:
  front: {at: {x: 70 mm, y: -20 mm, z: 15 mm, heading: 30 deg}}
body: {caster: {x: -100 mm, diameter: 16 mm}}
"""
PLACES = {
    "base_footprint": (0, 0, 0, 0),
    "base_link": (0, 0, 0.0325, 0),
    "left_wheel_link": (0, 0.0625, 0.030, 0),
    "right_wheel_link": (0, -0.0625, 0.035, 0),
    "caster_link": (-0.1, 0, 0.008, 0),
    "front_sensor_link": (0.07, -0.02, 0.0475, pi / 6),
}


@pytest.fixture
def lopsided(tmp_path):
    """A robot on which no two measures are equal."""
    file = tmp_path / "lopsided.yaml"
    file.write_text(LOPSIDED)
    return load_robot(str(file)).robot


def by_yourdfpy(text, path):
    """Place of every link above the ground as one parser understands the model."""
    import yourdfpy

    path.write_text(text)
    read = yourdfpy.URDF.load(str(path), load_meshes=False, build_collision_scene_graph=False)
    assert read.validate(), read.errors
    return {link: read.get_transform(link, "base_footprint") for link in read.link_map}


def by_urchin(text, path):
    """The same by another one."""
    import urchin

    path.write_text(text)
    read = urchin.URDF.load(str(path), lazy_load_meshes=True)
    assert read.base_link.name == "base_footprint"
    return {link.name: matrix for link, matrix in read.link_fk().items()}


@pytest.mark.parametrize("parser", [by_yourdfpy, by_urchin])
def test_a_parser_reads_the_poses_that_the_file_has(lopsided, tmp_path, parser):
    found = parser(urdf(lopsided, "lopsided"), tmp_path / "lopsided.urdf")
    assert set(found) == set(PLACES)
    for name, (x, y, z, heading) in PLACES.items():
        matrix = found[name]
        assert matrix[:3, 3] == pytest.approx((x, y, z), abs=EXACT), name
        assert atan2(matrix[1, 0], matrix[0, 0]) == pytest.approx(heading, abs=EXACT), name


@pytest.mark.parametrize("parser", [by_yourdfpy, by_urchin])
@pytest.mark.parametrize("name", ROBOTS)
def test_two_parsers_accept_every_shipped_robot(name, tmp_path, parser):
    robot = load_robot(name).robot
    found = parser(urdf(robot, name), tmp_path / "robot.urdf")
    for side, sign in (("left", 1), ("right", -1)):
        hub = found[f"{side}_wheel_link"][:3, 3]
        radius = getattr(robot.drive, side).wheel.diameter / 2
        assert hub == pytest.approx((0, sign * robot.drive.track / 2, radius), abs=EXACT)


def test_a_wheel_that_turns_forward_rolls_forward(lopsided):
    root = ElementTree.fromstring(urdf(lopsided, "lopsided"))
    joints = {joint.get("name"): joint for joint in root.iter("joint")}
    for side in ("left", "right"):
        joint = joints[f"{side}_wheel_joint"]
        assert joint.get("type") == "continuous"
        # v = w x r with r up from the ground to the hub: (0, w, 0) x (0, 0, R) = (w R, 0, 0)
        assert joint.find("axis").get("xyz") == "0 1 0"
    assert joints["base_joint"].get("type") == "fixed"


def test_every_inertia_is_that_of_a_real_body(robot):
    root = ElementTree.fromstring(urdf(robot, "any"))
    for inertia in root.iter("inertia"):
        x, y, z = (float(inertia.get(axis)) for axis in ("ixx", "iyy", "izz"))
        assert min(x, y, z) > 0
        # No body's moments break this: each is a sum of two of three positive integrals.
        assert x + y >= z * (1 - 1e-12)
        assert y + z >= x * (1 - 1e-12)
        assert x + z >= y * (1 - 1e-12)


def test_the_root_weighs_nothing_and_the_rest_has_a_collision_shape(robot):
    root = ElementTree.fromstring(urdf(robot, "any"))
    links = {link.get("name"): link for link in root.iter("link")}
    assert len(links.pop("base_footprint")) == 0
    assert {name for name, link in links.items() if link.find("collision") is None} == set()
    assert len(links) == len(list(robot_solids(robot)))


def test_a_caster_without_a_place_stands_at_the_longer_end(robot):
    robot.body.caster.x = None
    body = robot.body
    expected = -0.8 * body.back if body.back >= body.front else 0.8 * body.front
    assert caster_x(robot) == pytest.approx(expected)


def test_every_frame_has_its_parent_before_it(robot):
    seen = {"odom"}
    for frame in robot_frames(robot):
        assert frame.parent in seen
        seen.add(frame.name)


def corners(outlines, name):
    """Least and most x and y of one part of a drawing."""
    (points,) = [outline.points for outline in outlines if outline.name == name]
    xs, ys = [x for x, _ in points], [y for _, y in points]
    return min(xs), max(xs), min(ys), max(ys)


def test_what_is_drawn_from_above(lopsided):
    view = robot_drawing.top_view(lopsided)
    assert corners(view.outlines, "chassis") == pytest.approx((-0.15, 0.08, -0.0755, 0.0755))
    # 60 mm long, 26 mm wide, its middle 62.5 mm to the left
    assert corners(view.outlines, "left_wheel") == pytest.approx((-0.03, 0.03, 0.0495, 0.0755))
    (axis,) = [outline for outline in view.outlines if outline.name == "front axis"]
    (x1, y1), (x2, y2) = axis.points
    assert atan2(y2 - y1, x2 - x1) == pytest.approx(pi / 6)
    assert "track 125 mm" in [each.label for each in view.dimensions]


def test_what_is_drawn_from_the_side(lopsided):
    view = robot_drawing.side_view(lopsided)
    # from its underside, 20 mm above the ground, 100 mm up
    assert corners(view.outlines, "chassis") == pytest.approx((-0.15, 0.08, 0.02, 0.12))
    assert corners(view.outlines, "left_wheel") == pytest.approx((-0.03, 0.03, 0.0, 0.06))
    assert corners(view.outlines, "caster") == pytest.approx((-0.108, -0.092, 0.0, 0.016))


def test_the_picture_is_to_scale(lopsided):
    views = [robot_drawing.top_view(lopsided), robot_drawing.side_view(lopsided)]
    root = ElementTree.fromstring(drawing_svg("lopsided", views))
    parts = [part for part in root.iter() if part.get("data-part") == "chassis"]
    sizes = []
    for part in parts:
        numbers = [float(each) for each in re.split("[ ,]", part.get("points"))]
        xs, ys = numbers[0::2], numbers[1::2]
        sizes.append((max(xs) - min(xs), max(ys) - min(ys)))
    (long, wide), (again, high) = sizes
    assert long == pytest.approx(again, abs=0.02)
    assert long / wide == pytest.approx(230 / 151, abs=0.001)
    assert long / high == pytest.approx(230 / 100, abs=0.001)
    for part in root.iter():  # nothing lies beside the paper
        for x in re.findall(r"-?[\d.]+(?=,)", part.get("points") or ""):
            assert 0 <= float(x) <= float(root.get("width"))


def test_the_picture_has_a_scale_bar_and_the_names_of_the_parts(lopsided):
    views = [robot_drawing.top_view(lopsided), robot_drawing.side_view(lopsided)]
    root = ElementTree.fromstring(drawing_svg("lopsided", views))
    texts = [each.text for each in root.iter("{http://www.w3.org/2000/svg}text")]
    assert texts.count("chassis") == 2 and texts.count("caster") == 2
    assert texts.count("left wheel") == 2 and texts.count("right wheel") >= 1
    (length,) = (float(text[:-3]) for text in texts if re.fullmatch(r"[\d.]+ mm", text))
    chassis = next(part for part in root.iter() if part.get("data-part") == "chassis")
    bar = [part for part in root.iter() if part.tag.endswith("polyline")][-1]
    spans = []
    for part in (chassis, bar):
        xs = [float(x) for x in re.findall(r"-?[\d.]+(?=,)", part.get("points"))]
        spans.append(max(xs) - min(xs))
    assert spans[1] / spans[0] == pytest.approx(length / 230, abs=0.001)


def test_a_wheel_is_as_far_away_as_its_place_states(robot):
    for frame in robot_frames(robot):
        if frame.moves == "wheel":
            assert hypot(frame.x, frame.y) == pytest.approx(robot.drive.track / 2)
