"""What ROS calls things, and what they are called here: for the fingers that know the old names."""

from __future__ import annotations

from collections.abc import Mapping

from diffbotctl.messages import Battery, Goal, GoalState, Odometry, Path, Range, Scan, Twist, Wheels

# The topic's last word: where it comes from here, or the message class that carries the same.
TOPICS: dict[str, str | type] = {
    "cmd_vel": "operator.twist",
    "odom": Odometry,
    "pose": Odometry,  # turtlesim's
    "scan": Scan,
    "range": Range,
    "sonar": Range,
    "goal": "operator.goal",
    "goal_pose": "operator.goal",
    "path": "operator.path",
    "plan": Path,
    "status": GoalState,
    "battery_state": Battery,
    "wheel_cmd": Wheels,
    "lwheel": "robot.encoders",
    "rwheel": "robot.encoders",
    "joint_states": "robot.encoders",
    "twist": Twist,
    "current_goal": Goal,
    "rosout": "log",
    "rosout_agg": "log",
}


def ours(name: str, wires: Mapping[str, type]) -> str | None:
    """The wire that a ROS user means by `name`, such as `/odom`; None when there is none."""
    wanted = TOPICS.get(name.strip("/").split("/")[-1])
    if wanted is None:
        return None
    if isinstance(wanted, str):
        return wanted if wanted in wires else None
    return next((wire for wire, kind in wires.items() if kind is wanted), None)
