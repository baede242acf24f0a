"""The motor models of the wheel filter, against their differential equations in small steps."""

from itertools import pairwise
from math import copysign

import pytest

from diffbotctl.control.motor_curve import settled_speed
from diffbotctl.estimation.predicted_wheel import LAG_DUTY, VISCOUS, MotorKind
from diffbotctl.estimation.wheel_kalman import WheelKalman
from diffbotctl.estimation.wheel_side import Priors

SLOTS, RATED, STATIC, LAG = 20, 10.0, 0.15, 0.1
PITCHES_PER_RAD = SLOTS / 6.283185307179586
FRICTION = STATIC / (1.0 - STATIC) * RATED * PITCHES_PER_RAD
STEP = 2e-5  # s
# Duties, each for a time in s: start, two duties that do not overcome the friction, coast, start,
# reverse, two low duties against the motion, coast.
PROGRAM = [
    (0.8, 0.3),
    (0.1, 0.03),
    (0.02, 0.02),
    (0.0, 0.5),
    (0.6, 0.25),
    (-0.7, 0.3),
    (0.2, 0.02),
    (0.1, 0.02),
    (0.0, 0.4),
]
SHORTED_SPEED = 2.0  # rad/s; the least at which a shorted motor brakes


def priors(brakes=False, shorted_speed=0.0):
    friction = FRICTION / PITCHES_PER_RAD
    return Priors(
        lag=LAG, friction=friction, dead_band=STATIC, brakes=brakes, shorted_speed=shorted_speed
    )


def linear(speed, duty, brakes, shorted_speed):
    """Acceleration (pitches/s2) of a motor that dry friction brakes."""
    if not speed:
        return settled_speed(duty, STATIC, RATED) * PITCHES_PER_RAD / LAG
    beyond = (duty - copysign(STATIC, speed)) / (1.0 - STATIC)
    return (beyond * RATED * PITCHES_PER_RAD - speed) / LAG


def free_wheeling(speed, duty, brakes, shorted_speed):
    """Acceleration (pitches/s2) by the torque: of the supply, the motion, and dry friction."""
    full = RATED * PITCHES_PER_RAD / (1.0 - STATIC)  # no-load speed without viscous friction
    if not speed and abs(duty) <= STATIC:
        return 0.0
    torque = duty - STATIC * copysign(1.0, speed or duty)
    induced = (abs(duty) + VISCOUS) * speed
    if brakes and not duty:
        induced += copysign(max(abs(speed) - shorted_speed * PITCHES_PER_RAD, 0.0), speed)
    return ((1.0 + VISCOUS) * full * torque - induced) / (LAG_DUTY * LAG)


def integrated(acceleration, brakes, shorted_speed):
    """Travel (pitches) and speed after each part of the program."""
    place = speed = 0.0
    for duty, seconds in PROGRAM:
        for _ in range(round(seconds / STEP)):
            change = acceleration(speed, duty, brakes, shorted_speed) * STEP
            following = speed + change
            if speed * following < 0.0:
                following = 0.0
            place += 0.5 * (speed + following) * STEP
            speed = following
        yield place, speed


BRAKING = [(False, 0.0), (True, 0.0), (True, SHORTED_SPEED)]


@pytest.mark.parametrize(("brakes", "shorted_speed"), BRAKING)
@pytest.mark.parametrize(
    ("kind", "acceleration"),
    [(MotorKind.LINEAR, linear), (MotorKind.FREE_WHEELING, free_wheeling)],
)
def test_each_kind_of_motor_moves_by_its_equation(kind, acceleration, brakes, shorted_speed):
    motion = WheelKalman(priors(brakes, shorted_speed), SLOTS, kind)
    motion.is_dry = True
    begin = motion.z
    for (duty, seconds), (place, speed) in zip(
        PROGRAM, integrated(acceleration, brakes, shorted_speed), strict=True
    ):
        drive = settled_speed(duty, STATIC, RATED) * PITCHES_PER_RAD
        motion.predict(seconds, drive, duty)
        assert motion.speed == pytest.approx(speed, abs=0.05)
        assert motion.z - begin == pytest.approx(place, abs=0.02)


def test_without_current_between_the_pulses_a_motor_settles_slowly_at_a_low_duty():
    """Time constants of 0.06 s over duty and viscous friction: 0.071 s at 0.8, 0.2 s at 0.25."""
    for duty, lag in ((0.8, 0.06 / 0.85), (0.25, 0.06 / 0.30)):
        motion = WheelKalman(priors(), SLOTS, MotorKind.FREE_WHEELING)
        drive = settled_speed(duty, STATIC, RATED) * PITCHES_PER_RAD
        speeds = [0.0]
        for _ in range(3):
            motion.predict(lag, drive, duty)
            speeds.append(motion.speed)
        rises = [after - before for before, after in pairwise(speeds)]
        for before, after in pairwise(rises):
            assert after / before == pytest.approx(0.3679, abs=1e-3)  # 1/e


def test_a_motor_without_current_coasts_until_dry_friction_stops_it():
    """From 30 pitches/s: friction takes FRICTION / 0.06 s = 93.6 pitches/s2, times 1.05, and more
    while it is fast; so it stops within 0.31 s."""
    motion = WheelKalman(priors(), SLOTS, MotorKind.FREE_WHEELING)
    motion.speed = 30.0
    motion.predict(0.25, 0.0, 0.0)
    assert 0.0 < motion.speed < 30.0 - 0.25 * 93.6
    motion.predict(0.06, 0.0, 0.0)
    assert motion.speed == 0.0


@pytest.mark.parametrize(("brakes", "shorted_speed"), BRAKING)
@pytest.mark.parametrize(
    ("kind", "is_dry"),
    [(MotorKind.LINEAR, True), (MotorKind.LINEAR, False), (MotorKind.FREE_WHEELING, True)],
)
def test_the_coasting_travel_is_what_the_wheel_rolls_after_a_release(
    kind, is_dry, brakes, shorted_speed
):
    motion = WheelKalman(priors(brakes, shorted_speed), SLOTS, kind)
    motion.is_dry = is_dry
    for speed in (-25.0, 3.0, 25.0):
        motion.speed, begin = speed, motion.z
        reported = motion.coasting_travel
        while motion.speed:
            motion.predict(0.002, 0.0, 0.0)
        # A wheel that nothing but its current brakes counts as stopped at the creep speed.
        stopped_early = 0.0 if is_dry else LAG * motion.priors.creep
        assert abs(motion.z - begin) == pytest.approx(reported, abs=stopped_early + 1e-3)


def test_a_shorted_motor_without_friction_rolls_on_at_the_speed_of_its_driver():
    """Below it nothing brakes the wheel but its viscous friction: the travel stays finite."""
    motion = WheelKalman(priors(True, SHORTED_SPEED), SLOTS, MotorKind.FREE_WHEELING)
    motion.is_dry, motion.speed = True, 25.0
    motion.offset = 2.0 * FRICTION  # the friction was overestimated by far
    assert 0.0 < motion.coasting_travel <= 25.0 * LAG
    motion.predict(0.5, 0.0, 0.0)
    assert 0.0 < motion.speed < 25.0


def test_with_unknown_friction_the_coasting_travel_lies_in_the_middle():
    travels = []
    for is_dry in (True, None, False):
        motion = WheelKalman(priors(), SLOTS)
        motion.is_dry, motion.speed = is_dry, 20.0
        travels.append(motion.coasting_travel)
    assert travels[1] == pytest.approx(0.5 * (travels[0] + travels[2]))
    assert travels[0] < travels[2] == pytest.approx(LAG * 20.0)
