"""A recording as a rosbag2 folder: the topics that the bridge publishes, and the velocity."""

from __future__ import annotations

import os
import shutil
import tempfile
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import NamedTuple

import yaml

import diffbotctl
from diffbotctl.blocks.diff_drive import DiffDrive
from diffbotctl.config.configuration import Configuration
from diffbotctl.config.load import load_robot
from diffbotctl.errors import Problem, RunError, UsageError, UserError
from diffbotctl.recording.reader import RecordedMessage, RecordingReader, recording_info
from diffbotctl.recording.run_metadata import LIVE
from diffbotctl.replay.recorded_run import read_run, recorded_configuration
from diffbotctl.ros2 import conversion
from diffbotctl.ros2.bag_file import RosBag
from diffbotctl.ros2.conversion import DiagnosticEntry, Fields, SensorModel
from diffbotctl.ros2.options import ModelFrame, RobotModel
from diffbotctl.ros2.robot_model import model_of, model_of_robot
from diffbotctl.ros2.stamps import seconds_and_nanoseconds
from diffbotctl.ros2.topics import (
    BASE,
    DESCRIPTION,
    DIAGNOSTICS,
    FIXED_TRANSFORMS,
    MAP,
    TRANSFORMS,
    WORLD,
    Diagnosis,
    MapGrid,
    RosTopic,
    choose_topics,
    fixed_frames,
    frame_transform,
    robot_frame,
    wheel_joint,
    wheel_rotation,
    wheels,
)

MARK = "diffbotctl"  # key in the metadata of a bag that we wrote
METADATA = "metadata.yaml"
BAG_SUFFIXES = (".yaml", ".mcap", ".db3")  # of the files of a bag
VELOCITY = RosTopic("cmd_vel", "geometry_msgs/msg/TwistStamped")

RosMessage = tuple[RosTopic, Fields]
Convert = Callable[[Fields, int], list[RosMessage]]


class ExportResult(NamedTuple):
    """Number of messages by topic, the wires whose messages were left out, and what is missing."""

    counts: dict[str, int]
    omitted: tuple[str, ...]
    complaint: str


def export_bag(source: Path, target: Path, robot: str | None, force: bool) -> ExportResult:
    """Write the recording `source` as the new folder `target`.

    `robot` names a robot file in place of the recorded one. A bag that diffbotctl wrote is
    replaced, another one with `force`. Raises UserError.
    """
    _check_target(target, force)
    _check_one_robot(source)
    model, velocity, complaint = _recorded_model(source, robot)
    try:
        # Beside the target, so that it can be moved there when it is complete.
        with tempfile.TemporaryDirectory(prefix=".rosbag2-", dir=target.parent) as draft:
            folder = Path(draft) / target.name
            counts, omitted = _write_bag(source, folder, model, velocity)
            if target.exists():
                shutil.rmtree(target)
            os.replace(folder, target)
    except OSError as error:
        cause = f"cannot write the folder: {error.strerror}"
        raise RunError(Problem("E-OUTPUT", str(target), cause, "choose another name")) from error
    return ExportResult(counts, omitted, complaint)


def _check_target(target: Path, force: bool) -> None:
    """Raises UsageError for a folder that must not be replaced."""
    if not target.exists() or (target.is_dir() and not any(target.iterdir())):
        return
    try:
        about = yaml.safe_load((target / METADATA).read_text())["rosbag2_bagfile_information"]
        is_ours = MARK in (about.get("custom_data") or {})
    except (OSError, ValueError, KeyError, TypeError, AttributeError, yaml.YAMLError):
        cause, fix = "it exists already and is no rosbag2", "choose another name"
        raise UsageError(Problem("E-OUTPUT", str(target), cause, fix)) from None
    others = [file.name for file in target.iterdir() if file.suffix not in BAG_SUFFIXES]
    if others:
        cause, fix = f"the folder also holds {others[0]}", "choose another name"
        raise UsageError(Problem("E-OUTPUT", str(target), cause, fix))
    if not is_ours and not force:
        cause = "the rosbag2 exists already, and diffbotctl did not write it"
        fix = "choose another name, or add --force to overwrite it"
        raise UsageError(Problem("E-OUTPUT", str(target), cause, fix))


def _check_one_robot(source: Path) -> None:
    """Raises UsageError for a recording of several robots: its topics would be those of all."""
    if "robots" in recording_info(source).about:
        cause = "it is a recording of several robots, and these topics are those of one"
        fix = "record one robot with `bag record --engine NAME`, and export that"
        raise UsageError(Problem("E-SEVERAL-ROBOTS", str(source), cause, fix))


def _recorded_model(source: Path, robot: str | None) -> tuple[RobotModel, str, str]:
    """The robot's model, the wire of its velocity, and why they are missing."""
    about = recording_info(source).about
    try:
        if robot is not None:
            file = load_robot(robot)
            return model_of_robot(file.robot, file.file.stem), "", ""
        if LIVE in about:
            return RobotModel(), "", "`bag record` does not keep the robot file: add --robot FILE"
        with recorded_configuration(source, read_run(source).about) as configuration:
            return model_of(configuration), _velocity_wire(configuration), ""
    except UserError as error:
        if robot is not None:
            raise
        problem = error.problems[0]
        return RobotModel(), "", f"no robot model: {problem.file}: {problem.cause}"


def _velocity_wire(configuration: Configuration) -> str:
    """The wire with the velocity that the wheels get; empty where there is none."""
    wires = (use.wires["twist"] for use in configuration.blocks if use.cls is DiffDrive)
    return next(wires, "")


def _write_bag(
    source: Path, folder: Path, model: RobotModel, velocity: str
) -> tuple[dict[str, int], tuple[str, ...]]:
    info = recording_info(source)
    kinds = {topic.name: topic.kind for topic in info.topics if topic.origin != "viewer"}
    epoch = int(info.about["epoch"])
    converter = BagConverter(model, kinds, velocity)
    bag = RosBag(folder, (MARK, diffbotctl.__version__))
    try:
        for topic, fields in converter.fixed(epoch + info.begins):
            bag.write(topic, epoch + info.begins, fields)
        for item in RecordingReader(source).messages():
            for topic, fields in converter.messages(item, epoch):
                bag.write(topic, epoch + item.time, fields)
    except BaseException:
        bag.abort()
        raise
    bag.close()
    written = {topic.name for topic in info.topics if topic.messages}
    return bag.counts, tuple(
        wire for wire in kinds if wire in written and not converter.knows(wire)
    )


class BagConverter:
    """Makes ROS messages, as (topic, fields), of the messages of a run."""

    def __init__(self, model: RobotModel, kinds: dict[str, str], velocity: str) -> None:
        self.model = model
        self.diagnosis = Diagnosis(kinds)
        makers: dict[str, Callable[[str, RosTopic], Convert]] = {
            "nav_msgs/msg/Odometry": self._odometry,
            "sensor_msgs/msg/JointState": self._joint_states,
            "sensor_msgs/msg/BatteryState": self._battery,
            "sensor_msgs/msg/Imu": self._imu,
            "sensor_msgs/msg/Range": self._sensor,
            "sensor_msgs/msg/LaserScan": self._sensor,
            "rcl_interfaces/msg/Log": self._log,
            "nav_msgs/msg/OccupancyGrid": self._map,
            "geometry_msgs/msg/PoseWithCovarianceStamped": self._map_pose,
        }
        self.converts = {
            wire: makers[topic.type](wire, topic) for wire, topic in choose_topics(kinds).items()
        }
        if velocity in kinds:
            self.converts[velocity] = _velocity

    def knows(self, wire: str) -> bool:
        return wire in self.converts or wire in self.diagnosis.kinds

    def fixed(self, stamp: int) -> list[RosMessage]:
        """Description and fixed frames of the robot."""
        if not self.model.urdf:
            return []
        frames = [_stamped(frame, stamp) for frame in fixed_frames(self.model.frames)]
        return [
            (DESCRIPTION, {"data": self.model.urdf}),
            (FIXED_TRANSFORMS, {"transforms": frames}),
        ]

    def messages(self, item: RecordedMessage, epoch: int) -> Iterator[RosMessage]:
        if not self.knows(item.wire):
            return
        fields = item.message._asdict()
        if item.wire in self.converts:
            yield from self.converts[item.wire](fields, epoch + item.message.time)
        entries = self.diagnosis.message_received(item.wire, fields, item.time)
        if entries:
            status = [_status(entry) for entry in entries]
            yield DIAGNOSTICS, {**_header(epoch + item.time, ""), "status": status}

    def _odometry(self, wire: str, topic: RosTopic) -> Convert:
        child = {"child_frame_id": robot_frame(self.model.frames)}

        def convert(fields: Fields, stamp: int) -> list[RosMessage]:
            begin = {**_header(stamp, WORLD), **child}
            moved = {**begin, "transform": conversion.transform(fields)}
            return [
                (topic, {**begin, **conversion.odometry(fields)}),
                (TRANSFORMS, {"transforms": [moved]}),
            ]

        return convert

    def _joint_states(self, wire: str, topic: RosTopic) -> Convert:
        turning = wheels(self.model.frames)
        names = [wheel_joint(frame.name) for frame in turning]

        def convert(fields: Fields, stamp: int) -> list[RosMessage]:
            if not turning:
                return []
            angles = conversion.wheel_angles(fields, self.model.counts_per_turn)
            moved = [_stamped(frame, stamp) for frame in turning]
            for transform, angle in zip(moved, angles, strict=True):
                transform["transform"]["rotation"] = wheel_rotation(angle)
            return [
                (topic, {**_header(stamp, ""), "name": names, "position": angles}),
                (TRANSFORMS, {"transforms": moved}),
            ]

        return convert

    def _sensor(self, wire: str, topic: RosTopic) -> Convert:
        sensor = self.model.sensors.get(wire, SensorModel(BASE, 0.0, 0.0))
        is_scan = topic.type == "sensor_msgs/msg/LaserScan"
        make = conversion.scan if is_scan else conversion.range_fields
        return lambda fields, stamp: [
            (
                topic,
                {
                    **_header(stamp - conversion.scan_age(fields), sensor.frame),
                    **make(fields, sensor),
                },
            )
        ]

    def _battery(self, wire: str, topic: RosTopic) -> Convert:
        return lambda fields, stamp: [(topic, {**_header(stamp, ""), **conversion.battery(fields)})]

    def _imu(self, wire: str, topic: RosTopic) -> Convert:
        return lambda fields, stamp: [(topic, {**_header(stamp, BASE), **conversion.imu(fields)})]

    def _map(self, wire: str, topic: RosTopic) -> Convert:
        collected = MapGrid()

        def convert(fields: Fields, stamp: int) -> list[RosMessage]:
            grid = collected.take(fields)
            return [] if grid is None else [(topic, {**_header(stamp, MAP), **grid})]

        return convert

    def _map_pose(self, wire: str, topic: RosTopic) -> Convert:
        def convert(fields: Fields, stamp: int) -> list[RosMessage]:
            header = _header(stamp, MAP)
            moved = {"transform": conversion.map_transform(fields), "child_frame_id": WORLD}
            return [
                (topic, {**header, **conversion.map_pose(fields)}),
                (TRANSFORMS, {"transforms": [{**header, **moved}]}),
            ]

        return convert

    def _log(self, wire: str, topic: RosTopic) -> Convert:
        return lambda fields, stamp: [
            (topic, {"stamp": _time(stamp), **conversion.log_line(fields)})
        ]


def _velocity(fields: Fields, stamp: int) -> list[RosMessage]:
    return [(VELOCITY, {**_header(stamp, BASE), "twist": conversion.twist(fields)})]


def _stamped(frame: ModelFrame, stamp: int) -> Fields:
    """geometry_msgs/TransformStamped of a frame of the robot."""
    header = _header(stamp, frame.parent)
    return {**header, "child_frame_id": frame.name, "transform": frame_transform(frame)}


def _status(entry: DiagnosticEntry) -> Fields:
    """diagnostic_msgs/DiagnosticStatus."""
    values = [{"key": key, "value": value} for key, value in entry.values.items()]
    level = entry.level[0]
    return {"level": level, "name": entry.name, "message": entry.message, "values": values}


def _header(stamp: int, frame: str) -> Fields:
    return {"header": {"stamp": _time(stamp), "frame_id": frame}}


def _time(stamp: int) -> Fields:
    seconds, nanoseconds = seconds_and_nanoseconds(stamp)
    return {"sec": seconds, "nanosec": nanoseconds}
