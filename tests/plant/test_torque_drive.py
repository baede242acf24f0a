"""The plant with torques: its steady states by hand, friction, battery, and its independence."""

from math import pi
from random import Random

import pytest

from diffbotctl.config.faults import FaultEntry
from diffbotctl.config.simulation import BatteryTruth, EncoderTruth, MotorTruth
from diffbotctl.messages import Duty
from diffbotctl.params import Spread
from diffbotctl.plant.battery import RecoveringBattery
from diffbotctl.plant.encoder_disc import EncoderDisc
from diffbotctl.plant.torque_drive import (
    Caster,
    DriveSetup,
    TorqueDrive,
    TorqueMotor,
    TorqueWheel,
    draw_setup,
    draw_torque_motor,
)
from diffbotctl.plant.wheel import MotorModel
from diffbotctl.time import MILLISECOND, SECOND
from tests.plant.test_simulated_robot import driven, robot
from tests.sampling import by_day

PITCH = 2 * pi / 20
IDEAL = EncoderDisc(tuple(k * PITCH / 2 for k in range(40)), 0.0, 0.0)
# 20 rad/s without friction; 200 rad/s2: a time constant of 0.1 s at full duty.
MOTOR = TorqueMotor(20.0, 200.0, 0.15, 0.1, 0.0, 0.5, 0.0, 0.0)
SETUP = DriveSetup(0.03, 0.03, 0.12, 1.3, 5, Caster(-0.08, 0.02, 0.0))
FIRM = BatteryTruth(sag=0.0)


def drive(truth=FIRM, motor=MOTOR, setup=SETUP):
    wheels = tuple(TorqueWheel(motor, IDEAL, Random(1)) for _ in range(2))
    return TorqueDrive(wheels, setup, RecoveringBattery(truth, 8.0))


@pytest.mark.parametrize("duty, speed", [(1.0, 18.0), (0.5, 16.0), (0.2, 10.0), (-0.5, -16.0)])
def test_a_wheel_settles_at_the_speed_of_friction_over_duty(duty, speed):
    # w0 (1 - friction / |duty|) = 20 (1 - 0.1 / |duty|)
    made = drive()
    made.advance(10 * SECOND, (duty, duty))
    assert [wheel.speed for wheel in made.wheels] == pytest.approx([speed, speed], abs=0.01)


def test_a_wheel_below_its_static_friction_rests_and_one_in_motion_goes_on():
    made = drive()
    made.advance(SECOND, (0.14, 0.14))
    assert [wheel.angle for wheel in made.wheels] == [0.0, 0.0]
    made.advance(2 * SECOND, (0.5, 0.5))
    made.advance(12 * SECOND, (0.14, 0.14))
    assert made.wheels[0].speed == pytest.approx(20 * (1 - 0.1 / 0.14), abs=0.02)


def test_only_friction_stops_a_wheel_without_drive():
    made = drive()
    made.advance(10 * SECOND, (1.0, 1.0))
    before = made.wheels[0].angle
    made.advance(12 * SECOND, (0.0, 0.0))
    # From 18 rad/s at 0.1 x 200 rad/s2: 8.1 rad, and 5 ms of dead time at 18 rad/s. Static friction
    # takes over below half a radian per second.
    assert made.wheels[0].speed == 0.0
    assert made.wheels[0].angle - before == pytest.approx(8.1 + 0.09, abs=0.05)


def test_shorted_windings_brake():
    made = drive()
    made.set_shorted(1.0, 1.0)
    made.advance(10 * SECOND, (1.0, 1.0))
    before = made.wheels[0].angle
    made.advance(11 * SECOND, (0.0, 0.0))
    # v' = -2 - 10 v from 18: the angle is (18 - 2 log(1 + 18 / 2)) / 10.
    assert made.wheels[0].angle - before == pytest.approx(1.34 + 0.09, abs=0.03)


def test_opposite_torques_accelerate_faster_than_equal_ones():
    straight, turn = drive(), drive()
    straight.advance(25 * MILLISECOND, (1.0, 1.0))
    turn.advance(25 * MILLISECOND, (1.0, -1.0))
    assert turn.wheels[0].speed / straight.wheels[0].speed == pytest.approx(1.3, rel=0.05)


def test_the_calls_change_nothing():
    rng = Random(3)
    once, often, now, edges = drive(), drive(), 0, []
    while now < 2 * SECOND:
        now = min(now + rng.randrange(1, 30 * MILLISECOND), 2 * SECOND)
        edges += often.advance(now, (0.6, 0.4))[0]
    assert list(once.advance(2 * SECOND, (0.6, 0.4))[0]) == edges
    assert once.wheels[1].angle == often.wheels[1].angle


def test_a_caster_that_swivels_pulls_the_robot_off_its_line():
    made = drive(setup=SETUP._replace(caster=Caster(-0.08, 0.02, 0.05)))
    made.advance(2 * SECOND, (0.4, 0.4))
    made._caster_angle += 2.0
    made.advance(2 * SECOND + 100 * MILLISECOND, (0.4, 0.4))
    left, right = made.wheels
    assert abs(left.speed - right.speed) > 0.1
    made.advance(6 * SECOND, (0.4, 0.4))
    assert left.speed == pytest.approx(right.speed, abs=0.01)


def test_a_battery_recovers_slowly():
    battery = RecoveringBattery(BatteryTruth(sag=0.2), 8.0)
    battery.load(0.5, 100.0)  # the load at which the stated sag is lost
    assert battery.share == pytest.approx(0.8, abs=0.001)
    battery.load(0.0, 1e-6)
    assert battery.share == pytest.approx(0.9, abs=0.001)  # half of it comes back at once
    battery.load(0.0, 3.0)
    assert battery.share == pytest.approx(0.964, abs=0.002)  # 1 - 0.2 x 0.2 x exp(-3 / 25)
    battery.load(0.0, 200.0)
    assert battery.share == pytest.approx(1.0, abs=1e-4)


@pytest.mark.parametrize("seed", by_day(1, range(5)))
def test_a_drawn_motor_reaches_the_stated_speed_at_full_duty(seed):
    model = MotorModel(speed=10.0, lag=0.1, start=0.16, keep=0.12)
    motor = draw_torque_motor(model, Random(seed))
    made = drive(
        motor=motor,
        setup=draw_setup((0.03, 0.03), 0.12, Random(seed))._replace(
            caster=Caster(-0.08, 0.02, 0.0)
        ),
    )
    made.advance(10 * SECOND, (1.0, 1.0))
    assert made.wheels[0].speed == pytest.approx(10.0, rel=0.01)


@pytest.mark.parametrize("equations", ["exponential", "torque"])
def test_a_fault_blocks_one_wheel_for_its_time(equations):
    second = Spread(1.0, 1.0)
    blocked = FaultEntry(fault="wheel_blocked", at=second, duration=second, side="left")
    made = robot("stock", equations=equations, faults=[blocked])
    speeds = []
    for second in range(1, 4):
        driven(made, second, 0.6, 0.6, Duty)
        speeds.append((made.truth().left_speed, made.truth().right_speed))
    assert speeds[0][0] > 3.0 and speeds[1][0] == 0.0 and speeds[2][0] > 3.0
    assert all(right > 3.0 for _, right in speeds)


@pytest.mark.parametrize("equations", ["exponential", "torque"])
@pytest.mark.parametrize("volts, ratio", [(3.8, 0.45), (7.6, 1.0)])
def test_the_battery_decides_the_speed(equations, volts, ratio):
    truth = MotorTruth(gain_spread=0.0, start_duty=(0.1, 0.1), ripple=0.0)
    made = robot(
        "stock", equations=equations, motor=truth, battery=BatteryTruth(volts=volts, sag=0.0)
    )
    driven(made, 5.0, 1.0, 1.0, Duty)
    # Of half the voltage friction takes as much as of the whole: (0.5 - 0.08) / (1 - 0.08).
    assert made.truth().left_speed == pytest.approx(10.47 * ratio, rel=0.05)


@pytest.mark.parametrize("equations", ["exponential", "torque"])
@pytest.mark.parametrize("errors, ratio", [({"missed": 0.2}, 0.8), ({"doubled": 0.1}, 1.1)])
def test_edges_are_missed_and_come_twice(equations, errors, ratio):
    made = robot("edges", equations=equations, encoder=EncoderTruth(**errors))
    frames = [message for _, message in driven(made, 60.0, 6.0, 6.0) if hasattr(message, "boot")]
    truth = made.truth()
    turned = (truth.left_angle + truth.right_angle) / PITCH
    assert frames[-1].left + frames[-1].right == pytest.approx(ratio * turned, rel=0.03)


@pytest.mark.parametrize("equations", ["exponential", "torque"])
def test_backlash_is_lost_at_each_reversal(equations):
    motor = MotorTruth(backlash=0.1, gain_spread=0.0)
    made = robot("stock", equations=equations, motor=motor, slip=0.0)
    start = made.truth()
    driven(made, 2.0, 0.6, 0.6, Duty)
    out = made.truth()
    # The wheels stand in the middle of their play at first.
    way = 0.5 * (out.left_angle + out.right_angle) * 0.0325
    assert way - out.travel == pytest.approx(0.05 * 0.0325, rel=0.02)
    assert start.travel == 0.0


@pytest.mark.nightly
@pytest.mark.parametrize("equations", ["exponential", "torque"])
def test_slip_has_the_stated_spread(equations):
    rests = []
    for seed in range(150):
        made = robot("stock", seed, equations=equations, slip=0.02)
        driven(made, 3.0, 0.8, 0.8, Duty)
        truth = made.truth()
        chassis = made.chassis
        expected = (truth.right_angle - truth.left_angle) * chassis.left_radius / chassis.track
        way = truth.right_angle * chassis.right_radius
        rests.append((truth.pose.heading - expected) * chassis.track / (2 * way) ** 0.5)
    rms = (sum(rest**2 for rest in rests) / len(rests)) ** 0.5
    assert rms == pytest.approx(0.02, rel=0.25)  # four standard deviations of 150 draws
