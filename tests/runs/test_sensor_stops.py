"""An obstacle stop by each type of distance sensor, on the simulated and on the emulated board."""

import re

import pytest

from diffbotctl.testing.running import cli

FRONT = 0.08  # m, of the sensor and of the body
WALL = 0.8  # m
ECHO = (
    "robot.sensors.front.type=hc_sr04",
    "robot.sensors.front.pin=none",
    "robot.sensors.front.trigger=24",
    "robot.sensors.front.echo=50",
    "robot.board.telemetry=30 Hz",
)
TYPES = {
    "GP2Y0A41": ((), 0.05),
    "GP2Y0A21": (("robot.sensors.front.type=sharp_gp2y0a21yk0f",), 0.10),
    "GP2Y0A02": (("robot.sensors.front.type=sharp_gp2y0a02yk0f",), 0.20),
    "HC-SR04": (ECHO, 0.05),
}


@pytest.mark.parametrize("port", ["sim", "emulated"])
@pytest.mark.parametrize("kind", TYPES)
def test_the_robot_stops_before_the_wall(tmp_path, kind, port):
    """Before the margin of 5 cm is used up, or where the sensor ceases to measure, which is
    farther away: there the robot brakes from its present speed."""
    sets, gap = TYPES[kind]
    wall = f"world.walls=[{{from: [{WALL} m, -1 m], to: [{WALL} m, 1 m]}}]"
    words = ["run", "goal", "--fast", "--port", port, "--goal", "1.2 0 0deg", "--for", "8s"]
    for each in (*sets, wall, "robot.drive.polarity=checked_by_hand", "follower.patience=20 s"):
        words += ["--set", each]
    code, said, complaints = cli(tmp_path, *words)
    assert code == 1, said + complaints
    assert re.search(r"stop at .*(too_close|obstacle)", said), said
    pose = re.search(r"pose x (\S+) m", said)
    assert pose is not None, said
    left_over = WALL - FRONT - float(pose.group(1))
    assert 0.02 < left_over < gap + 0.05, said
