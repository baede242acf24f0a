"""Each fault changes the simulated robot, in the physically right direction."""

from math import hypot
from statistics import fmean

import pytest

from diffbotctl.config.faults import FAULTS
from diffbotctl.config.load import load
from diffbotctl.drivers.simulated_robot import simulated_robot_driver
from diffbotctl.messages import Encoders, Scan
from diffbotctl.runs.options import RunOptions
from diffbotctl.runs.run import Run
from diffbotctl.time import SECOND
from tests.plant.test_simulation_keys import (
    FOUR_SENSORS,
    HALL_ROBOT,
    IMU,
    LESS,
    MORE,
    NO_SLIP,
    QUIET_IMU,
    WALL,
    Drive,
    check,
    counted_left,
    drift_at_rest,
    fault_time,
    left_edges,
    left_wheel,
    messages,
    plants,
    right_edges,
    right_wheel,
    turn_share,
    volts_mean,
    volts_spread,
    way_error,
)
from tests.sampling import each_once


def left_roll(plant):
    Drive(plant).run(1.0, 0.6, 0.0)
    return abs(plant.chassis.heading)


def right_roll(plant):
    Drive(plant).run(1.0, 0.0, 0.6)
    return abs(plant.chassis.heading)


def speed_at_1s(plant):
    return sum(Drive(plant).run(1.0, 0.6, 0.6).final)


def button(plant):
    Drive(plant).run(0.5, 0.0, 0.0)
    return plant.button_pressed


def aside(plant):
    Drive(plant).run(1.0, 0.0, 0.0)
    return plant.truth().pose.y


def away(plant):
    Drive(plant).run(1.0, 0.0, 0.0)
    pose = plant.truth().pose
    return hypot(pose.x, pose.y)


def frames(plant):
    return len(messages(plant, Encoders))


def starts(plant):
    return messages(plant, Encoders)[-1].boot


def scans(plant):
    return len(messages(plant, Scan))


def scanned(plant):
    return fmean(messages(plant, Scan)[-1].distances[:5])


def late_echo(plant):
    Drive(plant).run(0.2, 0.0, 0.0)
    return plant.echo_us("front")


BOOK, BURGER = "book_2wd", "turtlebot3_burger"
BUTTON = ("robot.board.stop_button=24",)
OPEN = ("world.walls=[]",)

# The fault and the rest of its entry, the robot, what is measured, what the fault makes of it, and
# other settings.
ROWS = [
    ("edges_missed", "side: left, size: 0.5", BOOK, left_edges, LESS, ()),
    ("edges_doubled", "side: right, size: 0.5", BOOK, right_edges, MORE, ()),
    ("edges_halved", "side: left", BOOK, left_edges, LESS, ()),
    ("edges_silent", "side: right", BOOK, right_edges, LESS, ()),
    ("edges_chatter", "side: left, size: 5 ms", BOOK, left_edges, MORE, ()),
    ("encoder_dead", "side: right", BOOK, right_edges, LESS, ()),
    ("encoder_floating", "side: left", BOOK, left_edges, MORE, ()),
    ("encoder_reversed", "side: left", HALL_ROBOT, counted_left, LESS, ()),
    ("encoders_exchanged", "", BOOK, left_edges, LESS, ()),
    ("motor_dead", "side: left", BOOK, left_wheel, LESS, ()),
    ("motor_reversed", "side: right", BOOK, right_wheel, LESS, ()),
    ("motors_exchanged", "", BOOK, left_wheel, LESS, ()),
    ("wheel_blocked", "side: left", BOOK, left_wheel, LESS, ()),
    ("wheel_drag", "side: right, size: 0.2", BOOK, right_wheel, LESS, ()),
    ("wheel_slip", "size: 50 mm", BOOK, way_error, MORE, NO_SLIP),
    ("wheel_slide", "side: left, size: 0.5", BOOK, left_roll, LESS, ()),
    ("wheel_lifted", "side: right", BOOK, right_roll, LESS, ()),
    ("robot_pushed", "side: left", BOOK, aside, MORE, ()),
    ("robot_pushed", "side: right, for: 0.2 s, size: 0.1 m", BOOK, aside, LESS, ()),
    ("robot_moved", "at: 0.2 s", BOOK, away, MORE, ()),
    ("battery_step", "at: [0.1 s, 0.4 s], size: [0.5, 0.6]", BOOK, speed_at_1s, LESS, ()),
    ("battery_sag", "size: 0.5", BOOK, speed_at_1s, LESS, ()),
    ("battery_cut", "at: 0.2 s", BOOK, speed_at_1s, LESS, ()),
    ("board_reset", "at: 0.5 s", BOOK, starts, MORE, ()),
    ("stop_button", "", BOOK, button, MORE, BUTTON),
    ("link_cut", "at: 0.5 s, for: 1 s", BOOK, frames, LESS, ()),
    ("link_loss", "size: 0.5", BOOK, frames, LESS, ()),
    ("link_delay", "size: 0.5 s", BOOK, frames, LESS, ()),
    ("range_stuck", "sensor: front", BOOK, volts_spread, LESS, WALL),
    ("range_silent", "", BOOK, volts_mean, LESS, WALL),
    ("range_silent", "sensor: front", FOUR_SENSORS, late_echo, LESS, WALL),
    ("range_endless", "", FOUR_SENSORS, late_echo, MORE, WALL),
    ("lidar_zero", "", BURGER, scanned, LESS, WALL),
    ("lidar_late", "size: 1 s", BURGER, scans, LESS, WALL),
    ("lidar_blocked", "at: 1 s", BURGER, scans, LESS, WALL),
    ("imu_silent", "at: 1 s", BOOK, fault_time, LESS, IMU),
    ("imu_bus_held", "", BOOK, fault_time, LESS, IMU),
    ("imu_stuck", "at: 1 s", BOOK, fault_time, LESS, IMU),
    ("imu_biased", "size: 0.2 rad/s", BOOK, drift_at_rest, MORE, QUIET_IMU),
    ("imu_upside_down", "", BOOK, turn_share, LESS, QUIET_IMU),
    ("obstacle_appears", "at: 0.1 s, size: 0.15 m", BOOK, volts_mean, MORE, OPEN),
]
ELSEWHERE = {"link_damage", "operator_stop"}  # tested below, and those of programs with trials
OF_PROGRAMS = {"program_crash", "program_hang", "program_flood"}


def test_the_table_has_every_fault():
    assert {row[0] for row in ROWS} | ELSEWHERE | OF_PROGRAMS == set(FAULTS)


@each_once(row=ROWS, equations=["exponential", "torque"])
def test_the_effect_of_a_fault(row, equations):
    fault, more, robot, measure, relation, base = row
    entry = f"[{{fault: {fault}{', ' if more else ''}{more}}}]"
    equations = None if robot == BURGER else equations
    check(robot, equations, "faults", "[]", entry, measure, relation, base)


@pytest.mark.parametrize(
    ("more", "is_slow"), [("at: 2 s", False), ("for: 0.1 s", False), ("at: 0.5 s", True)]
)
def test_a_fault_acts_from_its_beginning_to_its_end(more, is_slow):
    entry = f"[{{fault: battery_step, size: 0.5, {more}}}]"
    with_fault, without = (
        [speed_at_1s(plant) for plant in plants(BOOK, "faults", value, (), None)]
        for value in (entry, "[]")
    )
    assert all((a < 0.8 * b) == is_slow for a, b in zip(with_fault, without, strict=True))


def test_the_operator_stops_and_resumes():
    fault = "robot.simulation.faults=[{fault: operator_stop, at: 0.5 s, for: 1 s}]"
    driver = simulated_robot_driver(load("goal", BOOK, [fault]), 0)
    wires = []
    for now in range(0, 2 * SECOND, SECOND // 10):
        wires += [(now / SECOND, each.wire) for each in driver.deliver(now)]
    sent = [(time, wire) for time, wire in wires if wire.startswith("operator.")]
    assert sent == [(0.5, "operator.halt"), (1.5, "operator.resume")]


def test_the_emulated_link_damages_bytes():
    faults = "robot.simulation.faults=[{fault: link_damage, size: 0.02}]"
    configuration = load("goal", BOOK, [faults])
    options = RunOptions(port="emulated", fast=True, duration=3.0)
    result = Run(configuration, options, tell=lambda text: None).go()
    assert result.link.damaged > 3
