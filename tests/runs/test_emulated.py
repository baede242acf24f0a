"""The real firmware binary in the emulator, in lockstep with the plant, as a user runs it."""

from math import degrees, hypot, pi

import pytest

from diffbotctl.config.load import load
from diffbotctl.drivers.simulated_robot import SimulatedRobotDriver
from diffbotctl.emulator.emulated_robot import emulated_robot_driver
from diffbotctl.messages import Battery, Wheels
from diffbotctl.plant.simulated_robot import draw_robot
from diffbotctl.runs.options import RunOptions
from diffbotctl.runs.run import Run
from diffbotctl.time import MILLISECOND as MS
from diffbotctl.time import SECOND


def go(seed):
    options = RunOptions(port="emulated", fast=True, seed=seed, duration=60.0, digest=True)
    return Run(load("goal"), options).go()


def test_the_real_binary_drives_to_the_goal_and_twice_the_same():
    first, again = go(3), go(3)
    assert first.reached == 1 and first.ending.stopped is True
    assert first.link.damaged == 0 and first.link.lost == 0
    assert first.digest == again.digest
    pose = first.truth.pose
    assert hypot(pose.x - 1.0, pose.y - 0.5) < 0.03
    assert degrees(abs(pose.heading - pi / 2)) < 4.0


def test_falling_edges_work_like_rising_ones(tmp_path):
    robot = tmp_path / "falling.yaml"
    robot.write_text(
        "format: 1\nkind: robot\ninclude: book_2wd\ndrive: {encoder: {edge: falling}}\n"
    )
    setup = load("goal", str(robot))
    for port in ("sim", "emulated"):
        result = Run(setup, RunOptions(port=port, fast=True, seed=2, duration=60.0)).go()
        assert result.reached == 1, port
        assert abs(result.truth.pose.x - 1.0) < 0.05 and abs(result.truth.pose.y - 0.5) < 0.05


@pytest.mark.parametrize("equations", ["exponential", "torque"])
def test_the_battery_sags_alike_at_both_boards(equations):
    sets = ["robot.battery.pin=A1", "robot.battery.divider=3", "robot.battery.low=6 V"]
    sets += ["robot.simulation.battery.sag=0.4", f"robot.simulation.equations={equations}"]
    configuration = load("goal", "book_2wd", [*sets, "robot.drive.polarity=checked_by_hand"])
    plant = draw_robot(configuration.robot, configuration.nominal, 3)
    simulated = SimulatedRobotDriver(plant, takes_duty=False)
    emulated = emulated_robot_driver(configuration, 3)
    loaded = []
    for driver in (simulated, emulated):
        volts = []
        for now in range(0, 5 * SECOND, 10 * MS):
            messages = [delivery.message for delivery in driver.deliver(now)]
            volts += [message.volts for message in messages if isinstance(message, Battery)]
            if now % (50 * MS) == 0:
                driver.command(now, Wheels(now, 8.0, 8.0))
        driver.close()
        loaded.append(volts[-1])
    assert loaded[0] < 7.2, "the load is seen"
    assert loaded[1] == pytest.approx(loaded[0], abs=0.3)
