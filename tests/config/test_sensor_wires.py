"""On which wires the distances of a sensor are, for map, viewers and ROS 2."""

import pytest

from diffbotctl.config.load import load
from diffbotctl.ros2.robot_model import model_of

SCAN = "scan: {type: lds01, pin: none, at: {x: 20 mm}}"
SOURCES = """
sources: {laser: {driver: lidar, with: {device: /dev/ttyUSB1, model: lds01}}}
blocks: {scan_guard: {in: {scan: laser.scan}}}
"""


@pytest.mark.parametrize(
    ("sensors", "more", "expected"),
    [
        ("", "", {"range.range": "front"}),
        (SCAN, "", {"range.range": "front", "robot.scan": "scan"}),
        (SCAN, SOURCES, {"range.range": "front", "laser.scan": "scan"}),
        (
            "back: {type: hc_sr04, trigger: 40, echo: 50, at: {x: -80 mm, heading: 180 deg}}",
            "",
            {"range.range": "front", "robot.back": "back"},
        ),
    ],
)
def test_the_wires_of_sensors(tmp_path, sensors, more, expected):
    robot, pipeline = tmp_path / "bot.yaml", tmp_path / "mine.yaml"
    robot.write_text(
        "format: 1\nkind: robot\ninclude: book_2wd\nboard: {telemetry: 30 Hz}\n"
        f"sensors: {{{sensors}}}\n"
    )
    pipeline.write_text(f"format: 1\nkind: pipeline\ninclude: goal\n{more}")
    configuration = load(str(pipeline), str(robot))
    assert configuration.sensor_wires() == expected
    frames = {wire: sensor.frame for wire, sensor in model_of(configuration).sensors.items()}
    assert frames == {wire: f"{name}_sensor_link" for wire, name in expected.items()}
