"""What viewers may ask of the robot: velocities and goals that they publish, and services.

Messages are those that the 3D panel and the Teleop panel publish: geometry_msgs/PoseStamped,
geometry_msgs/Twist, and foxglove.PoseInFrame, all as JSON.
"""

from __future__ import annotations

import json
from enum import StrEnum
from math import isfinite
from typing import Any, NamedTuple

from diffbotctl.control_socket.protocol import RefusalError
from diffbotctl.foxglove.protocol import ENCODING, SCHEMA_ENCODING, Fields
from diffbotctl.model.frames import WORLD
from diffbotctl.ros2.conversion import heading_of


class Command(StrEnum):
    """What viewers may be allowed to publish."""

    GOAL = "goal"
    VELOCITY = "velocity"


TOPICS = {Command.GOAL: "goal_pose", Command.VELOCITY: "cmd_vel"}
SERVICE_TYPE = "std_srvs/Trigger"
REQUEST_SCHEMA = {"title": "Request", "type": "object", "properties": {}}
RESPONSE_SCHEMA = {
    "title": "Response",
    "type": "object",
    "properties": {"success": {"type": "boolean"}, "message": {"type": "string"}},
}


class RobotService(NamedTuple):
    """A service: its number, its name, and the method of the control socket that it calls."""

    number: int
    name: str
    method: str


STOP = RobotService(1, "stop", "stop")
RESUME = RobotService(2, "resume", "resume")


def services(allowed: frozenset[Command]) -> list[RobotService]:
    """Anyone may stop the robot; resuming moves it."""
    return [STOP, RESUME] if allowed else [STOP]


def service_row(service: RobotService) -> Fields:
    """One entry of the operation `advertiseServices`."""
    return {
        "id": service.number,
        "name": service.name,
        "type": SERVICE_TYPE,
        "request": _definition("Request", REQUEST_SCHEMA),
        "response": _definition("Response", RESPONSE_SCHEMA),
    }


def _definition(part: str, schema: Fields) -> Fields:
    return {
        "encoding": ENCODING,
        "schemaName": f"{SERVICE_TYPE}_{part}",
        "schemaEncoding": SCHEMA_ENCODING,
        "schema": json.dumps(schema),
    }


def command_of(topic: str, encoding: str, allowed: frozenset[Command]) -> Command:
    """What a viewer wants to publish on `topic`. Raises RefusalError unless it may."""
    for command, name in TOPICS.items():
        if topic.removeprefix("/") == name:
            if command not in allowed:
                fix = f"start the server with --allow {command}"
                raise RefusalError("E-REQUEST", f"{topic}: viewers may not publish it", fix)
            if encoding != ENCODING:
                raise RefusalError("E-REQUEST", f"{topic}: the encoding must be {ENCODING}")
            return command
    known = " and ".join(TOPICS.values())
    raise RefusalError("E-REQUEST", f"{topic} is no topic for viewers; there are {known}")


def velocity(data: bytes) -> tuple[float, float]:
    """Linear (m/s) and angular velocity (rad/s) of a Twist; nan for what is no number.

    A speed in an axis that the robot does not have is ignored. Raises RefusalError for what is no
    Twist.
    """
    fields = _object(data, "velocity")
    linear, angular = fields.get("linear"), fields.get("angular")
    if not isinstance(linear, dict) or not isinstance(angular, dict):
        raise RefusalError("E-REQUEST", "a velocity has no linear and angular part")
    return _number(linear.get("x", 0.0)), _number(angular.get("z", 0.0))


def goal(data: bytes) -> Fields:
    """The fields of `goto` for a pose in odom. Raises RefusalError."""
    fields = _object(data, "goal")
    header = fields.get("header", fields)
    frame = header.get("frame_id", "") if isinstance(header, dict) else ""
    if frame not in ("", WORLD):
        cause = f"the frame of the goal is '{str(frame)[:40]}'; goals are accepted in '{WORLD}'"
        raise RefusalError("E-REQUEST", cause, f"set the display frame to {WORLD}")
    pose = fields.get("pose")
    try:
        position, turn = pose["position"], pose["orientation"]  # type: ignore[index]
        values = [_number(position[axis]) for axis in "xy"]
        values += [_number(turn[axis]) for axis in "xyzw"]
    except (TypeError, KeyError) as error:
        raise RefusalError("E-REQUEST", "the goal has no position and orientation") from error
    if not all(map(isfinite, values)) or not any(values[2:]):
        raise RefusalError("E-REQUEST", "the goal has a number that is not possible")
    return {"x": values[0], "y": values[1], "heading": heading_of(*values[2:])}


def _object(data: bytes, what: str) -> Fields:
    try:
        fields: Any = json.loads(data)
    except (ValueError, RecursionError):
        fields = None
    if not isinstance(fields, dict):
        raise RefusalError("E-REQUEST", f"a {what} is no JSON object")
    return fields


def _number(value: object) -> float:
    """The number; nan for anything else, and for what no float holds."""
    if isinstance(value, bool) or not isinstance(value, int | float):
        return float("nan")
    try:
        return float(value)
    except OverflowError:
        return float("nan")
