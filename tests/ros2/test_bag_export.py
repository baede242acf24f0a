"""`bag export --format rosbag2`, read back by two readers that are not ours."""

import json
import sys
from math import cos, inf, pi, sin

import pytest
import yaml
from click.testing import CliRunner
from mcap.reader import make_reader
from mcap_ros2.decoder import DecoderFactory
from rosbags.rosbag2 import Reader
from rosbags.typesys import Stores, get_typestore

from diffbotctl.cli.main import program
from diffbotctl.config.load import load
from diffbotctl.errors import RunError, UsageError, UserError
from diffbotctl.messages import Battery, Imu, Odometry, Scan
from diffbotctl.recording.live_recording import LiveRecording, LiveTopic
from diffbotctl.recording.message_schema import json_schema
from diffbotctl.recording.reader import RecordedMessage, RecordingReader
from diffbotctl.ros2.bag_export import BagConverter, export_bag
from diffbotctl.ros2.bag_file import RosBag
from diffbotctl.ros2.conversion import SensorModel
from diffbotctl.ros2.options import RobotModel
from diffbotctl.runs.options import RunOptions
from diffbotctl.runs.run import Run
from diffbotctl.time import SECOND
from tests.support.ros2_nodes import TF_HASH

EPOCH = 1_700_000_000 * SECOND


@pytest.fixture(scope="module")
def recording(tmp_path_factory):
    path = tmp_path_factory.mktemp("recording") / "goal.mcap"
    Run(load("goal"), RunOptions(fast=True, record=path, seed=3)).go()
    return path


@pytest.fixture(scope="module")
def bag(recording, tmp_path_factory):
    folder = tmp_path_factory.mktemp("exported") / "drive"
    export_bag(recording, folder, None, False)
    return folder


def decoded(folder):
    """(topic, time of the record in ns, message) by the reader of the package mcap-ros2-support."""
    (path,) = folder.glob("*.mcap")
    with path.open("rb") as file:
        reader = make_reader(file, decoder_factories=[DecoderFactory()])
        return [
            (channel.topic, record.log_time, message)
            for _, channel, record, message in reader.iter_decoded_messages()
        ]


def stamp(header):
    return header.stamp.sec * SECOND + header.stamp.nanosec


def exported(*words):
    return CliRunner().invoke(
        program, ["bag", "export", *map(str, words)], standalone_mode=False, prog_name="diffbotctl"
    )


def test_every_odometry_is_there_with_its_time_and_covariance(recording, bag):
    reader = RecordingReader(recording)
    recorded = [item for item in reader.messages() if item.wire == "odometry.odometry"]
    epoch = int(reader.about["epoch"])
    found = [(time, message) for topic, time, message in decoded(bag) if topic == "/odom"]
    assert len(found) == len(recorded) > 100
    for (time, message), item in zip(found, recorded, strict=True):
        pose, own = message.pose.pose, item.message
        assert (time, stamp(message.header)) == (epoch + item.time, epoch + own.time)
        assert (pose.position.x, pose.position.y) == (own.x, own.y)
        assert pose.orientation.z == sin(own.heading / 2)
        assert pose.orientation.w == cos(own.heading / 2)
        assert (message.pose.covariance[1], message.pose.covariance[35]) == (
            own.covariance[1],
            max(own.covariance[5], 1e-6),
        )
        assert message.twist.twist.linear.x == own.linear
        assert (message.header.frame_id, message.child_frame_id) == ("odom", "base_footprint")


def test_wheels_velocity_ranges_and_log_are_those_of_the_run(recording, bag):
    recorded = {}
    for item in RecordingReader(recording).messages():
        recorded.setdefault(item.wire, []).append(item.message)
    found = {}
    for topic, _, message in decoded(bag):
        found.setdefault(topic, []).append(message)
    counts = [(each.left, each.right) for each in recorded["robot.encoders"]]
    turns = [tuple(each.position) for each in found["/joint_states"]]
    assert turns == [(2 * pi * left / 20, 2 * pi * right / 20) for left, right in counts]
    velocities = [(each.twist.linear.x, each.twist.angular.z) for each in found["/cmd_vel"]]
    assert velocities == [(each.linear, each.angular) for each in recorded["guard.twist"]]
    assert [each.msg for each in found["/rosout"]] == [each.text for each in recorded["log"]]
    ranges = {each.range for each in found["/range"]}
    assert ranges == {inf} and {each.state for each in recorded["range.range"]} == {"clear"}
    assert "<robot name=" in found["/robot_description"][0].data


def test_the_frames_are_one_tree_from_odom_to_the_sensor(bag):
    parents = {}
    for topic, _, message in decoded(bag):
        if topic in ("/tf", "/tf_static"):
            for each in message.transforms:
                parents.setdefault(each.child_frame_id, set()).add(each.header.frame_id)
    assert parents == {
        "base_footprint": {"odom"},
        "base_link": {"base_footprint"},
        "caster_link": {"base_link"},
        "front_sensor_link": {"base_link"},
        "left_wheel_link": {"base_link"},
        "right_wheel_link": {"base_link"},
    }


def test_another_library_opens_the_folder_with_types_hashes_and_delivery(bag):
    types = get_typestore(Stores.ROS2_KILTED)
    with Reader(bag) as reader:
        topics = {each.topic: each for each in reader.connections}
        messages = [
            types.deserialize_cdr(data, connection.msgtype)
            for connection, _, data in reader.messages()
        ]
    assert len(messages) == len(decoded(bag))
    assert topics["/tf"].digest == topics["/tf_static"].digest == TF_HASH
    about = yaml.safe_load((bag / "metadata.yaml").read_text())["rosbag2_bagfile_information"]
    profiles = {
        each["topic_metadata"]["name"]: each["topic_metadata"]["offered_qos_profiles"][0]
        for each in about["topics_with_message_count"]
    }
    assert profiles["/tf_static"]["durability"] == "transient_local"
    assert profiles["/range"]["reliability"] == "best_effort"
    assert profiles["/odom"]["reliability"] == "reliable"


def test_a_scan_and_a_battery_by_hand(tmp_path):
    sensors = {"robot.scan": SensorModel("scan_sensor_link", 0.12, 3.5)}
    kinds = {"robot.scan": "Scan", "robot.battery": "Battery"}
    converter = BagConverter(RobotModel(sensors=sensors), kinds, "")
    messages = {
        "robot.scan": Scan(2 * SECOND, 0.0, pi / 2, (1.0, inf, 0.0, 2.0), 0.2),
        "robot.battery": Battery(3 * SECOND, 7.4, True),
    }
    written = RosBag(tmp_path / "bag", ("diffbotctl", "test"))
    for wire, message in messages.items():
        item = RecordedMessage(message.time + 5, wire, True, message, b"", 1)
        for topic, fields in converter.messages(item, EPOCH):
            written.write(topic, EPOCH + item.time, fields)
    written.close()
    (_, time, scan), (_, _, battery), (_, _, diagnostics) = decoded(tmp_path / "bag")
    assert time == EPOCH + 2 * SECOND + 5
    assert stamp(scan.header) == EPOCH + 2 * SECOND - SECOND // 5  # of the first ray
    assert scan.time_increment == pytest.approx(0.05)
    assert list(scan.ranges) == [1.0, inf, 0.0, 2.0]
    assert scan.header.frame_id == "scan_sensor_link"
    assert scan.range_max == 3.5 and scan.angle_max == pytest.approx(1.5 * pi)
    assert battery.voltage == pytest.approx(7.4) and battery.present
    (status,) = diagnostics.status
    assert (status.level, status.message) == (1, "low")


def test_an_imu_by_hand(tmp_path):
    converter = BagConverter(RobotModel(), {"odometry.imu": "Imu"}, "")
    message = Imu(2 * SECOND, "working", 0.5, 0.1, 0.001, True)
    item = RecordedMessage(message.time, "odometry.imu", True, message, b"", 1)
    written = RosBag(tmp_path / "bag", ("diffbotctl", "test"))
    for topic, fields in converter.messages(item, EPOCH):
        written.write(topic, EPOCH + item.time, fields)
    written.close()
    (topic, _, imu), _ = decoded(tmp_path / "bag")
    assert (topic, imu.header.frame_id, stamp(imu.header)) == (
        "/imu",
        "base_link",
        EPOCH + 2 * SECOND,
    )
    assert imu.angular_velocity.z == 0.5
    assert imu.orientation_covariance[0] == imu.linear_acceleration_covariance[0] == -1.0


def test_the_command_lists_topics_and_what_it_leaves_out(recording, tmp_path):
    result = exported(recording, "--format", "rosbag2", "--output", tmp_path / "drive")
    assert result.exception is None, result.exception
    lines = dict(line.rsplit(maxsplit=1) for line in result.stdout.splitlines())
    assert int(lines["/odom"]) > 100 and lines["/tf_static"] == "1"
    assert "without a ROS topic: " in result.stderr and "gate.wheels" in result.stderr
    assert "operator.call" not in result.stderr  # it has no messages
    again = exported(recording, "--format", "rosbag2", "--output", tmp_path / "drive")
    assert again.exception is None  # its own bag is replaced
    assert sorted(path.name for path in tmp_path.iterdir()) == ["drive"]


def test_a_folder_of_somebody_else_is_kept(recording, bag, tmp_path):
    words = (recording, "--format", "rosbag2", "--output")
    mine = tmp_path / "mine"
    mine.mkdir()
    (mine / "letter.txt").write_text("mine")
    assert "E-OUTPUT" in str(exported(*words, mine, "--force").exception)
    assert (mine / "letter.txt").read_text() == "mine"
    foreign = tmp_path / "foreign"
    foreign.mkdir()
    about = {"rosbag2_bagfile_information": {"version": 9, "custom_data": None}}
    (foreign / "metadata.yaml").write_text(yaml.safe_dump(about))
    assert "did not write it" in str(exported(*words, foreign).exception)
    (foreign / "notes.txt").write_text("mine")
    assert "also holds notes.txt" in str(exported(*words, foreign, "--force").exception)
    (foreign / "notes.txt").unlink()
    assert exported(*words, foreign, "--force").exception is None
    missing = exported(*words, tmp_path / "nowhere" / "bag").exception
    assert isinstance(missing, RunError) and "E-OUTPUT" in str(missing)


def test_wrong_words_and_a_missing_library_are_named(recording, tmp_path, monkeypatch):
    words = (recording, "--format", "rosbag2")
    assert "name it with --output" in exported(*words).exception.format_message()
    both = exported(recording, "odometry.odometry", *words[1:], "--output", tmp_path / "x")
    assert "leave out FIELD" in both.exception.format_message()
    for module in ("diffbotctl.ros2.bag_export", "diffbotctl.ros2.bag_file", "rosbags.interfaces"):
        monkeypatch.delitem(sys.modules, module, raising=False)
    monkeypatch.setitem(sys.modules, "rosbags", None)
    error = exported(*words, "--output", tmp_path / "x").exception
    assert isinstance(error, UsageError) and "pip install 'diffbotctl[ros2]'" in str(error)


def test_a_recording_of_a_running_engine_needs_the_robot_file_for_frames(tmp_path):
    file = tmp_path / "part.mcap"
    about = {"version": "0", "epoch": str(EPOCH), "pipeline": "p", "robot": "", "port": "sim"}
    topics = [LiveTopic("odometry.odometry", "Odometry", json_schema(Odometry))]
    recording = LiveRecording(file, about, topics)
    message = Odometry(SECOND, 1.0, 2.0, 0.5, 0.1, 0.2, (1.0,) * 6)
    recording.write("odometry.odometry", json.loads(json.dumps(message._asdict())))
    recording.end("test")
    recording.close()
    plain = export_bag(file, tmp_path / "plain", None, False)
    assert plain.counts == {"/odom": 1, "/tf": 1} and "--robot" in plain.complaint
    whole = export_bag(file, tmp_path / "whole", "book_2wd", False)
    assert whole.counts["/tf_static"] == 1 and not whole.complaint
    with pytest.raises(UserError) as error:
        export_bag(file, tmp_path / "none", "nowhere.yaml", False)
    assert "nowhere.yaml" in str(error.value) and not (tmp_path / "none").exists()
