"""The answers file of the guided setup, and the errors of an unusable one."""

import pytest
from click.testing import CliRunner

from diffbotctl.cli.main import program
from diffbotctl.cli.start_guide import SetupGuide, StopGuide
from diffbotctl.cli.start_steps import QUESTIONS, ChapterKey, GuideProgress, read_answers
from diffbotctl.errors import UsageError

BY_NAME = {question.name: question for question in QUESTIONS}


@pytest.fixture
def answers(tmp_path):
    def written(text):
        path = tmp_path / "answers.yaml"
        path.write_text(text)
        return read_answers(path)

    return written


def test_words_stay_words_and_lists_answer_in_turn(answers):
    file = answers("lifted: yes\nmeasure: [later, all]\nencoders.wheel: {measure: eye}\n")
    assert file.answer(BY_NAME["lifted"]) == "yes"
    assert [file.answer(BY_NAME["measure"]) for _ in range(2)] == ["later", "all"]


@pytest.mark.parametrize(
    ("text", "name", "words"),
    [
        ("lifted: yes\n", "metre", "metre: is not answered in this file"),
        ("metre: yes\n", "goal", "goal: is not answered in this file"),
        ("lifted: maybe\n", "lifted", "not valid; answer yes or no"),
        ("measure: [later]\n", "measure", "asked 2 times, but has 1 answers"),
        ("liftet: yes\n", "lifted", "did you mean lifted?"),
        ("wheels.left: yes\n", "lifted", "there is no question"),
        ("- lifted\n", "lifted", "is not a mapping of questions"),
        ("{", "lifted", "invalid YAML"),
    ],
)
def test_errors_are_reported(answers, text, name, words):
    with pytest.raises(UsageError) as raised:
        file = answers(text)
        for _ in range(2):
            file.answer(BY_NAME[name])
    problem = raised.value.problems[0]
    assert problem.code == "E-START-ANSWER"
    assert words in f"{problem.cause} {problem.fix}"


def test_a_missing_file(tmp_path):
    with pytest.raises(UsageError, match="no such file"):
        read_answers(tmp_path / "none.yaml")


@pytest.mark.parametrize("words, is_told", [("robot --kit romi_32u4", True), ("robot", False)])
@pytest.mark.parametrize("key", [ChapterKey.METRE, ChapterKey.GOAL])
def test_the_consent_states_that_nothing_stops_it(
    answers, tmp_path, monkeypatch, capsys, words, is_told, key
):
    monkeypatch.chdir(tmp_path)
    done = CliRunner().invoke(program, ["new", *words.split(), "mine"])
    assert done.exit_code == 0, done.output
    progress, file = GuideProgress(tmp_path / "start.json", "here"), answers(f"{key}: no\n")
    guide = SetupGuide(progress, "mine", None, None, file)
    with pytest.raises(StopGuide):
        guide._run_chapter(key)
    assert ("does not stop before" in " ".join(capsys.readouterr().out.split())) is is_told
