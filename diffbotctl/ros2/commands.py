"""What ROS nodes may ask of the robot: goals, poses, services, live parameters."""

from __future__ import annotations

from math import isfinite
from typing import Any

from geometry_msgs.msg import PoseStamped, PoseWithCovarianceStamped
from rcl_interfaces.msg import ParameterDescriptor, SetParametersResult
from std_srvs.srv import Trigger

from diffbotctl.client.engine_connection import EngineConnection
from diffbotctl.control_socket.protocol import RESET_ACTIONS, Fields
from diffbotctl.errors import RunError
from diffbotctl.ros2.conversion import heading_of
from diffbotctl.ros2.topics import MAP, WORLD

SET_POSE = "odometry.set_pose"
QUEUE_DEPTH = 1


class RobotCommands:
    """Subscriptions and services. Without `allows_drive` there is only the service `stop`."""

    def __init__(
        self, node: Any, engine: EngineConnection, allows_drive: bool, frame_prefix: str
    ) -> None:
        self.node, self.engine = node, engine
        self.frame, self.map_frame = frame_prefix + WORLD, frame_prefix + MAP
        self.place = ""  # the action that places the robot in the map
        self.stop = node.create_service(Trigger, "stop", self._stop)
        if not allows_drive:
            return
        self.actions = {row["action"] for row in engine.request("list_actions")["actions"]}
        self.place = next((name for name in self.actions if name.endswith(".place")), "")
        self.others = [
            node.create_service(Trigger, "resume", self._resume),
            node.create_service(Trigger, "reset", self._reset),
            node.create_subscription(PoseStamped, "goal_pose", self._goal, QUEUE_DEPTH),
            node.create_subscription(
                PoseWithCovarianceStamped, "initialpose", self._initial_pose, QUEUE_DEPTH
            ),
        ]

    def _stop(self, _request: Any, response: Any) -> Any:
        return self._answer(response, "stop", reason="service stop of ROS")

    def _resume(self, _request: Any, response: Any) -> Any:
        return self._answer(response, "resume")

    def _reset(self, _request: Any, response: Any) -> Any:
        """Pose and simulated robot back to the start of the run."""
        known = [action for action in RESET_ACTIONS if action in self.actions]
        response.message = "" if known else "nothing in this run can be reset"
        for action in known:
            self._answer(response, "call_action", action=action)
            if not response.success:
                break
        return response

    def _answer(self, response: Any, method: str, **fields: Any) -> Any:
        complaint = self._request(method, **fields)
        response.success, response.message = not complaint, complaint
        return response

    def _request(self, method: str, **fields: Any) -> str:
        """Send a request; the cause of a refusal, empty for none."""
        try:
            self.engine.request(method, **fields)
        except RunError as error:
            return error.problems[0].cause
        return ""

    def _goal(self, message: Any) -> None:
        fields = self._pose_fields("goal_pose", message.header, message.pose, self.frame)
        if fields is not None:
            self._complain("goal_pose", self._request("goto", **fields))

    def _initial_pose(self, message: Any) -> None:
        in_map = message.header.frame_id.lstrip("/") == self.map_frame and self.place
        frame, action = (self.map_frame, self.place) if in_map else (self.frame, SET_POSE)
        fields = self._pose_fields("initialpose", message.header, message.pose.pose, frame)
        if fields is not None:
            complaint = self._request("call_action", action=action, arguments=fields)
            self._complain("initialpose", complaint)

    def _pose_fields(self, topic: str, header: Any, pose: Any, frame: str) -> Fields | None:
        """x, y and heading in `frame`; None for a pose that is refused."""
        if header.frame_id.lstrip("/") not in ("", frame):
            cause = f"its frame is '{header.frame_id}'; poses are accepted in '{frame}'"
            self._complain(topic, cause)
            return None
        turn = pose.orientation
        values = (pose.position.x, pose.position.y, turn.x, turn.y, turn.z, turn.w)
        if not all(map(isfinite, values)):
            self._complain(topic, "a number of it is not finite")
            return None
        if not any(values[2:]):
            self._complain(topic, "its orientation is no rotation: all four numbers are 0")
            return None
        return {"x": values[0], "y": values[1], "heading": heading_of(*values[2:])}

    def _complain(self, topic: str, cause: str) -> None:
        if cause:
            self.node.get_logger().warning(f"{topic} refused: {cause}")


class LiveParameters:
    """The parameters of the run's blocks as parameters of the node, such as `guard.margin`.

    Only live ones can be set, and only with `allows_drive`: they change how the robot moves.
    """

    def __init__(self, node: Any, engine: EngineConnection, allows_drive: bool) -> None:
        self.node, self.engine = node, engine
        self.names: set[str] = set()
        for row in engine.request("list_parameters")["parameters"]:
            if row["value"] is not None:
                self._declare(row, allows_drive)
        node.add_on_set_parameters_callback(self._set)

    def _declare(self, row: Fields, allows_drive: bool) -> None:
        unit = f" ({row['unit']})" if row["unit"] else ""
        descriptor = ParameterDescriptor(
            description=f"{row['help']}{unit}", read_only=not (row["live"] and allows_drive)
        )
        self.node.declare_parameter(row["parameter"], row["value"], descriptor)
        self.names.add(row["parameter"])

    def _set(self, parameters: list[Any]) -> Any:
        for parameter in parameters:
            if parameter.name not in self.names:
                continue
            try:
                self.engine.request(
                    "set_parameter", parameter=parameter.name, value=parameter.value
                )
            except RunError as error:
                return SetParametersResult(successful=False, reason=error.problems[0].cause)
        return SetParametersResult(successful=True)
