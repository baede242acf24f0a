"""`diffbotctl ros2` where there is no ROS, and without --drive."""

import stat

from diffbotctl.ros2.find_python import MODULES
from tests.support.running import cli, running


def test_a_python_without_rclpy_is_named_with_the_way_out(tmp_path):
    code, _, complaint = cli(tmp_path, "ros2", "--check", "--python", "/usr/bin/python3")
    assert code == 1
    assert "E-ROS2" in complaint and "has no rclpy" in complaint and "/usr/bin/python3" in complaint


def test_a_python_that_does_not_exist(tmp_path):
    code, _, complaint = cli(tmp_path, "ros2", "--python", "/nowhere/python3")
    assert code == 1 and "there is no program '/nowhere/python3'" in complaint


def test_a_program_that_is_no_python(tmp_path):
    code, _, complaint = cli(tmp_path, "ros2", "--check", "--python", "/bin/false")
    assert code == 1 and "could not be asked" in complaint


def test_a_ros_without_some_packages_gets_an_error_with_their_names(tmp_path):
    record = (
        '{"missing": {"nav_msgs": "no", "std_srvs": "no"}, "version": [3, 12, 3], '
        '"distribution": "jazzy", "middleware": ""}'
    )
    program = tmp_path / "python3"
    program.write_text(f"#!/bin/sh\necho '{record}'\n")
    program.chmod(program.stat().st_mode | stat.S_IXUSR)
    code, _, complaint = cli(tmp_path, "ros2", "--check", "--python", str(program))
    assert code == 1
    assert "sudo apt-get install ros-jazzy-nav-msgs ros-jazzy-std-srvs" in complaint
    assert "rclpy" in MODULES


def test_the_command_that_is_named_uses_the_python_that_was_checked(tmp_path):
    record = '{"missing": {}, "version": [3, 12, 3], "distribution": "jazzy", "middleware": ""}'
    program = tmp_path / "my python"
    program.write_text(f"#!/bin/sh\necho '{record}'\n")
    program.chmod(program.stat().st_mode | stat.S_IXUSR)
    code, out, complaint = cli(tmp_path, "ros2", "--check", "--python", str(program))
    assert code == 0, complaint
    assert f"the bridge can run: diffbotctl ros2 --python '{program}'" in out


def test_words_of_the_ros2_command_are_answered_with_ours(tmp_path):
    code, _, complaint = cli(tmp_path, "ros2", "topic", "echo", "/odom")
    assert code == 2 and "diffbotctl topic echo /odom" in complaint


def test_without_ros_the_bridge_does_not_start(tmp_path):
    with running(tmp_path, "standby", "--stay"):
        code, _, complaint = cli(tmp_path, "ros2", "--python", "/usr/bin/python3")
    assert code == 1 and "E-ROS2" in complaint
