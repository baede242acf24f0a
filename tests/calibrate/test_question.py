"""Answers that people type: read, or refused with the reason."""

from math import pi

import pytest
from click.testing import CliRunner

from diffbotctl.prompts.question import AnswerError, Question
from diffbotctl.ui.terminal_prompter import TerminalPrompter

READING = Question(
    "distance.reading",
    "How far?",
    unit="m",
    default_unit="mm",
    minimum=0.65,
    maximum=1.35,
    limit_reason="is the unit mm?",
)
FACING = Question("geometry.facing", "How far round?", "rad", "deg", -pi, pi)
WHICH = Question("encoders.wheel", "Which?", choices=("none", "left forward", "left backward"))


@pytest.mark.parametrize(
    "question, typed, value",
    [
        (READING, "998", 0.998),  # a bare number is in the unit that is asked for
        (READING, "99.8 cm", 0.998),
        (READING, "998,5", 0.9985),  # a decimal comma
        (READING, " 1.002 m ", 1.002),
        (READING, 1002, 1.002),
        (FACING, "-90", -pi / 2),
        (FACING, "0.5 rad", 0.5),
        (WHICH, "left forward", "left forward"),
        (WHICH, " Left Backward", "left backward"),
        (WHICH, "n", "none"),  # what it begins with is enough
    ],
)
def test_an_answer_is_read(question, typed, value):
    assert question.parse(typed) == (value if isinstance(value, str) else pytest.approx(value))


@pytest.mark.parametrize(
    "question, typed, words",
    [
        (READING, "-998", "not between 650 mm and 1350 mm: is the unit mm?"),
        (READING, "0.998", "not between"),  # metres, taken for millimetres
        (READING, "a metre", "not a number with a unit"),
        (READING, "998 kg", "kg is a mass, but a length is required"),
        (READING, "998 mn", "'mn' is not a known unit"),
        (READING, "nan", "not a finite number"),
        (READING, "", "an answer is required: a number in mm"),
        (READING, True, "is not an answer"),
        (FACING, "181", "not between -180 deg and 180 deg"),
        (WHICH, "left", "not valid; answer none, left forward or left backward"),  # which way?
        (WHICH, "lft forward", "did you mean left forward?"),
    ],
)
def test_nonsense_is_refused_with_the_reason(question, typed, words):
    with pytest.raises(AnswerError, match=words.replace("?", r"\?")):
        question.parse(typed)


def test_enter_means_the_default_where_there_is_one():
    asked = Question("geometry.swapped", "Exchange?", choices=("yes", "no"), default="yes")
    assert asked.parse("") == "yes" and asked.parse(None) == "yes"


@pytest.mark.parametrize("letters", range(1, 60))
def test_a_question_with_its_default_is_folded_between_words(letters):
    question = Question("", "x" * letters + "?", choices=("left forward",), default="left forward")
    with CliRunner().isolation(input="\n") as (output, *_):
        assert TerminalPrompter().answer(question) == "left forward"
        printed = output.getvalue().decode()
    assert all(len(line) <= 80 for line in printed.splitlines())
    assert " ".join(printed.split()).endswith("? (left forward) [left forward]:")
