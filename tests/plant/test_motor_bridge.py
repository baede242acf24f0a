"""The motor driver of the plant: drop, decay, rest and heat, by hand."""

import ast
from math import copysign, exp
from pathlib import Path
from random import Random

import pytest

from diffbotctl.config.faults import FaultEntry
from diffbotctl.config.motor_drivers import MOTOR_DRIVERS
from diffbotctl.config.simulation import BatteryTruth, MotorTruth
from diffbotctl.messages import Duty
from diffbotctl.plant.battery import RecoveringBattery
from diffbotctl.plant.motor_bridge import (
    ELECTRICAL_TIME_S,
    HEAT_TIME_S,
    IDEAL_BRIDGE,
    PULSE_S,
    BridgeHeat,
    BridgeModel,
    bridge_model,
)
from diffbotctl.plant.torque_drive import TorqueDrive, TorqueWheel
from diffbotctl.time import SECOND
from tests.plant.test_simulated_robot import driven, robot
from tests.plant.test_torque_drive import FIRM, IDEAL, MOTOR, SETUP

PACKAGE = Path(__file__).parents[2] / "diffbotctl"
BIPOLAR = BridgeModel(threshold=0.2)


def drive(bridge, truth=FIRM, shorted=0.0):
    wheels = tuple(TorqueWheel(MOTOR, IDEAL, Random(1)) for _ in range(2))
    battery = RecoveringBattery(truth, 8.0, bridge)
    made = TorqueDrive(wheels, SETUP._replace(bridge=bridge), battery)
    made.set_shorted(shorted, shorted)
    return made


@pytest.mark.parametrize("duty, speed", [(1.0, 18.0), (0.5, 8.0), (0.2, 2.0), (-0.5, -8.0)])
def test_slow_decay_is_linear_in_the_duty(duty, speed):
    # w0 (duty - friction) = 20 (duty - 0.1)
    made = drive(IDEAL_BRIDGE, shorted=1.0)
    made.advance(10 * SECOND, (duty, duty))
    assert [wheel.speed for wheel in made.wheels] == pytest.approx([speed, speed], abs=0.01)


@pytest.mark.parametrize("driver", MOTOR_DRIVERS)
def test_the_full_battery_reaches_the_rated_speed_with_every_driver(driver):
    made = drive(bridge_model(MOTOR_DRIVERS[driver].bridge, 8.0, None))
    made.advance(10 * SECOND, (1.0, 1.0))
    assert made.wheels[0].speed == pytest.approx(18.0, abs=0.01)


@pytest.mark.parametrize(
    ("threshold", "share", "supply"),
    [
        (0.0, 0.75, 0.75),
        (0.2, 1.0, 1.0),
        (0.2, 0.6, 0.5),  # 4.8 - 1.6 V of 8.0 - 1.6 V
        (0.2, 0.1, 0.0),  # less than the threshold
    ],
)
def test_a_threshold_does_not_shrink_with_the_battery(threshold, share, supply):
    assert BridgeModel(threshold).supply(share) == pytest.approx(supply)
    made = drive(BridgeModel(threshold), BatteryTruth(volts=8.0 * share, sag=0.0))
    made.advance(10 * SECOND, (1.0, 1.0))
    assert made.wheels[0].speed == pytest.approx(max(20 * (supply - 0.1), 0.0), abs=0.01)


def test_a_bipolar_bridge_does_not_brake_below_its_threshold():
    speeds = []
    for is_shorted in (False, True):
        made = drive(BIPOLAR)
        made.advance(10 * SECOND, (1.0, 1.0))
        made.set_shorted(is_shorted, is_shorted)
        until = 10 * SECOND + 105_000_000  # 5 ms of dead time, then 0.1 s
        made.advance(until, (0.0, 0.0))
        speeds.append(made.wheels[0].speed)
    # The threshold is a quarter of the voltage at the motors: 5 rad/s.
    # Friction alone: 20 rad/s2. Braked: v' = -20 - 10 (v - 5), so v = 3 + 15 exp(-10 t).
    assert speeds == pytest.approx([16.0, 3 + 15 * exp(-1)], abs=0.1)


@pytest.mark.parametrize("speed", [-0.3, 0.05, 0.2, 0.5, 0.9])
@pytest.mark.parametrize("duty", [0.05, 0.2, 0.5, 0.9])
@pytest.mark.parametrize("threshold", [0.0, 0.18])
def test_the_mean_current_is_that_of_a_pulse(threshold, duty, speed):
    """Integrated in steps of 2 us, with the current dying in transistors and diodes."""
    drop, step = threshold / (1.0 - threshold), 2e-6
    current = mean = 0.0
    pulse = round(PULSE_S / step)
    for number in range(20 * pulse):
        if number % pulse < duty * pulse:  # driven; a current against it returns through the diodes
            voltage = 1.0 + (2.0 * drop if current < 0.0 else 0.0)
        elif current:
            voltage = -copysign(drop, current)
        else:
            voltage = max(-drop, min(drop, speed))
        before = current
        current += (voltage - speed - current) * step / ELECTRICAL_TIME_S
        if before * current < 0.0:
            current = 0.0
        if number >= 19 * pulse:
            mean += current / pulse
    found = BridgeModel(threshold).mean_current(duty, 1.0, speed, 1.0 - duty)
    assert found == pytest.approx(mean, abs=0.02)


def test_the_heat_of_a_stall_and_its_end():
    # Twice the continuous current: four times its heat. 1.2 is reached after 10 s log(4 / 2.8).
    heat = BridgeHeat(BridgeModel(stall_load=2.0, shuts_down=True))
    seconds = 0.0
    while not heat.is_off:
        heat.update((1.0, 0.0), 0.02)
        seconds += 0.02
    assert seconds == pytest.approx(3.57, abs=0.03)
    seconds = 0.0
    while heat.is_off:
        heat.update((1.0, 0.0), 0.02)  # no current flows, whatever the duty
        seconds += 0.02
    assert seconds == pytest.approx(HEAT_TIME_S * 0.143, abs=0.06)  # log(1.2 / 1.04)


@pytest.mark.parametrize("stall_load, shuts_down", [(None, True), (2.0, False), (1.0, True)])
def test_what_does_not_switch_off(stall_load, shuts_down):
    heat = BridgeHeat(BridgeModel(stall_load=stall_load, shuts_down=shuts_down))
    heat.update((1.0, 1.0), 1000.0)
    assert not heat.is_off


@pytest.mark.parametrize(
    ("shorted", "duty", "speed", "current"),
    [
        (0.0, 1.0, 0.0, 1.0),
        (0.0, 0.25, 0.5, 0.25),  # half the stall current, a quarter of the time
        (0.75, 0.25, 0.0, 0.25),
        (0.75, 0.25, 0.5, 0.25),  # it brakes
    ],
)
def test_currents(shorted, duty, speed, current):
    assert IDEAL_BRIDGE.current(duty, 1.0, speed, shorted) == pytest.approx(current)


@pytest.mark.parametrize("equations", ["exponential", "torque"])
def test_a_blocked_robot_loses_its_motors_for_a_while(equations):
    """The stock board has no speed loop that would notice the stall before."""
    hot = BridgeModel(stall_load=2.0, shuts_down=True)
    made = robot(
        "stock",
        equations=equations,
        motor=MotorTruth(gain_spread=0.0, ripple=0.0),
        faults=[FaultEntry(fault="wheel_blocked", side="left")],
        machine={"bridge": hot, "shorted_between": 1.0},
    )
    driven(made, 3.0, 1.0, 1.0, Duty)
    assert made.truth().right_speed > 8.0
    driven(made, 5.0, 1.0, 1.0, Duty)
    assert made.truth().right_speed < 4.0  # one chip drives both motors
    speeds = []
    for seconds in range(60, 90):
        driven(made, 0.1 * seconds, 1.0, 1.0, Duty)
        speeds.append(made.truth().right_speed)
    assert max(speeds) > 6.0


@pytest.mark.parametrize("folder", ["estimation", "blocks", "control", "calibrate"])
def test_no_estimator_reads_the_driver_s_figures(folder):
    for file in (PACKAGE / folder).rglob("*.py"):
        for node in ast.walk(ast.parse(file.read_text())):
            names = [node.module] if isinstance(node, ast.ImportFrom) else []
            if isinstance(node, ast.Import):
                names = [alias.name for alias in node.names]
            assert "diffbotctl.config.motor_drivers" not in names, f"{file} knows the plant"
