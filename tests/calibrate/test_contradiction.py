"""Answers against the counts of the encoders, by a table worked out by hand."""

import pytest

from diffbotctl.calibrate.contradiction import (
    ask_checked,
    pulse_contradiction,
    scale_contradiction,
    turn_contradiction,
)
from diffbotctl.calibrate.step import Message
from diffbotctl.calibrate.wiring_detection import MotorPulse, WheelMotion
from diffbotctl.prompts.question import Question

LEFT = MotorPulse("left", WheelMotion.LEFT_FORWARD, {"left": 9, "right": 0})


@pytest.mark.parametrize(
    ("seen", "left", "right", "noisy", "before", "words"),
    [
        ("left forward", 8, 0, set(), None, None),
        ("right forward", 8, 0, set(), None, None),  # the encoders may be swapped
        ("none", 0, 1, set(), None, None),
        ("none", 8, 0, set(), None, "so a wheel turned"),
        ("none", 30, 0, {"left"}, None, None),  # noise counts too
        ("left forward", 0, 0, set(), None, "No encoder counted"),
        ("left forward", 0, 30, {"right"}, None, None),
        ("both forward", 9, 0, set(), None, "Only one encoder"),
        ("left backward", 9, 8, set(), None, "Both encoders"),
        ("both forward", 9, 8, set(), None, None),
        ("right forward", 0, 9, set(), LEFT, None),
        ("left forward", 0, 9, set(), LEFT, "another encoder counted"),
        (
            "right forward",
            9,
            0,
            set(),
            LEFT,
            "the same encoder counted",
        ),
    ],
)
def test_what_was_seen_against_what_was_counted(seen, left, right, noisy, before, words):
    counts = {"left": left, "right": right}
    reason = pulse_contradiction(WheelMotion(seen), counts, noisy, before)
    assert reason is None if words is None else words in reason


@pytest.mark.parametrize(
    ("tape", "odometry", "scales", "is_contradicted"),
    [
        (1.05, 1.0, (), False),  # a wheel that is 5 % larger than stated
        (0.85, 1.0, (), True),
        (1.07, 1.0, (), True),  # more than three times the 2 % of wheels that were not measured
        (1.05, 1.0, (1.048,), False),
        (1.005, 1.0, (1.048, 1.05), True),  # 1005 typed for 1050
    ],
)
def test_a_distance_against_the_wheels(tape, odometry, scales, is_contradicted):
    assert (scale_contradiction(tape, odometry, scales) is not None) == is_contradicted


@pytest.mark.parametrize(("tape", "is_contradicted"), [(1.02, False), (1.05, True)])
def test_wheels_that_a_tape_has_measured_are_known_better(tape, is_contradicted):
    assert (scale_contradiction(tape, 1.0, (), 0.001) is not None) == is_contradicted


def test_turns_of_the_other_wheel():
    assert turn_contradiction("left", 200, 0) is None
    assert "counted 200" in turn_contradiction("left", 0, 200)
    assert turn_contradiction("left", 0, 0) is None  # a dead encoder is found elsewhere


def asked(answers, check):
    """The final answer, and the events before it."""
    events, steps = [], ask_checked(Question("a.b", "How far?", unit="m"), check)
    answers = iter(answers)
    answer = None
    try:
        while True:
            event = steps.send(answer)
            events.append(event)
            answer = next(answers) if isinstance(event, Question) else None
    except StopIteration as end:
        return end.value, events


def test_a_contradicted_answer_is_asked_again_and_accepted_when_repeated():
    def check(answer):
        return "No." if answer > 1.0 else None

    assert asked([0.9], check)[0] == 0.9
    answer, events = asked([9.0, 0.9], check)
    assert answer == 0.9 and "No. Measure again" in events[1].text
    assert [event.is_repeated for event in events if isinstance(event, Question)] == [False, True]
    answer, events = asked([9.0, 9.0], check)
    assert answer == 9.0 and len([event for event in events if isinstance(event, Message)]) == 1
    assert asked([9.0, 8.0, 7.0], check)[0] == 7.0
