"""Encoders with two channels in the plant: both equations, both directions."""

from math import pi

import pytest

from diffbotctl.config.load import load_robot
from diffbotctl.messages import Encoders
from diffbotctl.plant.quadrature import edges_of_two, levels_of_two
from diffbotctl.plant.simulated_robot import draw_robot
from diffbotctl.time import SECOND
from tests.pico_robot import PICO

HALL = [
    "robot.drive.encoder.channels=2",
    "robot.drive.encoder.slots=100",
    "robot.drive.left.encoder.pin_b=22",
    "robot.drive.right.encoder.pin_b=23",
]


def plant(*sets):
    file = load_robot(None, [*HALL, *sets])
    return draw_robot(file.robot, file.nominal, 5)


def counts(robot, seconds):
    """Left and right counts of the last frame after `seconds`."""
    robot.advance(robot.now + round(seconds * SECOND))
    frames = [message for _, message in robot.deliver() if isinstance(message, Encoders)]
    return frames[-1].left, frames[-1].right


def test_b_is_in_the_middle_between_the_edges_of_a():
    assert edges_of_two((0.0, 0.4, 1.0, 1.6), 2.0) == pytest.approx(
        (0.0, 0.2, 0.4, 0.7, 1.0, 1.3, 1.6, 1.8)
    )
    assert [levels_of_two(index) for index in range(5)] == [(0, 0), (1, 0), (1, 1), (0, 1), (0, 0)]


@pytest.mark.parametrize(("board", "counts_of_slot"), [([], 1), (PICO, 4)], ids=["mega", "pico"])
@pytest.mark.parametrize("equations", ["exponential", "torque"])
def test_a_wheel_turned_by_hand(equations, board, counts_of_slot):
    """A turn forward and two backward; without any command."""
    robot = plant(f"robot.simulation.equations={equations}", *board)
    start = counts(robot, 0.1)
    robot.turn_by_hand(0, 2 * pi, 4.0)
    forward = counts(robot, 2.0)
    robot.turn_by_hand(0, -4 * pi, 4.0)
    backward = counts(robot, 4.0)
    assert forward[0] - start[0] == pytest.approx(100 * counts_of_slot, abs=1)
    assert backward[0] - forward[0] == pytest.approx(-200 * counts_of_slot, abs=1)
    assert backward[1] == start[1]


@pytest.mark.parametrize(
    ("wiring", "setting", "sign"),
    [("exchanged", "false", -1), ("exchanged", "true", 1), ("plain", "true", -1)],
)
def test_exchanged_channels_count_down_until_the_setting_states_it(wiring, setting, sign):
    robot = plant(
        f"robot.simulation.wiring.left_encoder={wiring}",
        f"robot.drive.left.encoder.reversed={setting}",
    )
    start = counts(robot, 0.1)
    robot.turn_by_hand(0, 2 * pi, 4.0)
    assert sign * (counts(robot, 2.0)[0] - start[0]) == pytest.approx(100, abs=1)


def test_rocking_over_edges_adds_nothing():
    robot = plant()
    start = counts(robot, 0.1)
    for _ in range(50):
        for angle in (0.03, -0.03):  # half a pitch
            robot.turn_by_hand(0, angle, 3.0)
            robot.advance(robot.now + SECOND // 50)
    assert counts(robot, 0.2)[0] - start[0] in (-1, 0, 1)
