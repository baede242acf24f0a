"""What the entries of a robot file tell of the scale that all lengths share."""

from types import SimpleNamespace

import pytest

from diffbotctl.calibrate.known_lengths import (
    UNMEASURED_SCALE_SD,
    is_scale_measured,
    known_difference_sd,
    known_scale_sd,
    known_track_sd,
)
from diffbotctl.calibrate.result import LEFT_DIAMETER, RIGHT_DIAMETER, TRACK
from diffbotctl.config.robot import Calibrated


def robot(value="50 mm", **entry):
    """A robot whose wheels and track have this entry; none without arguments."""
    made = Calibrated(value=value, **entry)
    fields = (LEFT_DIAMETER, RIGHT_DIAMETER, TRACK) if entry else ()
    return SimpleNamespace(calibration=dict.fromkeys(fields, made))


@pytest.mark.parametrize(
    ("entry", "scale", "difference"),
    [
        ({}, 0.02, 0.003),
        # 0.3, 0.4 and 0.5 mm are a right triangle: 0.3 mm of 50 mm in common.
        ({"sd": "0.5 mm", "own_sd": "0.4 mm", "method": "distance"}, 0.006, 0.008),
        ({"sd": "1 mm", "own_sd": "0.01 mm", "method": "umbmark"}, 0.02, 0.0002),
        # Without a part of its own, as a person may have written it.
        ({"sd": "0.1 mm", "method": "from-log"}, 0.002, 0.003),
    ],
)
def test_the_scale_and_the_difference_of_the_wheels(entry, scale, difference):
    made = robot(**entry)
    assert known_scale_sd(made) == pytest.approx(scale, rel=1e-3)
    assert known_difference_sd(made, LEFT_DIAMETER) == pytest.approx(difference)
    assert is_scale_measured(made) == (scale < UNMEASURED_SCALE_SD)


@pytest.mark.parametrize(
    ("entry", "sd"),
    [({}, 0.0), ({"sd": "2 mm"}, 0.002), ({"sd": "2 mm", "own_sd": "0.1 mm"}, 0.0001)],
)
def test_a_track_whose_scale_is_replaced_keeps_its_own_part(entry, sd):
    assert known_track_sd(robot(**entry)) == pytest.approx(sd)
