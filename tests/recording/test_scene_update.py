"""The scene for viewers: walls, robot, goal, path, trail, layout, robot model."""

import json
from math import inf, pi, sqrt
from xml.etree import ElementTree

import pytest
from jsonschema import Draft7Validator
from mcap.reader import make_reader

from diffbotctl.cli.main import program
from diffbotctl.config.load import load
from diffbotctl.errors import RunError
from diffbotctl.messages import Goal, Odometry, Path, Wheels
from diffbotctl.model.frames import Box, Cylinder, Solid, Sphere
from diffbotctl.recording import scene_update
from diffbotctl.recording.foxglove import ViewerMessages, schema
from diffbotctl.recording.reader import read_attachment
from diffbotctl.recording.viewer_layout import viewer_layout
from diffbotctl.recording.viewer_model import ViewerModel, viewer_model
from diffbotctl.runs.options import RunOptions
from diffbotctl.runs.run import Run
from tests.command_result import invoke

TIME = 1_700_000_000_000_000_007
VALIDATOR = Draft7Validator(json.loads(schema("SceneUpdate")))


def checked(data):
    """The entities of a message that keeps to the schema, by identifier."""
    message = json.loads(data)
    VALIDATOR.validate(message)
    return {entity["id"]: entity for entity in message["entities"]}


def test_a_wall_is_a_box_along_its_line():
    (walls,) = checked(
        scene_update.walls(TIME, [(1.0, -1.0, 1.0, 3.0)], [(2.0, 0.5, 0.2)])
    ).values()
    assert walls["timestamp"] == {"sec": 1_700_000_000, "nsec": 7}
    (wall,), (pillar,) = walls["cubes"], walls["cylinders"]
    assert wall["pose"]["position"] == {"x": 1.0, "y": 1.0, "z": 0.125}
    assert wall["size"]["x"] == 4.0
    half = sqrt(0.5)  # along y: a quarter turn about z
    assert wall["pose"]["orientation"] == pytest.approx({"x": 0, "y": 0, "z": half, "w": half})
    assert (pillar["size"]["x"], pillar["size"]["y"]) == (0.4, 0.4)


def test_solids_of_the_robot_are_in_their_own_frames():
    solids = [
        Solid("base_link", Box((0.2, 0.1, 0.05)), 1.0, (0.01, 0.0, 0.02), "blue"),
        Solid("left_wheel_link", Cylinder(0.03, 0.02), 0.1),
        Solid("caster_link", Sphere(0.01), 0.1),
    ]
    entities = checked(scene_update.robot(TIME, solids))
    assert {name: each["frame_id"] for name, each in entities.items()} == {
        each.frame: each.frame for each in solids
    }
    assert all(each["frame_locked"] for each in entities.values())
    (body,) = entities["base_link"]["cubes"]
    assert body["size"] == {"x": 0.2, "y": 0.1, "z": 0.05}
    assert body["pose"]["position"] == {"x": 0.01, "y": 0.0, "z": 0.02}
    (wheel,) = entities["left_wheel_link"]["cylinders"]
    assert wheel["size"] == {"x": 0.06, "y": 0.06, "z": 0.02}
    assert wheel["pose"]["orientation"]["x"] == pytest.approx(sqrt(0.5))  # z turned to the axle
    assert entities["caster_link"]["spheres"][0]["size"] == {"x": 0.02, "y": 0.02, "z": 0.02}


def test_a_goal_has_an_arrow_only_with_a_heading_and_number_0_removes_it():
    turned = checked(scene_update.goal(TIME, Goal(0, 1, 1.0, 0.5, pi)))["goal"]
    assert turned["cylinders"][0]["pose"]["position"]["x"] == 1.0
    assert turned["arrows"][0]["pose"]["orientation"]["z"] == pytest.approx(1.0)
    assert not checked(scene_update.goal(TIME, Goal(0, 2, 1.0, 0.5)))["goal"]["arrows"]
    removed = scene_update.goal(TIME, Goal(0, 0))
    assert not checked(removed)
    (deletion,) = json.loads(removed)["deletions"]
    assert (deletion["type"], deletion["id"]) == (0, "goal")
    assert scene_update.goal(TIME, Goal(0, 1, inf, 0.0)) is None


def test_a_path_is_a_line_through_its_points():
    route = Path(0, (Goal(0, 1, 0.0, 0.0), Goal(0, 2, 1.0, 0.5)))
    (line,) = checked(scene_update.path(TIME, route))["path"]["lines"]
    assert [(point["x"], point["y"]) for point in line["points"]] == [(0.0, 0.0), (1.0, 0.5)]


def test_the_trail_grows_once_a_second_while_the_robot_moves():
    viewers = ViewerMessages(0, {"odometry.odometry": Odometry}, ViewerModel())
    lengths = []
    for tick in range(31):  # 10 Hz, 5 cm each for two seconds, then it stands
        pose = Odometry(tick * 100_000_000, 0.05 * min(tick, 20), 0.0, 0.0, 0.0, 0.0, (0.0,) * 6)
        for topic, data in viewers.messages((pose.time, pose)):
            if topic == "trail":
                (line,) = checked(data)["trail"]["lines"]
                lengths.append((tick, len(line["points"])))
    assert lengths == [(0, 1), (10, 11), (20, 21)]


def leaves(tree):
    if isinstance(tree, str):
        return [tree]
    return leaves(tree["first"]) + leaves(tree["second"])


def test_the_layout_has_each_panel_once_in_its_window():
    wires = {"odometry.odometry": Odometry, "gate.wheels": Wheels}
    logs = {"operator.log.lines": "Log", "log.lines": "Log"}
    topics = {"tf": "FrameTransform", **logs, "walls": "SceneUpdate"}
    layout = viewer_layout(wires, topics)
    assert sorted(leaves(layout["layout"])) == sorted(layout["configById"])
    assert {panel.partition("!")[0] for panel in layout["configById"]} == {"3D", "Plot", "RosOut"}
    assert layout["configById"]["RosOut!log"]["topicToRender"] == "log.lines"
    paths = [path["value"] for path in layout["configById"]["Plot!speed"]["paths"]]
    assert paths == ['"odometry.odometry".linear', '"odometry.odometry".angular']
    live = viewer_layout(wires, topics, {"goal": "goal_pose", "velocity": "cmd_vel"})
    assert live["configById"]["Teleop!velocity"]["topic"] == "cmd_vel"
    assert live["configById"]["3D!scene"]["publish"]["poseTopic"] == "goal_pose"


def test_nothing_to_draw_has_no_layout():
    assert viewer_layout({"gate.wheels": Wheels}, {"log.lines": "Log"}) == {}


def test_a_model_without_configuration_has_the_world_only():
    scene = {"walls": [[0.0, 0.0, 1.0, 0.0]], "rounds": [], "sensors": [{"topic": "a.b"}]}
    model = viewer_model(None, scene)
    assert model == ViewerModel(walls=((0.0, 0.0, 1.0, 0.0),))


@pytest.fixture(scope="module")
def recording(tmp_path_factory):
    """A recorded run of the robot with a laser scanner."""
    path = tmp_path_factory.mktemp("scene") / "wander.mcap"
    options = RunOptions(fast=True, record=path, seed=3, duration=5.0)
    Run(load("wander", "turtlebot3_burger"), options).go()
    return path


def test_a_recording_holds_world_robot_trail_and_scan(recording):
    with recording.open("rb") as file:
        topics = {}
        for kind, channel, message in make_reader(file).iter_messages():
            if kind.name.startswith("foxglove."):
                Draft7Validator(json.loads(kind.data)).validate(json.loads(message.data))
                topics[channel.topic] = json.loads(message.data)
    assert len(topics["walls"]["entities"][0]["cubes"]) >= 4
    solids = {entity["id"] for entity in topics["robot"]["entities"]}
    assert {"base_link", "left_wheel_link", "right_wheel_link"} <= solids
    assert len(topics["trail"]["entities"][0]["lines"][0]["points"]) > 10
    (scan,) = (each for topic, each in topics.items() if topic.endswith(".scan"))
    assert len(scan["ranges"]) == 360
    assert scan["end_angle"] - scan["start_angle"] == pytest.approx(-2 * pi * 359 / 360)


def bag(*words):
    return invoke(program, "bag", *words)[1]


def test_a_recording_holds_robot_model_and_layout(recording):
    with recording.open("rb") as file:
        attached = {each.name: each.data for each in make_reader(file).iter_attachments()}
    assert set(attached) == {"robot.urdf", "layout.json"}
    links = {
        link.get("name") for link in ElementTree.fromstring(attached["robot.urdf"]).iter("link")
    }
    assert {"base_footprint", "base_link", "left_wheel_link"} <= links
    panels = json.loads(attached["layout.json"])["configById"]
    assert {"3D!scene", "Plot!speed", "RosOut!log"} <= set(panels)
    assert (
        json.loads(bag("export", recording, "--attachment", "layout.json"))["configById"] == panels
    )
    with pytest.raises(RunError, match=r"'notes\.txt' is not attached"):
        read_attachment(recording, "notes.txt")
    assert "attached   robot.urdf, layout.json" in bag("info", recording)
