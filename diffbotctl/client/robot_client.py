"""A running robot for a Python program: its topics, parameters, actions and motion.

    from diffbotctl.client import RobotClient

    with RobotClient() as robot:
        robot.drive(linear=0.1, seconds=2.0)
        print(robot.read("odometry.odometry")["x"])
        robot.goto(0.5, 0.2)

What is refused raises a RunError with cause and fix. Numbers are in SI units, poses in odom.
"""

from __future__ import annotations

import os
import time
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path
from types import TracebackType
from typing import Any, Self, get_args

from diffbotctl.control_socket.address import SOCKET_VARIABLE, EngineAddress, process_of
from diffbotctl.control_socket.client import ControlClient, choose_engine
from diffbotctl.control_socket.requests import TEXT_MAX_LENGTH
from diffbotctl.errors import Problem, RunError, UserError, escape_control
from diffbotctl.messages import GoalEnd

DRIVE_PERIOD_S = 0.05  # the engine stops the robot after 0.3 s without a command
STATUS_PERIOD_S = 0.1  # between two looks at a goal
GOAL_ENDS = get_args(GoalEnd)


class RobotClient:
    """A connection to the engine called `engine`, to be used by one thread.

    Without a name it is the engine that started the program, or the only one on this computer.
    `name` is this program in logs and in the causes of stops. Leaving the `with` block stops what
    the program has set in motion; after an exception, or with a goal under way, the robot then
    stays stopped until `diffbotctl resume`. A program that is killed cannot do that: within 0.3 s
    the robot stops a `drive`, but it does not stop a `goto`.
    """

    def __init__(self, engine: str | None = None, name: str = "program") -> None:
        started_by = os.environ.get(SOCKET_VARIABLE)
        if engine is None and started_by:
            path = Path(started_by)
            self._address = EngineAddress(path.stem, path, process_of(path))
        else:
            self._address = choose_engine(engine)
        self._name = name
        self._client = ControlClient(self._address, name)
        self._has_moved = self._has_goal = False

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        try:
            if self._has_goal or (self._has_moved and error is not None):
                with suppress(UserError):  # the run has ended
                    reason = "" if kind is None else f" with {kind.__name__}"
                    self.stop(f"{self._name} has ended{reason}")
        finally:
            self._client.close()

    def topics(self) -> dict[str, str]:
        """Every topic, with the type of its messages."""
        rows = self._client.request("list_topics")["topics"]
        return {row["topic"]: row["type"] for row in rows}

    def read(self, topic: str) -> dict[str, Any] | None:
        """The newest message of a topic: its fields by name. None: there was none yet."""
        last: dict[str, Any] | None = self._client.request("describe_topic", topic=topic)["last"]
        return last

    def messages(self, topic: str, seconds: float | None = None) -> Iterator[dict[str, Any]]:
        """The messages of a topic as they come, the newest first; for so long, or to the run's end.

        Messages that come while the program does something else wait; of more than 500 the oldest
        are dropped.
        """
        until = None if seconds is None else time.monotonic() + seconds
        watcher = ControlClient(self._address, self._name)
        try:
            watcher.request("subscribe", topic=topic, last=True)
            for line in watcher.stream(until):
                if "message" in line:
                    yield line["message"]
        finally:
            watcher.close()

    def publish(self, topic: str, **fields: Any) -> None:
        """Publish a message on an input of the pipeline, such as `input.person`."""
        self._client.request("publish", topic=topic, message=fields)

    def parameters(self) -> dict[str, Any]:
        """The value of every parameter, by names such as `follower.tolerance`."""
        rows = self._client.request("list_parameters")["parameters"]
        return {row["parameter"]: row["value"] for row in rows}

    def set_parameter(self, parameter: str, value: Any) -> None:
        """Change a live parameter, to a number in its SI unit or a text such as "8 cm"."""
        self._client.request("set_parameter", parameter=parameter, value=value)

    def call(self, action: str, **arguments: Any) -> Any:
        """Call an action, such as `canvas.spawn`, and return what it returns."""
        return self._client.request("call_action", action=action, arguments=arguments).get("value")

    def drive(
        self,
        linear: float = 0.0,
        angular: float = 0.0,
        seconds: float = 1.0,
        take_over: bool = False,
    ) -> None:
        """Drive at a velocity (m/s, rad/s) for so long, then stand. Returns when that is done.

        The velocity is repeated, so that the robot stops when this program ends in any way. A goal
        of the run waits until `resume`. `take_over`: also from another client that drives.
        """
        end = time.monotonic() + seconds
        self._has_moved = True
        fields = {"linear": linear, "angular": angular, "take_over": take_over}
        try:
            while (left := end - time.monotonic()) > 0.0:
                self._client.request("drive", **fields)
                fields["take_over"] = False  # once: who takes over from this program keeps control
                time.sleep(min(left, DRIVE_PERIOD_S))
        finally:
            with suppress(UserError):  # another one drives, or the run has ended
                self._client.request("release")

    def goto(self, x: float, y: float, heading: float | None = None) -> None:
        """Drive to a pose (m, rad), in place of all goals. Returns when it is reached.

        Raises RunError when the robot gives up, or is stopped until `resume`.
        """
        before = self._goal_number()
        self._has_moved = self._has_goal = True
        self._client.request("goto", x=x, y=y, heading=heading)
        while (number := self._goal_number()) == before:
            time.sleep(STATUS_PERIOD_S)
        while True:
            status = self._client.request("status")
            held, state = status["held"], status["goal_state"]
            if held is not None and held["latched"]:
                fix = "remove the cause, then `resume`"
                raise self._failure(f"the robot is stopped: {held['cause']}", fix)
            if self._goal_number(status) != number:
                cause = "another client has replaced the goal, or drives"
                raise self._failure(cause, "`resume` continues a goal that was interrupted")
            if state is not None and state["number"] == number and state["state"] in GOAL_ENDS:
                break
            time.sleep(STATUS_PERIOD_S)
        self._has_goal = False
        if not state["state"].startswith("reached"):
            raise self._failure(f"{state['state']}: {state['cause']}", "")

    def stop(self, reason: str = "") -> None:
        """Stop the robot, and keep it stopped until `resume`."""
        self._client.request("stop", reason=escape_control(reason)[:TEXT_MAX_LENGTH])
        self._has_goal = False

    def resume(self) -> None:
        """Allow motion again after a stop; a goal that waits continues."""
        self._client.request("resume")

    def _goal_number(self, status: dict[str, Any] | None = None) -> int:
        goal = (status or self._client.request("status"))["operator.goal"]
        return 0 if goal is None else int(goal["number"])

    @staticmethod
    def _failure(cause: str, fix: str) -> RunError:
        return RunError(Problem("E-DRIVE-BLOCKED", "goto", cause, fix))
