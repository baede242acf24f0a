"""Checks of encoders with two channels."""

import pytest

from diffbotctl.config.load import load_robot
from diffbotctl.errors import ConfigurationError

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
            "13653 edges per second, more than the 12000",
        ),
    ],
)
def test_refused(sets, code, part):
    found = problems(*sets)
    assert any(each == code and part in cause for each, cause in found), found


def test_4096_counts_up_to_the_limit():
    sets = ["robot.drive.encoder.slots=4096", "robot.drive.motor.rated=175 rpm"]
    assert problems(*TWO, *PINS, *sets) == []
