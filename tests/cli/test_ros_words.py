"""What a ROS user types, and the command that is named instead."""

import shlex

import click
import pytest
from click.testing import CliRunner

from diffbotctl.cli.main import commands, program
from diffbotctl.cli.other_words import ros_answer, ros_answers, ros_error
from diffbotctl.errors import UsageError

TYPED = {
    "rostopic list": "topic list",
    "rostopic echo /odom": "topic echo /odom",
    "rostopic echo -n 1 /odom": "topic echo /odom",
    "rostopic pub -r 10 /cmd_vel geometry_msgs/Twist '{}'": "topic pub /cmd_vel {...}",
    "ros2 topic echo /odom --once": "topic echo /odom",
    "ros2 topic bw /odom": "topic hz /odom",
    "ros2 topic list": "topic list",
    "rosparam dump": "param save",
    "rosparam get /guard/margin": "param get guard.margin",
    "ros2 param set /guard margin 0.1": "param set guard.margin 0.1",
    "ros2 param set /guard offset -0.1": "param set guard.offset -0.1",
    "ros2 param list": "param list",
    "ros2 run turtlesim turtlesim_node": "run turtles --stay",
    "rosrun turtlesim turtle_teleop_key": "teleop --keys turtle",
    "rosrun teleop_twist_keyboard teleop_twist_keyboard.py": "teleop",
    "rosrun rosserial_python serial_node.py _port:=/dev/ttyUSB0": "run goal --port auto",
    "rosrun my_package my_node": "run PIPELINE",
    "roslaunch turtlebot3_teleop turtlebot3_teleop_key.launch": "teleop",
    "ros2 launch my_package my.launch.py": "run PIPELINE",
    "rosbag record -O drive /odom /tf": "bag record /odom /tf",
    "rosbag record -a": "bag record",
    "rosbag play drive.bag": "replay drive.bag",
    "ros2 bag play 'my drive'": "replay 'my drive'",
    "ros2 bag info drive": "bag info drive",
    "rosservice call /reset": "call /reset",
    "ros2 service list": "call",
    "ros2 node list": "blocks --running",
    "ros2 pkg create nose": "new block nose",
    "ros2 interface show geometry_msgs/msg/Twist": "types Twist",
    "rosmsg show std_msgs/Int32": "types Int32",
    "rosmsg list": "types",
    "ros2 action send_goal /navigate nav2_msgs/action/NavigateToPose '{}'": "goto 1 0.5 90deg",
    "catkin_make": "new block my_block",
    "catkin build": "new block my_block",
    "colcon build --symlink-install": "new block my_block",
    "catkin_create_pkg nose rospy": "new block nose",
    "rqt_plot /odom/pose/pose/position/x": "dash",
    "rqt_gui": "dash",
    "rqt_graph": "graph --running",
    "rviz": "dash",
    "rviz2": "dash",
    "rosversion -d": "--version",
    "roscore": "run goal",
    "teleop_twist_keyboard": "teleop",
    "roswtf": "doctor",
}


@pytest.mark.parametrize("typed", TYPED)
def test_a_command_of_ros_is_answered_with_ours(typed):
    answer = ros_answer(shlex.split(typed))
    assert answer is not None and answer.command == TYPED[typed]


@pytest.mark.parametrize("words", ["run", "ros2", "ros2 fly", "rosy", "telleop", "goto 1 2"])
def test_other_words_are_not_of_ros(words):
    assert ros_answer(words.split()) is None and ros_error(words.split()) is None


@pytest.mark.parametrize("typed", ros_answers())
def test_every_answer_is_a_command_that_exists(typed):
    words = ros_answers()[typed].command.split()
    if words == ["--version"]:
        return
    assert words[0] in commands()
    command, rest = program.get_command(None, words[0]), words[1:]
    while isinstance(command, click.Group) and rest and rest[0] in command.commands:
        command, rest = command.commands[rest[0]], rest[1:]
    options = {name for parameter in command.params for name in parameter.opts} | {"--help"}
    arguments = [word for word in rest if not word.startswith("--")]
    takes = any(isinstance(parameter, click.Argument) for parameter in command.params)
    assert set(rest) - set(arguments) <= options
    assert takes or all("--" in before for before in rest[: len(arguments)])


@pytest.mark.parametrize(
    "typed", ["rostopic echo /odom", "ros2 topic echo /odom --once", "help rostopic"]
)
def test_the_error_has_place_cause_and_fix(typed):
    error = CliRunner().invoke(program, typed.split(), standalone_mode=False).exception
    assert isinstance(error, UsageError) and error.exit_code == 2
    (problem,) = error.problems
    assert problem.code == "E-ROS-WORD" and problem.file in typed.split()
    assert "a command of ROS" in problem.cause and "diffbotctl topic" in problem.fix


def test_an_unknown_option_of_the_bridge_is_still_an_error():
    error = CliRunner().invoke(program, ["ros2", "--dive"], standalone_mode=False).exception
    assert isinstance(error, click.NoSuchOption)
