"""Answers files: what they say, and what is wrong with one, in words."""

import pytest

from diffbotctl.errors import UsageError
from diffbotctl.start.guide_answers import QUESTIONS, GuideAnswers


@pytest.fixture
def answers(tmp_path):
    def written(text):
        path = tmp_path / "answers.yaml"
        path.write_text(text)
        return GuideAnswers(path)

    return written


def test_words_stay_words_and_lists_answer_in_turn(answers):
    found = answers("lifted: yes\nmeasure: [later, all]\nencoders.wheel: {measure: eye}\n")
    assert found.answer(QUESTIONS["lifted"]) == "yes"
    asked = [found.answer(QUESTIONS["measure"]) for _ in range(2)]
    assert asked == ["later", "all"]


@pytest.mark.parametrize(
    ("text", "name", "words"),
    [
        ("lifted: yes\n", "floor", "add a line: floor: yes"),
        ("lifted: maybe\n", "lifted", "say yes or no"),
        ("measure: [later]\n", "measure", "''"),  # asked twice, answered once
        ("liftet: yes\n", "lifted", "did you mean lifted?"),
        ("wheels.left: yes\n", "lifted", "never asked"),
        ("- lifted\n", "lifted", "no list of questions"),
        ("{", "lifted", "cannot be read"),
    ],
)
def test_what_is_wrong_is_said(answers, text, name, words):
    with pytest.raises(UsageError) as told:
        found = answers(text)
        for _ in range(2):
            found.answer(QUESTIONS[name])
    problem = told.value.problems[0]
    assert problem.code == "E-START-ANSWER"
    assert words in f"{problem.cause} {problem.fix}"


def test_a_missing_file(tmp_path):
    with pytest.raises(UsageError, match="No such file"):
        GuideAnswers(tmp_path / "none.yaml")
