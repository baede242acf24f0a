"""What viewers are given: the published schemas, and messages that keep to them."""

import json
from base64 import b64decode
from hashlib import sha256
from math import inf, nan, pi, sqrt

import pytest
from jsonschema import Draft7Validator
from mcap.reader import make_reader

from diffbotctl.config.load import load
from diffbotctl.geometry.map_tiles import encode_tile
from diffbotctl.messages import LogLine, MapPose, MapUpdate, Odometry, Range, Scan, Twist
from diffbotctl.recording import foxglove
from diffbotctl.recording.foxglove import ViewerMessages, schema
from diffbotctl.recording.viewer_model import ViewerModel, viewer_model
from diffbotctl.runs.options import RunOptions
from diffbotctl.runs.run import Run

EPOCH = 1_700_000_000_000_000_000
# SHA-256 of each schema of @foxglove/schemas 2.1.0, written with sorted keys by json.dumps.
PUBLISHED = {
    "FrameTransform": "cec145253b0f1ca3e9415ab096eb8d17b5a331cd98aaa39cd930184349ff84ef",
    "PoseInFrame": "8988b1b89d7350306accf887a32a28d9879ba543e15607b8c8096849dfcd2b09",
    "LaserScan": "adaabd6e7b2beccce7d86b206bef823bf5161a2fcd49a62238d5e59c83474c64",
    "Log": "3837e1e52d67502baf7b977c7602985ca65da64e2af5b114343f29554945dc54",
    "Grid": "c0f73d3461830f12e58457c46e5b432a477b8f2f6bee9a78c7b49b157f474147",
    "SceneUpdate": "aa4199d1493bd87e7fba5f9a07ff27e5b1e8204e7cbac2058bfe4106445b5be7",
}


@pytest.mark.parametrize("name", foxglove.SCHEMAS)
def test_the_schemas_are_the_published_ones(name):
    shipped = json.loads(schema(name))
    assert shipped["title"] == f"foxglove.{name}"
    text = json.dumps(shipped, sort_keys=True).encode()
    assert sha256(text).hexdigest() == PUBLISHED[name]


@pytest.fixture(scope="module")
def views(tmp_path_factory):
    """(schema name, its text, topic, message) of all that a run's recording holds for viewers."""
    path = tmp_path_factory.mktemp("views") / "goal.mcap"
    sets = ["world.walls=[{from: [0.8 m, -1 m], to: [0.8 m, 1 m]}]", "follower.patience=2 s"]
    Run(load("goal", None, sets), RunOptions(fast=True, record=path, seed=3)).go()
    with path.open("rb") as file:
        return [
            (schema.name, schema.data, channel.topic, json.loads(message.data))
            for schema, channel, message in make_reader(file).iter_messages()
            if schema.name.startswith("foxglove.")
        ]


@pytest.mark.parametrize("name", [name for name in foxglove.SCHEMAS if name != "Grid"])
def test_every_message_keeps_to_the_schema_in_the_file(views, name):
    messages_seen = [
        (text, message) for kind, text, _, message in views if kind == f"foxglove.{name}"
    ]
    assert len(messages_seen) > 2
    (text,) = {text for text, _ in messages_seen}
    assert json.loads(text) == json.loads(schema(name))
    validator = Draft7Validator(json.loads(text))
    for _, message in messages_seen:
        validator.validate(message)


def test_a_run_into_a_wall_is_in_the_log(views):
    lines = [message["message"] for kind, _, _, message in views if kind == "foxglove.Log"]
    assert any("obstacle" in line for line in lines)
    assert any("blocked" in line for line in lines)
    assert len(lines) < 30  # events, not messages


def test_the_frames_form_one_tree(views):
    parts = {
        (m["parent_frame_id"], m["child_frame_id"]) for n, _, _, m in views if n.endswith("form")
    }
    assert parts == {
        ("odom", "base_footprint"),
        ("base_footprint", "base_link"),
        ("base_link", "left_wheel_link"),
        ("base_link", "right_wheel_link"),
        ("base_link", "caster_link"),
        ("base_link", "front_sensor_link"),
    }
    frames = {child for _, child in parts} | {"odom"}
    entities = [
        each for n, _, _, m in views if n == "foxglove.SceneUpdate" for each in m["entities"]
    ]
    assert {each["frame_id"] for each in entities} <= frames
    scans = [m for n, _, _, m in views if n == "foxglove.LaserScan"]
    assert {scan["frame_id"] for scan in scans} == {"front_sensor_link"}
    measured = [m["ranges"] for n, _, _, m in views if n == "foxglove.LaserScan" and m["ranges"]]
    assert measured and all(0.03 < each[0] < 0.31 for each in measured)


def odometry(x, y, heading):
    return Odometry(1_500_000_000, x, y, heading, 0.0, 0.0, (0.0,) * 6)


@pytest.mark.parametrize(
    "heading, z, w",
    [  # a turn by h about z is the quaternion (0, 0, sin h/2, cos h/2)
        (0.0, 0.0, 1.0),
        (pi / 2, sqrt(0.5), sqrt(0.5)),
        (-pi / 2, -sqrt(0.5), sqrt(0.5)),
        (pi, 1.0, 0.0),
    ],
)
def test_a_pose(heading, z, w):
    posed = json.loads(foxglove.pose_in_frame(EPOCH, odometry(1.5, -0.25, heading)))
    assert posed["timestamp"] == {"sec": 1_700_000_001, "nsec": 500_000_000}
    assert posed["pose"]["position"] == {"x": 1.5, "y": -0.25, "z": 0.0}
    assert posed["pose"]["orientation"] == pytest.approx({"x": 0, "y": 0, "z": z, "w": w})
    moved = json.loads(
        foxglove.odometry_transform(EPOCH, odometry(1.5, -0.25, heading), "base_link")
    )
    assert (moved["parent_frame_id"], moved["child_frame_id"]) == ("odom", "base_link")
    assert moved["translation"] == posed["pose"]["position"]
    assert moved["rotation"] == posed["pose"]["orientation"]


@pytest.mark.parametrize("bad", [nan, inf, -inf])
def test_values_that_are_not_finite_are_left_out(bad):
    assert foxglove.pose_in_frame(EPOCH, odometry(bad, 0.0, 0.0)) is None
    assert foxglove.odometry_transform(EPOCH, odometry(0.0, 0.0, bad), "base_link") is None
    scan = json.loads(foxglove.laser_scan(EPOCH, Range(0, bad, "measured"), "front"))
    assert scan["ranges"] == []


@pytest.mark.parametrize(
    "state, drawn", [("measured", 3), ("clear", 0), ("too_close", 0), ("fault", 0)]
)
def test_only_a_measured_distance_is_drawn(state, drawn):
    scan = json.loads(foxglove.laser_scan(EPOCH, Range(0, 0.2, state), "front"))
    assert scan["ranges"] == [0.2] * drawn


@pytest.mark.parametrize(
    "level, number", [("debug", 1), ("info", 2), ("warning", 3), ("error", 4), ("loud", 0)]
)
def test_a_line_of_the_log(level, number):
    viewers = ViewerMessages(EPOCH, {"mux.twist": Twist, "log": LogLine}, ViewerModel())
    line = LogLine(2_000_000_001, level, "guard", 'the "wall" is near')
    ((topic, data),) = viewers.messages((2_000_000_001, None, line))
    assert topic == "log.lines"
    assert json.loads(data) == {
        "timestamp": {"sec": 1_700_000_002, "nsec": 1},
        "level": number,
        "name": "guard",
        "message": 'the "wall" is near',
        "file": "",
        "line": 0,
    }


def test_only_one_of_two_odometries_makes_the_transform():
    wires = {"raw.odometry": Odometry, "odometry.odometry": Odometry}
    viewers = ViewerMessages(EPOCH, wires, ViewerModel())
    output = list(viewers.messages((1, odometry(1.0, 0.0, 0.0), odometry(2.0, 0.0, 0.0))))
    assert [topic for topic, _ in output] == [
        "tf",
        "raw.odometry.pose",
        "trail",
        "odometry.odometry.pose",
    ]


def test_what_does_not_change_is_repeated():
    scene = {"walls": [[0.0, 0.0, 1.0, 0.0]], "rounds": [], "sensors": []}
    model = viewer_model(load("goal"), scene)
    viewers = ViewerMessages(EPOCH, {"range.range": Range}, model)
    batches = [list(viewers.messages((t * 1_000_000_000, None))) for t in range(11)]
    once = len(model.frames) - 1 + len(["robot", "walls"])  # the pose in odom is not fixed
    assert [len(each) for each in batches] == [once, 0, 0, 0, 0, once, 0, 0, 0, 0, once]


def test_a_laser_scan_has_its_angles_and_no_infinity():
    made = json.loads(foxglove.full_scan(EPOCH, Scan(0, -1.0, 0.5, (0.4, inf, 0.0)), "lidar"))
    assert (made["frame_id"], made["start_angle"], made["end_angle"]) == ("lidar", -1.0, 0.0)
    assert made["ranges"] == [0.4, 0.0, 0.0]
    Draft7Validator(json.loads(schema("LaserScan"))).validate(made)


def test_a_map_is_a_grid_in_the_frame_map():
    view = ViewerMessages(EPOCH, {"map.update": MapUpdate, "slam.pose": MapPose}, ViewerModel())
    tile = encode_tile(("#" * 10 + "." * 20).ljust(64, "u") * 64)
    update = MapUpdate(7, "mapping", version=1, sha256="x", places=(-1, 0, 1, 1), tiles=(tile,) * 2)
    ((topic, data),) = view.of_wire("map.update", update)
    message = json.loads(data)
    Draft7Validator(json.loads(schema("Grid"))).validate(message)
    cells = b64decode(message["data"])
    assert topic == "map.update.grid" and message["frame_id"] == "map"
    assert (len(cells), message["column_count"]) == (3 * 64 * 2 * 64, 3 * 64)
    assert cells[:64] == bytes([255] * 10 + [0] * 20 + [127] * 34)
    assert message["pose"]["position"]["x"] == pytest.approx(-64 * 0.05)
    pose = MapPose(7, 0.0, 0.0, 0.0, (0.0,) * 6, "mapping", (1.0, 2.0, 0.0))
    ((_, data),) = view.of_wire("slam.pose", pose)
    transform = json.loads(data)
    assert (transform["parent_frame_id"], transform["child_frame_id"]) == ("map", "odom")
    assert list(view.of_wire("map.update", update._replace(time=9))) == []  # too early
