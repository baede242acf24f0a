"""The bridge against nodes of rclpy in processes of their own, which know nothing of diffbotctl."""

import json
import re
from math import atan2, cos, pi, sin
from pathlib import Path

import pytest

from diffbotctl.time import SECOND
from tests.support.ros2_nodes import (
    COMMANDED_NODE,
    TF_HASH,
    TWIST,
    bridge,
    ros_node,
    ros_python,
)
from tests.support.running import PlainClient, cli, moves, running, stands

pytestmark = pytest.mark.skipif(
    ros_python() is None,
    reason="no rclpy here: `make ros2` installs it where its wheels exist (x86-64)",
)
YEAR = 365 * 24 * 3600 * SECOND
PROGRAMS = Path(__file__).parent / "programs"
# Topic, type, quality of service of the subscriber.
OUTPUTS = [
    ("/odom", "nav_msgs/msg/Odometry", ""),
    ("/tf", "tf2_msgs/msg/TFMessage", ""),
    ("/tf_static", "tf2_msgs/msg/TFMessage", "latched"),
    ("/range", "sensor_msgs/msg/Range", "sensor"),
    ("/joint_states", "sensor_msgs/msg/JointState", ""),
    ("/diagnostics", "diagnostic_msgs/msg/DiagnosticArray", ""),
    ("/robot_description", "std_msgs/msg/String", "latched"),
]


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """A run with its bridge."""
    runtime = tmp_path_factory.mktemp("ros2")
    with running(runtime, "standby", "--stay"), bridge(runtime, "--drive"):
        yield runtime


@pytest.fixture
def client(folder):
    client = PlainClient(folder)
    yield client
    client.request("resume")
    client.close()


def publish(node, linear, angular=0.0, **options):
    fields = {"linear": {"x": linear}, "angular": {"z": angular}}
    node.command(publish="/cmd_vel", type=TWIST, fields=fields, **options)
    node.reply("published")


def held(code):
    return lambda status: status["held"] is not None and status["held"]["code"] == code


def free(status):
    return status["held"] is None and stands(status)


def test_the_messages_of_a_run_are_seen_by_another_node(folder):
    with ros_node(folder, COMMANDED_NODE, "watcher") as node:
        for topic, kind, profile in OUTPUTS:
            node.command(watch=topic, type=kind, qos=profile)
        seen = {topic: node_reply(node, topic) for topic, _, _ in OUTPUTS}
        node.command(hash="/tf")
        assert node.reply("hash") == [TF_HASH]
    assert seen["/odom"]["header"]["frame_id"] == "odom"
    assert len(seen["/odom"]["pose"]["covariance"]) == 36
    assert seen["/range"]["range"] == "inf" and seen["/range"]["header"]["frame_id"] == (
        "front_sensor_link"
    )
    assert seen["/joint_states"]["name"] == ["left_wheel_joint", "right_wheel_joint"]
    assert "<robot name=" in seen["/robot_description"]["data"]
    frames = {each["child_frame_id"] for each in seen["/tf_static"]["transforms"]}
    assert frames == {"base_link", "caster_link", "front_sensor_link"}
    assert seen["/diagnostics"]["status"][0]["hardware_id"] == "test"


def node_reply(node, topic):
    """A message of a topic; a latched one may have been read already."""
    printed = [line for line in list(node.printed) if line.startswith(f'{{"{topic}"')]
    return json.loads(printed[0])[topic] if printed else node.reply(topic)


ROBOT_WITH_IMU = """format: 1
kind: robot
include: book_2wd
board: {telemetry: 30 Hz}
imu: {type: mpu6050, axes: z}
battery: {pin: A1, divider: 3, full: 8.4 V}
"""


def test_an_imu_and_a_battery_are_seen(tmp_path):
    robot = tmp_path / "robot.yaml"
    robot.write_text(ROBOT_WITH_IMU)
    with (
        running(tmp_path, "standby", "--stay", "--robot", str(robot)),
        bridge(tmp_path, "--drive"),
        ros_node(tmp_path, COMMANDED_NODE, "watcher") as node,
    ):
        node.command(watch="/imu", type="sensor_msgs/msg/Imu", qos="sensor")
        still = node.reply("/imu", lambda imu: imu["angular_velocity_covariance"][0] != -1.0)
        assert still["header"]["frame_id"] == "base_link"
        assert still["orientation_covariance"][0] == -1.0
        publish(node, 0.0, 0.5, rate=20)
        node.reply("/imu", lambda imu: imu["angular_velocity"]["z"] > 0.3)
        publish(node, 0.0)
        node.command(watch="/battery_state", type="sensor_msgs/msg/BatteryState")
        assert 5.0 < node.reply("/battery_state")["voltage"] < 9.0


def test_a_scan_and_the_log_are_seen(tmp_path):
    with (
        running(tmp_path, "wander"),
        bridge(tmp_path),
        ros_node(tmp_path, COMMANDED_NODE, "watcher") as node,
    ):
        node.command(watch="/scan", type="sensor_msgs/msg/LaserScan", qos="sensor")
        scan = node.reply("/scan")
        assert len(scan["ranges"]) == 360 and scan["header"]["frame_id"] == "scan_sensor_link"
        node.command(watch="/rosout", type="rcl_interfaces/msg/Log", qos="latched")
        node.reply("/rosout", lambda line: line.get("name", "").startswith("diffbotctl."))


def test_the_map_and_its_frames_are_seen_by_a_node_that_comes_later(tmp_path):
    words = ("--stay", "--set", "map.autosave=false")
    with (
        running(tmp_path, "map", *words, sets=()),
        bridge(tmp_path, "--drive"),
        ros_node(tmp_path, COMMANDED_NODE, "first") as first,
    ):
        first.command(watch="/map", type="nav_msgs/msg/OccupancyGrid", qos="latched")
        begun = first.reply("/map", lambda grid: grid["data"].count(100) > 50)
        # The robot stands, so the map does not change: a later node gets it because it is latched.
        with ros_node(tmp_path, COMMANDED_NODE, "second") as node:
            node.command(watch="/map", type="nav_msgs/msg/OccupancyGrid", qos="latched")
            grid = node.reply("/map")
            assert grid["info"] == begun["info"] and grid["header"]["frame_id"] == "map"
            assert len(grid["data"]) == grid["info"]["width"] * grid["info"]["height"]
            assert set(grid["data"]) == {-1, 0, 100}
            node.command(watch="/tf", type="tf2_msgs/msg/TFMessage")
            kind = "geometry_msgs/msg/PoseWithCovarianceStamped"
            node.command(watch="/pose", type=kind)
            pose = {"position": {"x": 0.5, "y": -0.25}, "orientation": {"z": 1.0, "w": 1.0}}
            fields = {"header": {"frame_id": "map"}, "pose": {"pose": pose}}
            node.command(publish="/initialpose", type=kind, fields=fields)
            # What fits within the reach of a click is taken, or else the place that was stated.
            placed = node.reply("/pose", lambda message: abs(turn_of(message["pose"]["pose"])) > 1)
            assert placed["header"]["frame_id"] == "map"
            moved = node.reply("/tf", lambda message: edge(message) == ("map", "odom"))
            drawn = node.reply("/tf", lambda message: edge(message) == ("odom", "base_footprint"))
            in_map, in_odom = (each["transforms"][0]["transform"] for each in (moved, drawn))
            turn = turn_of({"orientation": in_map["rotation"]})
            assert abs(turn) > 1
            x, y = in_odom["translation"]["x"], in_odom["translation"]["y"]
            for name, place in (
                ("x", cos(turn) * x - sin(turn) * y + in_map["translation"]["x"]),
                ("y", sin(turn) * x + cos(turn) * y + in_map["translation"]["y"]),
            ):
                assert placed["pose"]["pose"]["position"][name] == pytest.approx(place, abs=0.02)


def edge(message):
    """Parent and child of the first transform."""
    transform = message["transforms"][0]
    return transform["header"]["frame_id"], transform["child_frame_id"]


def turn_of(pose):
    return 2 * atan2(pose["orientation"]["z"], pose["orientation"]["w"])


def test_a_node_with_simulated_time_follows_the_clock_of_an_unpaced_run(tmp_path):
    with running(tmp_path, "square", "--fast", "--stay"), bridge(tmp_path):
        with ros_node(tmp_path, PROGRAMS / "clock_reader.py") as node:
            stamp, now = node.reply("stamp_and_now", lambda times: times[1] > SECOND)
            later = node.reply("stamp_and_now", lambda times: times[1] > now + 10 * SECOND)
        # The time of the run, not of the day: that is more than fifty years.
        assert 0 < stamp < later[0] < YEAR and now < later[1] < YEAR


def test_an_unpaced_run_is_not_driven(tmp_path):
    with running(tmp_path, "square", "--fast", "--stay"):
        words = ("--python", ros_python(), "--drive")
        code, _, complaint = cli(tmp_path, "ros2", "--engine", "test", *words)
        assert code == 1 and "start the run without --fast" in complaint


def test_a_velocity_beyond_the_limits_drives_on_its_arc_within_them(folder, client):
    with ros_node(folder, COMMANDED_NODE, "teleop") as node:
        publish(node, 0.6, 1.0, rate=20)
        client.until(moves)
        node.command(watch="/odom", type="nav_msgs/msg/Odometry")
        node.reply("/odom", lambda m: m["twist"]["twist"]["linear"]["x"] > 0.25)
        twist = client.request("snapshot")["messages"]["operator.twist"]
        assert (twist["linear"], twist["angular"]) == pytest.approx((0.3, 0.5))
        publish(node, 0.0)
        client.until(free)


def test_silence_stops_and_a_zero_of_the_same_publisher_allows_motion_again(folder, client):
    with ros_node(folder, COMMANDED_NODE, "teleop") as node:
        publish(node, 0.2)
        status = client.until(held("operator_lost"))
        # The name of a node may become known later than its first velocity.
        assert re.search(r"(/teleop|cmd_vel) was silent for 0.3 s", status["held"]["cause"])
        client.until(stands)
        publish(node, 0.2)
        assert client.request("status")["held"] is not None
        publish(node, 0.0)
        client.until(free)
        publish(node, 0.2, rate=20)
        client.until(moves)
        publish(node, 0.0)
        client.until(free)


def test_a_publisher_that_ends_while_the_robot_moves_needs_resume(folder, client):
    with ros_node(folder, COMMANDED_NODE, "teleop") as node:
        publish(node, 0.2, rate=20)
        client.until(moves)
    client.until(held("operator_lost"))
    client.until(stands)
    with ros_node(folder, COMMANDED_NODE, "other") as node:
        publish(node, 0.0)
        publish(node, 0.2)
        assert client.request("status")["held"] is not None
        node.command(call="/resume")
        assert node.reply("called")["success"]
        client.until(lambda status: status["held"] is None)
        publish(node, 0.2, rate=20)
        client.until(moves)
        publish(node, 0.0)
        client.until(free)


def test_nan_stops_until_resume_and_the_service_stop_stops(folder, client):
    with ros_node(folder, COMMANDED_NODE, "teleop") as node:
        publish(node, 0.2, rate=20)
        client.until(moves)
        publish(node, float("nan"))
        status = client.until(held("operator_stop"))
        assert "not a finite number" in status["held"]["cause"]
        assert cli(folder, "resume")[0] == 0
        client.until(free)
        node.command(call="/stop")
        assert node.reply("called")["success"]
        assert "service stop" in client.until(held("operator_stop"))["held"]["cause"]


def test_a_goal_a_pose_a_parameter_and_reset(folder, client):
    with ros_node(folder, COMMANDED_NODE, "person") as node:
        node.command(set="guard.margin", value=0.08)
        assert node.reply("was_set")["successful"]
        node.command(set="guard.margin", value=-5.0)
        assert not node.reply("was_set")["successful"]
        pose = {"position": {"x": 1.5, "y": -0.5}, "orientation": {"z": 1.0, "w": 1.0}}
        node.command(
            publish="/initialpose",
            type="geometry_msgs/msg/PoseWithCovarianceStamped",
            fields={"pose": {"pose": pose}},
        )
        node.command(watch="/odom", type="nav_msgs/msg/Odometry")
        node.reply("/odom", lambda m: abs(m["pose"]["pose"]["position"]["x"] - 1.5) < 1e-6)
        newest = client.request("snapshot")["messages"]["odometry.odometry"]
        assert newest["heading"] == pytest.approx(pi / 2)
        node.command(call="/reset")
        assert node.reply("called")["success"]
        node.reply("/odom", lambda m: abs(m["pose"]["pose"]["position"]["x"]) < 1e-6)
        goal = {"header": {"frame_id": "odom"}, "pose": {"position": {"x": 0.3}}}
        node.command(publish="/goal_pose", type="geometry_msgs/msg/PoseStamped", fields=goal)
        end = client.until(lambda status: (status["goal_state"] or {}).get("state") == "reached")
        assert end["operator.goal"]["x"] == pytest.approx(0.3)


def test_a_bridge_that_is_killed_while_the_robot_moves_stops_it(tmp_path):
    with running(tmp_path, "standby", "--stay"):
        client = PlainClient(tmp_path)
        with (
            bridge(tmp_path, "--drive") as process,
            ros_node(tmp_path, COMMANDED_NODE, "teleop") as node,
        ):
            publish(node, 0.2, rate=20)
            client.until(moves)
            process.process.kill()
            status = client.until(held("operator_lost"))
            assert "ros2 bridge" in status["held"]["cause"]
            client.until(stands)


def test_a_keyboard_teleop_that_publishes_on_key_presses_only(tmp_path):
    with running(tmp_path, "standby", "--stay"), bridge(tmp_path, "--drive"):
        client = PlainClient(tmp_path)
        with ros_node(tmp_path, PROGRAMS / "keyboard_teleop.py") as teleop:
            teleop.send("i")
            client.until(moves)
            client.until(held("operator_lost"))
            teleop.send("k")
            client.until(free)
            teleop.send("j")
            client.until(moves)
            teleop.send("k")
            client.until(free)


def test_a_square_driver_for_turtlesim_leaves_no_stop(folder, client):
    remapping = ["--ros-args", "-r", "turtle1/cmd_vel:=cmd_vel"]
    with ros_node(folder, PROGRAMS / "square_driver.py", *remapping) as driver:
        driver.reply("done")
        client.until(free)
        driver.process.wait()
        assert client.request("status")["held"] is None


def test_a_navigator_with_stamped_velocities_that_falls_silent_at_its_goal(folder, client):
    assert cli(folder, "call", "odometry.set_pose")[0] == 0
    with ros_node(folder, PROGRAMS / "navigator.py") as navigator:
        navigator.reply("done")
        status = client.until(free)
        position = client.request("snapshot")["messages"]["odometry.odometry"]
        assert position["x"] == pytest.approx(0.3, abs=0.05)
        assert status["held"] is None
