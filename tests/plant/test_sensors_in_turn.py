"""Distance sensors besides the first, and HC-SR04, in the plant and behind the emulated board."""

from pathlib import Path

import pytest

import tests.support
from diffbotctl.config.load import load
from diffbotctl.drivers.simulated_robot import simulated_robot_driver
from diffbotctl.emulator.emulated_robot import emulated_robot_driver
from diffbotctl.messages import Range, Text, Volts
from diffbotctl.time import SECOND

ROBOT = str(Path(tests.support.__file__).with_name("four_sensors.yaml"))
WALLS = (
    "world.walls=[{from: [0.58 m, -0.4 m], to: [0.58 m, 3 m]}, "
    "{from: [-3 m, 0.9 m], to: [3 m, 0.9 m]}]"
)
DRIVERS = pytest.mark.parametrize(
    "make", [simulated_robot_driver, emulated_robot_driver], ids=["simulated", "emulated"]
)


def delivered(make, *sets, seconds=3):
    driver = make(load("standby", ROBOT, [WALLS, "guard.stale_after=0.25", *sets]), 1)
    try:
        now, deliveries = 0, []
        while now < seconds * SECOND:
            now = max(driver.due(), now + 1)
            deliveries += driver.deliver(now)
    finally:
        driver.close()
    return deliveries


def last(deliveries, name):
    return [each.message for each in deliveries if each.wire == f"robot.{name}"][-1]


@DRIVERS
def test_four_sensors_by_name(make):
    """Front 8 cm ahead of the axle, 50 cm from a wall; left 5 cm beside it, 85 cm from another."""
    deliveries = delivered(make)
    front, left, right = (last(deliveries, name) for name in ("front", "left", "right"))
    assert isinstance(front, Range) and front.state == "measured"
    assert front.distance == pytest.approx(0.50, abs=0.04)
    assert isinstance(left, Range) and left.distance == pytest.approx(0.85, abs=0.04)
    assert right.state == "clear"
    rear = last(deliveries, "rear")
    assert isinstance(rear, Volts) and rear.volts < 0.2
    times = [each.message.time for each in deliveries if each.wire == "robot.front"]
    assert len(times) == pytest.approx(3 / 0.153, rel=0.15)


@DRIVERS
@pytest.mark.parametrize("fault", ["silent", "endless"])
def test_a_faulty_sensor_is_reported_and_the_others_go_on(make, fault):
    faults = f"[{{fault: range_{fault}, sensor: front}}]"
    deliveries = delivered(make, f"robot.simulation.faults={faults}")
    readings = [each.message for each in deliveries if each.wire == "robot.front"]
    assert readings and {each.state for each in readings} == {"fault"}
    assert last(deliveries, "left").state == "measured"
    if make is emulated_robot_driver:
        texts = [each.message.text for each in deliveries if isinstance(each.message, Text)]
        assert len([text for text in texts if text.startswith("front: the HC-SR04")]) == 1
