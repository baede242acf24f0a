"""The robot as the bridge needs it, from its file: URDF, frames, encoders, figures of sensors."""

from __future__ import annotations

from pathlib import Path
from typing import Literal

from diffbotctl.config.configuration import Configuration
from diffbotctl.config.load import load, load_robot
from diffbotctl.config.node_ports import SENSOR_MESSAGES
from diffbotctl.config.robot import Robot, SensorSection
from diffbotctl.control_socket.protocol import Fields
from diffbotctl.errors import UserError
from diffbotctl.geometry.distance_sensors import EchoFacts, sensor_facts
from diffbotctl.geometry.lidars import LIDARS
from diffbotctl.messages import Range, Scan
from diffbotctl.model.frames import robot_frames
from diffbotctl.model.urdf import urdf
from diffbotctl.ros2.conversion import SensorModel
from diffbotctl.ros2.options import ModelFrame, RobotModel

SHARP_FIELD_OF_VIEW = 0.1  # rad: its spot is some 4 cm wide at 40 cm (data sheet GP2Y0A41SK0F)
ECHO_FIELD_OF_VIEW = 0.26  # rad: 15 degrees (data sheet HC-SR04)


def model_of_run(status: Fields, robot: str | None) -> tuple[RobotModel, str]:
    """The model of the robot of a run, from the reply to `status`, and what failed.

    `robot` names another robot file than that of the run. The files may be missing, as on another
    computer: then there is no description, and the text states that.
    """
    try:
        if robot is None and status["robot"]:
            return model_of(configuration_of_run(status)), ""
        file = load_robot(robot)
        return model_of_robot(file.robot, file.file.stem), ""
    except UserError as error:
        problem = error.problems[0]
        return RobotModel(), f"no robot description: {problem.file}: {problem.cause}"


def configuration_of_run(status: Fields) -> Configuration:
    """The files of a run, from the reply to `status`. Raises UserError, as on another computer."""
    return load(str(run_file(status, "pipeline")), str(run_file(status, "robot")))


def run_file(status: Fields, kind: Literal["pipeline", "robot"]) -> Path:
    """A file of a run, from the reply to `status`; its relative paths begin in its own folder."""
    return Path(f"/proc/{status['pid']}/cwd") / str(status[kind])


def urdf_of_run(status: Fields) -> str:
    """The URDF of a run's robot, empty without one. Raises UserError as `configuration_of_run`."""
    return model_of(configuration_of_run(status)).urdf if status["robot"] else ""


def model_of(configuration: Configuration) -> RobotModel:
    """The model of a pipeline's robot, with the wires of its sensors."""
    robot = configuration.robot
    if robot is None:
        return RobotModel()
    wires = configuration.sensor_wires()
    sensors = {wire: _sensor_model(name, robot.sensors[name]) for wire, name in wires.items()}
    name = configuration.robot_file.stem if configuration.robot_file else configuration.name
    return model_of_robot(robot, name)._replace(sensors=sensors)


def model_of_robot(robot: Robot, name: str) -> RobotModel:
    """The model of a robot alone, with the wires of sensors that it drives itself."""
    left, right = (side.encoder.counts for side in (robot.drive.left, robot.drive.right))
    return RobotModel(
        urdf(robot, name),
        tuple(ModelFrame(*frame) for frame in robot_frames(robot)),
        (float(left), float(right)),
        {
            f"robot.{each}": _sensor_model(each, sensor)
            for each, sensor in robot.sensors.items()
            if SENSOR_MESSAGES[sensor.type] in (Range, Scan)
        },
    )


def _sensor_model(name: str, sensor: SensorSection) -> SensorModel:
    scanner = LIDARS.get(sensor.type)
    if scanner is not None:
        return SensorModel(f"{name}_sensor_link", scanner.near, scanner.reach, 0.0)
    facts = sensor_facts(sensor.type, sensor.near, sensor.reach)
    field = ECHO_FIELD_OF_VIEW if isinstance(facts, EchoFacts) else SHARP_FIELD_OF_VIEW
    return SensorModel(f"{name}_sensor_link", facts.near, facts.reach, field)
