"""The turn from a gyro: hand-worked sums, and the bias at rest."""

from math import degrees, radians, sqrt

import pytest

from diffbotctl.estimation.gyro_turn import BIAS_SD_MAX, GyroTurn
from diffbotctl.time import MILLISECOND, SECOND

FRAME = 25 * MILLISECOND
BIAS = radians(1.5)


def run(gyro, start, seconds, rate, is_at_rest, turn=0.0):
    """Frames with a constant true rate (rad/s); all steps, and the sum at the end."""
    steps = []
    for time in range(start, start + round(seconds * SECOND), FRAME):
        steps.append(gyro.update(time, turn, is_at_rest))
        turn += (rate + BIAS) * FRAME / SECOND
    return [step for step in steps if step is not None], turn


def test_two_seconds_at_rest_give_the_bias_and_no_turn():
    gyro = GyroTurn(1.0)
    steps, _ = run(gyro, 0, 1.9, 0.0, is_at_rest=True)
    assert gyro.is_zeroed
    assert gyro.bias == pytest.approx(BIAS, abs=radians(0.001))
    assert sqrt(gyro.variance) < BIAS_SD_MAX
    assert all(step.angle == 0.0 for step in steps)


@pytest.mark.parametrize("scale", [1.0, 0.97])
def test_a_turn_is_the_sum_without_the_bias_times_the_scale(scale):
    gyro = GyroTurn(scale)
    _, turn = run(gyro, 0, 2.0, 0.0, is_at_rest=True)
    steps, _ = run(gyro, 2 * SECOND, 1.0, radians(90.0), is_at_rest=False, turn=turn)
    expected = 90.0 * scale * (1.0 - FRAME / SECOND)  # the first step ends the rest
    assert degrees(sum(step.angle for step in steps)) == pytest.approx(expected, abs=0.05)
    assert sum(step.seconds for step in steps) == pytest.approx(1.0)


def test_the_bias_is_less_well_known_the_longer_the_robot_moves():
    gyro = GyroTurn(1.0)
    _, turn = run(gyro, 0, 2.0, 0.0, is_at_rest=True)
    before = gyro.variance
    run(gyro, 2 * SECOND, 30.0, 0.0, is_at_rest=False, turn=turn)
    assert degrees(sqrt(gyro.variance - before)) == pytest.approx(0.0707, abs=0.001)


def test_a_robot_that_is_turned_by_hand_turns():
    """Its wheels stand, and the rate is no bias."""
    gyro = GyroTurn(1.0)
    _, turn = run(gyro, 0, 1.9, 0.0, is_at_rest=True)
    bias = gyro.bias
    angle, start = 0.0, 1900 * MILLISECOND
    for rate in (0.0, 30.0, 60.0, 20.0, 50.0, 30.0):  # deg/s, for a quarter of a second each
        steps, turn = run(gyro, start, 0.25, radians(rate), is_at_rest=True, turn=turn)
        start += 250 * MILLISECOND
        angle += sum(step.angle for step in steps)
    assert degrees(angle) == pytest.approx(190.0 / 4.0, abs=12.0)
    assert gyro.bias == pytest.approx(bias, abs=radians(0.05))


def test_a_hand_that_turns_the_robot_unseen_is_not_in_the_first_bias():
    """By 0.8 deg within 0.4 s, which no edge shows."""
    gyro = GyroTurn(1.0)
    _, turn = run(gyro, 0, 0.5, 0.0, is_at_rest=True)
    _, turn = run(gyro, SECOND // 2, 0.4, radians(2.0), is_at_rest=True, turn=turn)
    run(gyro, 9 * SECOND // 10, 2.0, 0.0, is_at_rest=True, turn=turn)
    assert gyro.is_zeroed
    assert gyro.bias == pytest.approx(BIAS, abs=radians(0.01))


def test_a_sum_that_begins_again_is_no_turn():
    gyro = GyroTurn(1.0)
    run(gyro, 0, 2.0, 0.0, is_at_rest=True)
    gyro.restart()
    assert gyro.update(3 * SECOND, -20.0, False) is None
    step = gyro.update(3 * SECOND + FRAME, -20.0 + BIAS * FRAME / SECOND, False)
    assert step is not None and step.angle == pytest.approx(0.0, abs=1e-5)
