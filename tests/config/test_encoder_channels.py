"""Checks of encoders with two channels."""

import pytest

from diffbotctl.config.load import load_robot
from diffbotctl.drivers.robot_link import board_settings
from diffbotctl.errors import ConfigurationError
from tests.pico_robot import PICO

TWO = ["robot.drive.encoder.channels=2"]
PINS = ["robot.drive.left.encoder.pin_b=22", "robot.drive.right.encoder.pin_b=23"]


def problems(*sets):
    try:
        load_robot(None, list(sets))
    except ConfigurationError as error:
        return [(problem.code, problem.cause) for problem in error.problems]
    return []


def test_two_channels_are_accepted():
    assert problems(*TWO, *PINS) == []


@pytest.mark.parametrize(
    ("sets", "code", "part"),
    [
        (TWO, "E-ENCODER-CHANNELS", "pin_b, that of channel B, is missing"),
        (PINS, "E-ENCODER-CHANNELS", "pin_b of the left encoder is stated, but channels is 1"),
        (
            ["robot.drive.left.encoder.channels=2", PINS[0]],
            "E-ENCODER-CHANNELS",
            "the right encoder has one channel, the left one has two",
        ),
        (
            [*TWO, *PINS, "robot.drive.encoder.edge=falling"],
            "E-ENCODER-CHANNELS",
            "channel A rises going forward",
        ),
        (
            [*TWO, PINS[0], "robot.drive.right.encoder.pin_b=22"],
            "E-PIN-TAKEN",
            "pin 22 is already used by the left encoder's channel B",
        ),
        (
            [*TWO, *PINS, "robot.drive.encoder.slots=4096", "robot.drive.motor.rated=200 rpm"],
            "E-ENCODER-FAST",
            "13,653 edges per second, more than the 12,000",
        ),
    ],
)
def test_refused(sets, code, part):
    found = problems(*sets)
    assert any(each == code and part in cause for each, cause in found), found


def test_4096_counts_up_to_the_limit():
    sets = ["robot.drive.encoder.slots=4096", "robot.drive.motor.rated=175 rpm"]
    assert problems(*TWO, *PINS, *sets) == []


def test_a_pico_makes_four_counts_of_a_slot():
    robot = load_robot(None, [*TWO, *PICO, "robot.drive.encoder.slots=374"]).robot
    assert (robot.drive.left.encoder.slots, robot.drive.left.encoder.counts) == (374, 1496)
    settings = board_settings(robot)
    assert settings.every_edge and settings.left.slots == settings.right.slots == 1496
    assert problems(*TWO, *PICO, "robot.drive.encoder.slots=374") == []


@pytest.mark.parametrize(("board", "most"), [(PINS, 12_000), (PICO, 20_000)], ids=["mega", "pico"])
def test_a_wheel_that_is_too_fast_for_its_board_is_refused(board, most):
    """4096 slots at the limit, and 2 % above it."""
    rpm = most * 60 / 4096
    rated = ["robot.drive.encoder.slots=4096", f"robot.drive.motor.rated={rpm:.2f} rpm"]
    assert problems(*TWO, *board, *rated) == []
    rated[1] = f"robot.drive.motor.rated={1.02 * rpm:.2f} rpm"
    ((code, cause),) = problems(*TWO, *board, *rated)
    assert code == "E-ENCODER-FAST" and f"more than the {most:,} that a " in cause


def test_channel_b_of_a_pico_needs_an_interrupt():
    found = problems(*TWO, *PICO, "robot.drive.left.encoder.pin_b=A1")
    assert ("E-PIN-INTERRUPT", True) in [(code, "A1" in cause) for code, cause in found], found
