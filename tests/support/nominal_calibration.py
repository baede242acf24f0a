"""The results that a calibration would write for a simulated robot, from its truth, with errors."""

from __future__ import annotations

from math import nan, pi
from random import Random
from statistics import fmean
from typing import Any

import numpy as np

from diffbotctl.calibrate.dead_reckoning import EndError, Geometry, dead_reckon
from diffbotctl.calibrate.end_noise import POSITION
from diffbotctl.calibrate.motor_curve import fit_curves
from diffbotctl.calibrate.motor_experiments import (
    BREAKAWAY_RESOLUTION,
    DIRECTIONS,
    DUTY_LEVELS,
)
from diffbotctl.calibrate.motor_fit import SPEED_POINTS_MIN, fit_line
from diffbotctl.calibrate.motor_lag import LagFit
from diffbotctl.calibrate.steps.motors import MotorFit, motor_findings
from diffbotctl.calibrate.steps.squares import RUNS_PER_DIRECTION
from diffbotctl.calibrate.umbmark import (
    DrivenSquare,
    SquareErrors,
    SquaresFit,
    advised_side,
    fit_squares,
)
from diffbotctl.config.robot import SIDES, Robot
from diffbotctl.plant.battery import RecoveringBattery, SimulatedBattery
from diffbotctl.plant.chassis import Chassis
from diffbotctl.plant.drive_train import DriveTrain, ExponentialDrive
from diffbotctl.plant.encoder_disc import EncoderDisc
from diffbotctl.plant.simulated_robot import SimulatedRobot
from diffbotctl.plant.torque_drive import TorqueDrive, TorqueWheel
from diffbotctl.plant.wheel import WheelModel
from diffbotctl.time import MILLISECOND, SECOND

# Relative errors (standard deviations) of the steps of `calibrate`, as its report states them.
TRACK_ERROR, DIAMETER_ERROR, SPEED_ERROR, LAG_ERROR = 0.003, 0.0015, 0.003, 0.05
LAG_MAX, LOOP_SPEED_MAX = 0.79, 0.75  # of the robot file
TURNING_MIN = 0.2  # rad/s
WEAK_MOTOR = [(1.0, 1.0), (0.9, 0.85), (0.8, 0.7)]  # turns only near full duty
STEP_LOW, STEP_HIGH = 0.35, 0.75  # duties of the steps that measure the lag
SETTLING_LAGS = 12.0  # twice of what an exponential needs: at a low duty some motors are slower
COARSE = EncoderDisc((0.1, pi), 0.0, 0.0)  # its edges cost no time, and are not looked at

Findings = dict[str, dict[str, Any]]


def calibrate(plant: SimulatedRobot, nominal: Robot, rng: Random) -> Findings:
    """The section `calibration` for `plant`."""
    findings: Findings = {}
    for finding in motor_findings(nominal, _motors(plant, rng)):
        value = finding.value
        if finding.field.endswith(".loop.speed"):
            value = min(value, LOOP_SPEED_MAX)
        findings[finding.field] = _entry(value, finding.sd, "motors")
    _add_geometry(findings, plant.chassis, rng)
    slip = _slip(plant, rng)
    findings["drive.slip"] = _entry(slip.slip, slip.slip_sd, "squares")
    return findings


def _add(findings: Findings, path: str, value: float, error: float, method: str) -> None:
    findings[path] = _entry(value, error * value, method)


def _entry(value: Any, sd: float | None, method: str) -> dict[str, Any]:
    entry = {"value": value, "date": "2026-01-01", "method": method}
    return entry if sd is None else entry | {"sd": sd}


def _add_geometry(findings: Findings, chassis: Chassis, rng: Random) -> None:
    track = chassis.track * (1.0 + rng.gauss(0.0, TRACK_ERROR))
    _add(findings, "drive.track", track, TRACK_ERROR, "squares")
    for side, radius in zip(SIDES, (chassis.left_radius, chassis.right_radius), strict=True):
        diameter = 2.0 * radius * (1.0 + rng.gauss(0.0, DIAMETER_ERROR))
        _add(findings, f"drive.{side}.wheel.diameter", diameter, DIAMETER_ERROR, "straight")


def _slip(plant: SimulatedRobot, rng: Random) -> SquaresFit:
    """What `calibrate geometry` would find from the ends of its squares."""
    chassis = plant.chassis
    geometry = Geometry(2.0 * chassis.right_radius, 2.0 * chassis.left_radius, chassis.track)
    side = advised_side(chassis.track)
    noise = np.random.default_rng(rng.getrandbits(32))
    ends = []
    for clockwise in (True, False):
        square = DrivenSquare("", side, geometry, clockwise, EndError(0.0, 0.0))
        slipped = plant.simulation.slip**2 * dead_reckon(square.segment, geometry).slip
        covariance = slipped[:2, :2] + POSITION.typical**2 * np.eye(2)
        drawn = noise.multivariate_normal(np.zeros(2), covariance, RUNS_PER_DIRECTION)
        ends.append([EndError(x, y, nan) for x, y in drawn])
    return fit_squares([(geometry, SquareErrors(side, *ends))])


def _motors(plant: SimulatedRobot, rng: Random) -> dict[str, MotorFit]:
    """What `calibrate motors` fits to the speeds that it would measure."""
    points: dict[str, list[tuple[float, float]]] = {side: [] for side in SIDES}
    for duty in DUTY_LEVELS:
        for side, speed in zip(SIDES, _settled(plant, duty), strict=True):
            if speed > TURNING_MIN:
                points[side].append((duty, speed * (1.0 + rng.gauss(0.0, SPEED_ERROR))))
    curves = (
        fit_curves(points) if all(len(rows) > SPEED_POINTS_MIN for rows in points.values()) else {}
    )
    motors = {}
    for number, side in enumerate(SIDES):
        lag = max(_lag(plant, number) * (1.0 + rng.gauss(0.0, LAG_ERROR)), 0.01)
        fitted_lag = LagFit(min(lag, LAG_MAX), 0.0, LAG_ERROR * lag)
        rows = points[side] if len(points[side]) >= SPEED_POINTS_MIN else WEAK_MOTOR
        line = fit_line(rows)
        duty = plant.motors[number].start
        # Its draw does not advance `rng`: the other errors stay as they are without it.
        duty += BREAKAWAY_RESOLUTION * Random(f"breakaway {duty}").uniform(-0.5, 0.5)
        start = dict.fromkeys(DIRECTIONS, duty)
        motors[side] = MotorFit(
            start, rows, dict.fromkeys(DIRECTIONS, line), fitted_lag, curves.get(side) or line
        )
    return motors


def _settled(plant: SimulatedRobot, duty: float) -> list[float]:
    drive, battery = _bare_drive(plant)
    settling = _settling_time(plant)
    _spin(drive, battery, settling, duty)
    before = [wheel.angle for wheel in drive.wheels]
    _spin(drive, battery, settling + settling // 3, duty)
    seconds = settling // 3 / SECOND
    return [
        (wheel.angle - angle) / seconds for wheel, angle in zip(drive.wheels, before, strict=True)
    ]


def _settling_time(plant: SimulatedRobot) -> int:
    """Time (ns) after which the speeds are constant, a multiple of 3 ms."""
    seconds = SETTLING_LAGS * max(motor.lag for motor in plant.motors)
    return round(seconds * SECOND) // (3 * MILLISECOND) * 3 * MILLISECOND


def _lag(plant: SimulatedRobot, number: int) -> float:
    """The area between steps of the duty, one up and one down, and the speed of a wheel, over their
    height, s."""
    drive, battery = _bare_drive(plant)
    settling = _settling_time(plant)
    wheel = drive.wheels[number]
    speeds, ways = [], []
    for count, duty in enumerate((STEP_LOW, STEP_HIGH, STEP_LOW), 1):
        start = wheel.angle
        _spin(drive, battery, count * settling, duty)
        speeds.append(wheel.speed)
        ways.append(wheel.angle - start)
    slow, fast, slow_again = speeds
    if fast - slow < 0.1:
        return fmean(motor.lag for motor in plant.motors)
    _, way_up, way_down = ways
    seconds = settling / SECOND
    return 0.5 * (fast * seconds - way_up + way_down - slow_again * seconds) / (fast - slow)


def _spin(drive: DriveTrain, battery: SimulatedBattery, until: int, duty: float) -> None:
    voltage = duty * battery.voltage_ratio(duty, duty)
    drive.advance(until // MILLISECOND * MILLISECOND, (voltage, voltage))


def _bare_drive(plant: SimulatedRobot) -> tuple[DriveTrain, SimulatedBattery]:
    """The motors of `plant` at rest, with a fresh battery and nearly no edges, without ripple.

    A calibration takes means over whole turns, in which the ripple is no more seen.
    """
    simulation, full = plant.simulation, plant.parameters.full
    if isinstance(plant.drive, TorqueDrive):
        charged = RecoveringBattery(simulation.battery, full)
        left, right = (
            TorqueWheel(wheel.motor._replace(cog=0.0), COARSE, Random(1))
            for wheel in plant.drive.wheels
        )
        return TorqueDrive((left, right), plant.drive.setup, charged), charged
    wheels = tuple(
        WheelModel(motor._replace(ripple=0.0), COARSE, Random(1)) for motor in plant.motors
    )
    return ExponentialDrive(wheels), SimulatedBattery(simulation.battery, full)
