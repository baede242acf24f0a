"""Options of the bridge process, as one JSON object."""

from __future__ import annotations

import json
from typing import Any, NamedTuple

from diffbotctl.ros2.conversion import SensorModel


class ModelFrame(NamedTuple):
    """A frame of the robot in its parent: m, rad. `moves`: `odometry`, `wheel` or nothing."""

    name: str
    parent: str
    x: float
    y: float
    z: float
    heading: float
    moves: str


class RobotModel(NamedTuple):
    """Properties of the robot that ROS needs and the socket does not have.

    `sensors` are by wire. Without a robot file all of it is empty.
    """

    urdf: str = ""
    frames: tuple[ModelFrame, ...] = ()
    counts_per_turn: tuple[float, float] = (0.0, 0.0)
    sensors: dict[str, SensorModel] = {}


class BridgeOptions(NamedTuple):
    """Options of the bridge. `allows_drive`: ROS nodes may move the robot."""

    engine: str
    socket: str
    allows_drive: bool = False
    namespace: str = ""
    frame_prefix: str = ""
    model: RobotModel = RobotModel()


def encode_options(options: BridgeOptions) -> str:
    model = options.model
    sensors = {wire: tuple(sensor) for wire, sensor in model.sensors.items()}
    return json.dumps({**options._asdict(), "model": {**model._asdict(), "sensors": sensors}})


def decode_options(text: str) -> BridgeOptions:
    """The options of `encode_options`."""
    fields: dict[str, Any] = json.loads(text)
    model = fields.pop("model")
    left, right = model["counts_per_turn"]
    return BridgeOptions(
        **fields,
        model=RobotModel(
            model["urdf"],
            tuple(ModelFrame(*frame) for frame in model["frames"]),
            (left, right),
            {wire: SensorModel(*values) for wire, values in model["sensors"].items()},
        ),
    )
