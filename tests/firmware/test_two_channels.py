"""Two-channel encoders: the firmware on the emulated boards, and the host behind it."""

from math import pi
from pathlib import Path

import pytest

import diffbotctl.testing
from diffbotctl.config.load import load
from diffbotctl.emulator.emulated_robot import emulated_robot_driver
from diffbotctl.messages import Encoders
from diffbotctl.testing.board_bench import MEGA_BOARD, PICO_BOARD, UNO_BOARD, trials_on
from diffbotctl.testing.trials import two_channels
from diffbotctl.time import SECOND

ROBOTS = Path(diffbotctl.testing.__file__).parent
BOARDS = pytest.mark.parametrize(
    "board", [MEGA_BOARD, UNO_BOARD, PICO_BOARD], ids=["mega2560", "uno", "pico"]
)


@BOARDS
def test_no_count_is_lost_at_full_speed(board):
    with trials_on(board):
        rows = list(two_channels.full_speed(seconds=0.2))
    for row in rows:
        assert row.met, row.line()


@BOARDS
def test_a_rocking_wheel_adds_nothing(board):
    with trials_on(board):
        (row,) = two_channels.rocking()
    assert row.met, row.line()


@pytest.mark.parametrize("robot", ["mega_hall.yaml", "uno_hall.yaml"])
@pytest.mark.parametrize("wiring", ["plain", "exchanged"])
def test_a_wheel_turned_by_hand_counts_in_its_direction(robot, wiring):
    """A quarter turn forward, half a turn backward, without any command."""
    sets = [f"robot.simulation.wiring.left_encoder={wiring}"]
    driver = emulated_robot_driver(load("goal", str(ROBOTS / robot), sets), 3)
    counts = []

    def run(seconds):
        for delivery in driver.deliver(driver.board.now + round(seconds * SECOND)):
            if isinstance(delivery.message, Encoders):
                counts.append((delivery.message.left, delivery.message.right))
        return counts[-1]

    try:
        before = run(3)
        driver.robot.turn_by_hand(0, 0.5 * pi, pi)
        forward = run(1)
        driver.robot.turn_by_hand(0, -pi, pi)
        after = run(1.5)
    finally:
        driver.close()
    sign = 1 if wiring == "plain" else -1
    assert sign * (forward[0] - before[0]) == pytest.approx(330, abs=1)
    assert sign * (after[0] - forward[0]) == pytest.approx(-660, abs=1)
    assert after[1] == before[1]
