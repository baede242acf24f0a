"""Commands as ROS users type them, answered with ours."""

from __future__ import annotations

COMMANDS = {
    "rostopic": "topic",
    "rosparam": "param",
    "rosservice": "call",
    "rosnode": "blocks --live",
    "rosrun": "run",
    "roslaunch": "run",
    "roscore": "run",
    "rosbag": "run --record FILE, and replay",
    "rosmsg": "topic type",
    "rqt_graph": "graph --live",
    "rqt_plot": "topic echo",
    "teleop_twist_keyboard": "drive",
    "rqt_console": "log",
    "rqt_logger_level": "log level",
    "roswtf": "check, and why",
}
# What `ros2 X` and `rosnode X` become, where the words differ.
VERBS = {"bw": "hz", "info": "type", "show": "type", "load": "set", "dump": "list"}


def answer(words: list[str]) -> str:
    """What a ROS user should type instead of `words`; empty for words that are not of ROS."""
    first, rest = words[0], [word for word in words[1:] if not word.startswith("-")]
    if first == "ros2" and rest:
        first, rest = f"ros{rest[0]}", rest[1:]
    ours = COMMANDS.get(first)
    if ours is None:
        return ""
    if ours in ("topic", "param") and rest:
        rest[0] = VERBS.get(rest[0], rest[0])
        ours = " ".join([ours, *rest])
    return f"'{words[0]}' is ROS's word. Here it is: diffbotctl {ours}"
