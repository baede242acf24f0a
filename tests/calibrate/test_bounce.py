"""Chatter of the encoders' flanks: bursts by hand, and through the real firmware's capture."""

import pytest

from diffbotctl.calibrate import encoder_fit
from diffbotctl.calibrate.result import PartResult
from diffbotctl.calibrate.runner import open_session, run_step
from diffbotctl.calibrate.steps.encoders import EncoderStep
from diffbotctl.config.load import load_robot
from diffbotctl.links.diffbot_telemetry import RawEdge
from diffbotctl.prompts.answers_file import AnswersFile
from diffbotctl.time import MILLISECOND as MS

ROBOT = load_robot("book_2wd").robot  # glitch 2 ms; 20 slots and 100 rpm: open for 15 ms


@pytest.mark.parametrize(
    "times, lengths",  # ms
    [
        ([], []),
        ([0, 30, 60], [0, 0, 0]),
        ([0, 0.5, 1.2, 30, 60, 63], [1.2, 0, 3]),
        ([60, 0, 1.2, 63, 0.5, 30], [1.2, 0, 3]),  # reported in another order
        ([0, 3, 6, 9], [9]),  # each follows closely on the one before
    ],
)
def test_close_edges_are_one_edge_that_bounces(times, lengths):
    finding = encoder_fit.bounce_times([round(time * MS) for time in times])
    assert finding == pytest.approx([length / 1000 for length in lengths])


def chattering(milliseconds, wheel=0):
    """Thirty flanks, each of which comes again once, so much later."""
    times = [
        40 * MS * number + late for number in range(30) for late in (0, round(milliseconds * MS))
    ]
    return [RawEdge(time, wheel, number % 2) for number, time in enumerate(times)]


@pytest.mark.parametrize(
    "milliseconds, glitch",
    [
        (0.5, None),  # half of what the board looks away for already
        (1.3, None),
        (1.6, 0.0025),  # times 1.5, up to a whole half millisecond
        (2.4, 0.004),
        (3.3, 0.005),  # a third of the 15 ms that a slot is open is the limit
    ],
)
def test_a_glitch_time_that_covers_the_chatter(milliseconds, glitch):
    finding = encoder_fit.measure_glitch(chattering(milliseconds), ROBOT)
    assert finding.faults == []
    values = [each.value for each in finding.findings]
    assert values == ([] if glitch is None else pytest.approx([glitch, glitch]))


def test_chatter_as_long_as_a_slot_needs_a_capacitor():
    edges = [RawEdge((40 * number + late) * MS, 0, 0) for number in range(30) for late in (0, 3, 6)]
    finding = encoder_fit.measure_glitch(edges, ROBOT)
    assert finding.findings == [] and "100 nF" in finding.faults[0]


def test_few_edges_are_not_enough():
    assert encoder_fit.measure_glitch(chattering(2.4)[:10], ROBOT) == PartResult([], [], [])


class Quiet:
    def say(self, text): ...
    def progress(self, progress): ...
    def draw(self, drawing): ...


def test_bounce_is_measured_from_the_firmware_s_capture(tmp_path):
    robot, answers = tmp_path / "mine.yaml", tmp_path / "answers.yaml"
    robot.write_text(
        "format: 1\nkind: robot\ninclude: book_2wd\nsimulation: {encoder: {bounce: 2.4 ms}}\n"
    )
    answers.write_text("encoders: {measure: eye}\n")
    made, truths = open_session(load_robot(str(robot)), "emulated", seed=1)
    try:
        step = EncoderStep(turns=2, rolls=2)
        finding = run_step(step, made, AnswersFile(answers, truths), Quiet())
    finally:
        made.close()
        assert made.stop_confirmed
    values = {each.field: each.value for each in finding.findings}
    assert values["drive.left.encoder.glitch"] == pytest.approx(0.004)
    assert finding.faults == [] and values["drive.polarity"] == "calibrated"
