"""Measured ends against the wheels, by a table worked out by hand, and the questions for them."""

from math import nan, radians

import pytest

from diffbotctl.calibrate.dead_reckoning import EndError
from diffbotctl.calibrate.end_answers import (
    ZeroReadings,
    angle_contradiction,
    ask_place,
    place_contradiction,
    place_text,
)
from diffbotctl.calibrate.step import Message
from diffbotctl.errors import RunError
from diffbotctl.messages import Odometry
from diffbotctl.prompts.question import Question

HERE = Odometry(0, 0.004, -0.003, 0.0, 0.0, 0.0, (0.0,) * 6)
USUAL = [EndError(-0.09, -0.10, nan), EndError(-0.10, -0.09, nan), EndError(-0.094, -0.094, nan)]


@pytest.mark.parametrize(
    ("forward", "left", "before", "words"),
    [
        (-94, -94, [], None),  # a track that is wrong by 3 %
        (-940, -940, [], "By its wheels it stands at 4 mm in front, 3 mm to the right, and not at"),
        (0, 0, [], "Exactly on the start mark"),
        (0, 1, [], None),
        (-97, -90, USUAL, None),
        (94, 94, USUAL, "squares before it stands at 90 mm behind, 97 mm to the right"),
        (-9, -9, USUAL, "and not at 9 mm behind, 9 mm to the right"),  # 9 cm, typed as mm
    ],
)
def test_a_place_against_the_wheels(forward, left, before, words):
    place = forward / 1000, left / 1000
    reason = place_contradiction(place, HERE, before, side=1.0)
    assert reason is None if words is None else words in reason


def test_a_robot_that_slips_is_not_asked_again_and_again():
    wide = [EndError(x / 1000, 0.0, nan) for x in (-80, 0, 80)]
    assert place_contradiction((0.15, 0.0), HERE, wide, side=1.0) is None


@pytest.mark.parametrize(
    ("facing", "expected", "before", "words"),
    [
        (10, 0, [], None),
        (60, 0, [], "By its wheels it is turned by 0 deg, not by 60 deg"),
        (8, 1, [6, 7, 8], None),
        (-178, 178, [], None),
        (-8, 1, [6, 7, 8], "By the readings before it is turned by 8 deg, not by -8 deg"),
    ],
)
def test_an_angle_against_the_wheels(facing, expected, before, words):
    errors = [radians(each) for each in before]
    limits = radians(45), radians(15)
    reason = angle_contradiction(radians(facing), radians(expected), errors, *limits)
    assert reason is None if words is None else words in reason


@pytest.mark.parametrize(
    ("kind", "planned", "readings", "is_refused"),
    [
        ("place", 10, [0, 0, 0], True),
        ("place", 10, [0, 0, 3, 0, 0, 3], False),
        ("place", 2, [0, 0], True),
        ("place", 2, [0, 5], False),
        ("heading", 10, [0, 0, 0, 1], False),
        ("heading", 10, [0, 0, 0, 0], True),
    ],
)
def test_exactly_nothing_is_measured_seldom(kind, planned, readings, is_refused):
    zeros = ZeroReadings(planned, "the end", kind)
    try:
        for each in readings:
            zeros.add(each / 1000)
    except RunError as error:
        assert is_refused and "exactly 0" in error.problems[0].cause
    else:
        assert not is_refused


def asked(answers, check):
    """The place of these answers in mm, and the text."""
    output, steps, answers = [], ask_place(1.0, check), iter(answers)
    answer = None
    try:
        while True:
            event = steps.send(answer)
            if isinstance(event, Message):
                output.append(event.text)
            answer = next(answers) / 1000 if isinstance(event, Question) else None
    except StopIteration as end:
        return end.value, output


def test_a_contradicted_place_is_asked_again_and_accepted_when_repeated():
    def check(place):
        return "No." if place[0] > 0.1 else None

    assert asked([50, 1], check) == ((0.05, 0.001), [])
    assert asked([500, 1, 50, 2], check) == ((0.05, 0.002), ["No. " + AGAIN])
    assert asked([500, 1, 502, 2], check)[0] == (0.502, 0.002)
    with pytest.raises(RunError, match=r"3 different answers for one end\. No\."):
        asked([500, 1, 600, 1, 700, 1], check)


AGAIN = "Measure again; the same answer is accepted."


@pytest.mark.parametrize(
    ("place", "text"),
    [
        ((0.094, -0.002), "94 mm in front, 2 mm to the right"),
        ((-0.094, 0.002), "94 mm behind, 2 mm to the left"),
    ],
)
def test_a_place_is_reported_as_it_was_read(place, text):
    assert place_text(place) == text
