"""What viewers draw of a run besides its messages: the robot's frames and solids, the world."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, NamedTuple

from diffbotctl.config.configuration import Configuration
from diffbotctl.model.frames import RobotFrame, Solid, robot_frames, robot_solids
from diffbotctl.model.urdf import urdf

Numbers = tuple[float, ...]


class ViewerModel(NamedTuple):
    """The robot and the world, in m and rad. Without a robot file only the world is there.

    `walls` are (x1, y1, x2, y2) and `rounds` (x, y, radius), in the frame odom. `sensors` maps the
    wire of distances to the frame of the sensor.
    """

    frames: tuple[RobotFrame, ...] = ()
    solids: tuple[Solid, ...] = ()
    urdf: str = ""
    walls: tuple[Numbers, ...] = ()
    rounds: tuple[Numbers, ...] = ()
    sensors: Mapping[str, str] = {}


def viewer_model(configuration: Configuration | None, scene: Mapping[str, Any]) -> ViewerModel:
    """The model of a run from its configuration, and from the scene that all screens draw.

    Without a configuration, as on another computer, there is no robot in it.
    """
    world = ViewerModel(
        walls=tuple(tuple(wall) for wall in scene["walls"]),
        rounds=tuple(tuple(each) for each in scene["rounds"]),
    )
    if configuration is None or configuration.robot is None:
        return world
    robot, file = configuration.robot, configuration.robot_file
    frames = tuple(robot_frames(robot))
    known = {frame.name for frame in frames}
    sensors = {each["topic"]: each["frame"] for each in scene["sensors"] if each["frame"] in known}
    name = configuration.name if file is None else file.stem
    return world._replace(
        frames=frames, solids=tuple(robot_solids(robot)), urdf=urdf(robot, name), sensors=sensors
    )
