"""Commands as ROS users type them, answered with ours.

The table has the words of ROS 1, and of ROS 2 where it has no counterpart in ROS 1: `ros2 topic
echo` is looked up as `rostopic echo`. The longest entry that the typed words begin with is the
answer. Its words in capitals stand for the arguments that were typed, in their order, and
`[TOPIC]...` for all of them.
"""

from __future__ import annotations

import shlex
from typing import NamedTuple

from diffbotctl.errors import Problem, UsageError


class RosAnswer(NamedTuple):
    """What to type here, without `diffbotctl`, and what is different; the latter may be empty."""

    command: str
    note: str = ""


MESSAGE = """the message is a JSON object, such as '{"linear": 0.1}'"""
FIELDS = "it prints the fields of a topic with their units"
NO_BUILD = "nothing is built here: a package of your own is installed by pip"
NO_MASTER = "there is no master, and nothing to start before a run"
NO_FILES = "packages are ordinary Python packages, and nothing is sourced"
ONE_PROCESS = "all blocks of a run are one process, which one command starts"
FRAMES_IN_FILE = "the frames of the robot come from its file, and its pose from odometry"
DASHBOARD = "the dashboard has map, goal, plots and parameters in the terminal"
SIMULATED = "a run without --port is simulated"
TOOLS_OF_ROS = "it works with `diffbotctl ros2`, which makes a running engine a node of ROS 2"

ANSWERS = {
    "rostopic": RosAnswer("topic list"),
    "rostopic echo": RosAnswer("topic echo TOPIC"),
    "rostopic hz": RosAnswer("topic hz TOPIC"),
    "rostopic bw": RosAnswer("topic hz TOPIC"),
    "rostopic delay": RosAnswer("topic hz TOPIC"),
    "rostopic type": RosAnswer("topic type TOPIC"),
    "rostopic info": RosAnswer("topic type TOPIC"),
    "rostopic find": RosAnswer("topic list"),
    "rostopic pub": RosAnswer("topic pub TOPIC {...}", MESSAGE),
    "rosservice": RosAnswer("call", "a service is an action of a block; this lists all"),
    "rosservice call": RosAnswer("call ACTION", "arguments follow as NAME=VALUE"),
    "rosaction": RosAnswer("goto 1 0.5 90deg", "an action that drives to a pose is a goal"),
    "rosparam": RosAnswer("param list"),
    "rosparam get": RosAnswer("param get PARAMETER"),
    "rosparam set": RosAnswer("param set PARAMETER VALUE"),
    "rosparam load": RosAnswer("run PIPELINE", "parameters stand in the pipeline file"),
    "rosparam dump": RosAnswer("param save", "it writes what was changed into the pipeline file"),
    "rosnode": RosAnswer("blocks --running"),
    "rosnode kill": RosAnswer("stop", ONE_PROCESS),
    "roscomponent": RosAnswer("blocks --running", ONE_PROCESS),
    "roslifecycle": RosAnswer("blocks --running", ONE_PROCESS),
    "rosrun": RosAnswer("run PIPELINE", ONE_PROCESS),
    "roslaunch": RosAnswer("run PIPELINE", ONE_PROCESS),
    "roscore": RosAnswer("run goal", NO_MASTER),
    "rosmaster": RosAnswer("run goal", NO_MASTER),
    "rosdaemon": RosAnswer("run goal", NO_MASTER),
    "rosbag": RosAnswer("bag --help"),
    "rosbag record": RosAnswer("bag record [TOPIC]...", "`run --record FILE` records a whole run"),
    "rosbag play": RosAnswer("replay FILE", "it repeats every message of the run exactly"),
    "rosbag info": RosAnswer("bag info FILE"),
    "rosbag check": RosAnswer("replay FILE --check"),
    "rosbag reindex": RosAnswer("bag recover FILE"),
    "rosbag fix": RosAnswer("bag recover FILE"),
    "rosbag filter": RosAnswer("bag export FILE"),
    "rosbag convert": RosAnswer("bag export FILE --format rosbag2 --output FOLDER"),
    "rosmsg": RosAnswer("topic type /cmd_vel", FIELDS),
    "rossrv": RosAnswer("call", "a service is an action of a block; this lists all"),
    "rosinterface": RosAnswer("topic type /cmd_vel", FIELDS),
    "roswtf": RosAnswer("doctor", "for a robot that stands still: diffbotctl why"),
    "rosdoctor": RosAnswer("doctor", "for a robot that stands still: diffbotctl why"),
    "rosversion": RosAnswer("--version"),
    "rosconsole": RosAnswer("log level guard debug"),
    "rosclean": RosAnswer("bag save", "the black box keeps the ten newest files by itself"),
    "rosdep": RosAnswer("doctor", "it names what is missing on this computer"),
    "rospack": RosAnswer("blocks", NO_FILES),
    "rospkg": RosAnswer("blocks", NO_FILES),
    "rospkg create": RosAnswer("new block NAME", NO_BUILD),
    "roscd": RosAnswer("blocks", NO_FILES),
    "rosls": RosAnswer("blocks", NO_FILES),
    "rosed": RosAnswer("blocks", NO_FILES),
    "rostest": RosAnswer("new block my_block", "its package has a test, which pytest runs"),
    "catkin_make": RosAnswer("new block my_block", NO_BUILD),
    "catkin": RosAnswer("new block my_block", NO_BUILD),
    "catkin_create_pkg": RosAnswer("new block NAME", NO_BUILD),
    "catkin_init_workspace": RosAnswer("new block my_block", NO_BUILD),
    "colcon": RosAnswer("new block my_block", NO_BUILD),
    "ament": RosAnswer("new block my_block", NO_BUILD),
    "rqt": RosAnswer("dash", DASHBOARD),
    "rqt_gui": RosAnswer("dash", DASHBOARD),
    "rqt_graph": RosAnswer("graph --running"),
    "rqt_plot": RosAnswer("dash", "of a recording: diffbotctl bag plot FIELD FILE"),
    "rqt_console": RosAnswer("log"),
    "rqt_logger_level": RosAnswer("log level guard debug"),
    "rqt_reconfigure": RosAnswer("param list", "live ones are set while the robot runs"),
    "rqt_bag": RosAnswer("bag info FILE", "curves: diffbotctl bag plot FIELD FILE"),
    "rqt_topic": RosAnswer("topic list"),
    "rqt_publisher": RosAnswer("topic pub /cmd_vel {...}", MESSAGE),
    "rqt_robot_steering": RosAnswer("teleop"),
    "rqt_tf_tree": RosAnswer("frames", FRAMES_IN_FILE),
    "rqt_robot_monitor": RosAnswer("dash", DASHBOARD),
    "rviz": RosAnswer("dash", f"{DASHBOARD}; RViz itself shows what `diffbotctl ros2` publishes"),
    "gazebo": RosAnswer("run goal", SIMULATED),
    "gzserver": RosAnswer("run goal", SIMULATED),
    "gzclient": RosAnswer("run goal --dash", SIMULATED),
    "teleop_twist_keyboard": RosAnswer("teleop"),
    "teleop_twist_joy": RosAnswer("new driver my_driver", "a joystick is a source of a pipeline"),
    "turtle_teleop_key": RosAnswer("teleop --keys turtle"),
    "turtlesim_node": RosAnswer("run turtles --stay"),
    "draw_square": RosAnswer("run square --robot turtle"),
    "talker": RosAnswer("run hello"),
    "listener": RosAnswer("run hello"),
    "serial_node": RosAnswer("run goal --port auto", "the link is part of the run"),
    "make_libraries": RosAnswer("flash firmware", "the firmware is built already"),
    "tf_echo": RosAnswer("topic echo odometry.odometry", FRAMES_IN_FILE),
    "tf2_echo": RosAnswer("topic echo odometry.odometry", FRAMES_IN_FILE),
    "tf_monitor": RosAnswer("topic hz odometry.odometry", FRAMES_IN_FILE),
    "view_frames": RosAnswer("frames", FRAMES_IN_FILE),
    "static_transform_publisher": RosAnswer("frames", FRAMES_IN_FILE),
    "robot_state_publisher": RosAnswer("frames", FRAMES_IN_FILE),
    "joint_state_publisher": RosAnswer("frames", FRAMES_IN_FILE),
    "xacro": RosAnswer("export urdf", "the robot file is the source of the URDF"),
    "check_urdf": RosAnswer("check FILE"),
    "urdf_to_graphiz": RosAnswer("frames"),
    "move_base": RosAnswer("goto 1 0.5 90deg", TOOLS_OF_ROS),
    "amcl": RosAnswer("call odometry.set_pose x=0 y=0", TOOLS_OF_ROS),
    "slam_gmapping": RosAnswer("ros2", TOOLS_OF_ROS),
    "slam_toolbox": RosAnswer("ros2", TOOLS_OF_ROS),
    "nav2": RosAnswer("ros2", TOOLS_OF_ROS),
}
# Endings of programs that are left away, as of `serial_node.py` and `rviz2`.
ENDINGS = (".py", ".launch", ".xml", "2")
PROGRAM_STARTERS = ("rosrun", "roslaunch")  # package and program follow
# Options of the commands of ROS that are followed by a value.
WITH_VALUE = ("-b", "-c", "-d", "-n", "-O", "-o", "-p", "-r", "-s", "-w", "--rate", "--times")


def ros_error(words: list[str]) -> UsageError | None:
    """The error for words that are of ROS, with what to type instead; None for others."""
    found = ros_answer(words)
    if found is None:
        return None
    cause = f"this is a command of ROS{found.note and '; '}{found.note}"
    fix = f"type: diffbotctl {found.command}"
    return UsageError(Problem("E-ROS-WORD", words[0], cause, fix))


def ros_answer(words: list[str]) -> RosAnswer | None:
    """What a ROS user should type instead of `words`; None for words that are not of ROS."""
    words = _without_options(words)
    if words[:1] == ["ros2"]:
        words = _as_ros_1(words[1:])
    if not words:
        return None
    if words[0] in PROGRAM_STARTERS:
        programs = (_known_program(word) for word in reversed(words[1:3]))
        return next(filter(None, programs), ANSWERS[words[0]])
    for length in (2, 1):
        found = ANSWERS.get(" ".join(words[:length]))
        if found is not None:
            return found._replace(command=_filled(found.command, words[length:]))
    return ANSWERS.get(_program_name(words[0]))


def _as_ros_1(words: list[str]) -> list[str]:
    """The words after `ros2` as ROS 1 has them: `param get /guard margin` names its node apart."""
    if words[:1] == ["param"] and len(words) > 3:
        words = [*words[:2], f"{words[2]}/{words[3]}", *words[4:]]
    return [f"ros{words[0]}", *words[1:]] if words else []


def _known_program(word: str) -> RosAnswer | None:
    """The answer for a program of a package or a launch file; any keyboard teleop is one."""
    name = _program_name(word)
    is_teleop = "teleop" in name and "joy" not in name
    return ANSWERS.get(name) or (RosAnswer("teleop") if is_teleop else None)


def _program_name(word: str) -> str:
    """The name of a program without its ending."""
    for ending in () if word in ANSWERS else ENDINGS:
        word = word.removesuffix(ending)
    return word


def _without_options(words: list[str]) -> list[str]:
    kept: list[str] = []
    skips_next = False
    for word in words:
        if skips_next:
            skips_next = False
        elif word.startswith("-") and not word[1:2].isdigit():
            skips_next = word in WITH_VALUE
        else:
            kept.append(word)
    return kept


def _filled(command: str, typed: list[str]) -> str:
    """The command with the words in capitals replaced by what was typed, as far as it goes."""
    rest = iter(typed)
    words: list[str] = []
    for word in command.split():
        if word == "[TOPIC]...":
            words += map(shlex.quote, rest)
        elif word == "PARAMETER":
            words.append(shlex.quote(next(rest, word).strip("/").replace("/", ".")))
        elif word.isalpha() and word.isupper():
            words.append(shlex.quote(next(rest, word)))
        else:
            words.append(word)
    return " ".join(words)
