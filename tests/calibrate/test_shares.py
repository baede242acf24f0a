"""The open share of a disc, from flanks by hand and from robots whose truth is known."""

from math import pi
from pathlib import Path

import pytest

from diffbotctl.calibrate import encoder_fit
from diffbotctl.calibrate.runner import open_session, run_step
from diffbotctl.calibrate.steps.encoders import EncoderStep
from diffbotctl.config.load import load_robot
from diffbotctl.links.diffbot_telemetry import RawEdge
from diffbotctl.prompts.answers_file import AnswersFile
from diffbotctl.time import MILLISECOND as MS
from tests.support.calibration_robots import SilentScreen

FILE = load_robot("book_2wd")
ROBOT = FILE.robot  # glitch 2 ms


def flanks(*changes, wheel=0):
    """(ms, level) ..."""
    return [RawEdge(round(time * MS), wheel, level) for time, level in changes]


def turning(pitches, part, wheel=0, pitch=50.0):
    """Whole pitches of so many ms, of which the pin is high for `part`."""
    changes = [
        (pitch * k + late, level)
        for k in range(pitches)
        for late, level in ((0.0, 1), (part * pitch, 0))
    ]
    return flanks(*changes, wheel=wheel)


@pytest.mark.parametrize(
    "changes, counted, shares",
    [
        ([], 1, []),
        ([(0, 1), (10, 0)], 1, []),  # no whole pitch
        ([(0, 1), (10, 0), (40, 1)], 1, [0.25]),
        ([(0, 1), (10, 0), (40, 1)], 0, []),  # from one falling flank to the next: none
        ([(0, 1), (10, 0), (40, 1), (50, 0)], 0, [0.75]),  # low for 30 of 40
        # both flanks chatter within the glitch time: the first change of a burst counts
        ([(0, 1), (0.5, 0), (1, 1), (10, 0), (10.4, 1), (11, 0), (40, 1)], 1, [0.25]),
        # reported in another order
        ([(40, 1), (0, 1), (10, 0)], 1, [0.25]),
        # the hand rests between the second and the third pitch
        ([(0, 1), (10, 0), (40, 1), (60, 0), (80, 1), (90, 0), (500, 1)], 1, [0.25, 0.5]),
    ],
)
def test_pitches_by_hand(changes, counted, shares):
    assert list(encoder_fit.slot_duties(flanks(*changes), 0.002, counted)) == pytest.approx(shares)


def test_each_disc_has_its_own_share():
    shares = encoder_fit.measure_slot_duty([*turning(60, 0.4), *turning(60, 0.55, wheel=1)], ROBOT)
    values = {each.field: each.value for each in shares.findings}
    assert values == pytest.approx(
        {
            "drive.left.encoder.open_share": 0.4,
            "drive.right.encoder.open_share": 0.55,
        }
    )
    assert shares.faults == [] and len(shares.report) == 2


def test_a_few_pitches_tell_nothing():
    assert encoder_fit.measure_slot_duty(turning(30, 0.4), ROBOT) == ([], [], [])


@pytest.mark.parametrize("part", [0.1, 0.9])
def test_a_light_barrier_at_the_rim_is_a_fault(part):
    shares = encoder_fit.measure_slot_duty(turning(60, part), ROBOT)
    assert shares.findings == [] and "90% of a pitch: move the light barrier" in shares.faults[0]


@pytest.mark.parametrize(
    "port, edge", [("sim", "rising"), ("sim", "falling"), ("emulated", "rising")]
)
def test_the_encoders_step_finds_the_share_that_is_true(port, edge, tmp_path: Path):
    robot = tmp_path / "robot.yaml"
    robot.write_text(
        "format: 1\nkind: robot\ninclude: book_2wd\n"
        f"drive: {{encoder: {{edge: {edge}}}}}\ncalibration: {{}}\n"
    )
    answers = tmp_path / "answers.yaml"
    answers.write_text("encoders: {measure: eye}\n")
    made, truths = open_session(load_robot(str(robot)), port, 3)
    try:
        outcome = run_step(
            EncoderStep(turns=5, rolls=1), made, AnswersFile(answers, truths), SilentScreen()
        )
    finally:
        made.close()
    shares = {each.field: each.value for each in outcome.findings}
    for side, disc in zip(("left", "right"), truths._plant.discs, strict=True):
        ups, downs = disc.edges[::2], disc.edges[1::2]
        high = sum(b - a for a, b in zip(ups, downs, strict=True)) / (2 * pi)
        expected = high if edge == "rising" else 1.0 - high
        # An eighth of a slot in a hundred pitches, and the mean of ratios for the ratio of means.
        assert shares[f"drive.{side}.encoder.open_share"] == pytest.approx(expected, abs=0.008)
