"""`diffbotctl learn` in a folder of a learner: from the first lesson to a table of a class."""

import json
import shutil
from pathlib import Path

import click
import pytest

from diffbotctl.cli.learn import learn as command
from diffbotctl.cli.new import new
from diffbotctl.errors import UsageError
from diffbotctl.learn.course import find_lesson, lessons
from diffbotctl.learn.learner_folder import LearnerFolder, LessonProgress
from tests.command_result import invoke


@pytest.fixture(autouse=True)
def folder(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    return tmp_path / "learn"


def test_the_first_lesson_passes_and_the_next_one_is_shown(folder):
    code, text = invoke(command, "next")
    assert "A talker and a listener" in text and (folder / "talker" / "hello.yaml").is_file()
    code, text = invoke(command, "check")
    assert code == 1 and "there is no block 'listener'" in text
    solution = find_lesson("1").source("solution") / "hello.yaml"
    shutil.copyfile(solution, folder / "talker" / "hello.yaml")
    code, text = invoke(command, "check", "--watch")
    assert code == 0 and "talker: passed" in text
    assert invoke(command)[1].splitlines()[0].endswith("passed")
    assert "Parameters that change" in invoke(command, "next")[1]
    assert f"1 of {len(lessons())}" in invoke(command, "class", ".")[1]
    with pytest.raises(click.UsageError, match="there is no folder ann"):
        invoke(command, "class", "ann")


def test_the_run_that_failed_is_repeated_by_its_seed(folder):
    _, first = invoke(command, "check", "one_metre", "--repeat", "7")
    _, second = invoke(command, "check", "one_metre", "--repeat", "7")
    assert first.split("not yet")[1] == second.split("not yet")[1]
    assert first.rstrip().endswith("diffbotctl learn hint one_metre")  # talker is the present one
    command_line = next(line for line in first.splitlines() if "diffbotctl run" in line)
    assert Path(command_line.split()[2]).is_file()
    code, text = invoke(command, "check", "5", "--json")
    assert code == 1 and json.loads(text)["passed"] is False


def test_commands_work_below_the_folder_with_the_progress(folder, monkeypatch):
    invoke(command, "next")
    monkeypatch.chdir(folder / "talker")
    code, text = invoke(command, "check")
    assert code == 1 and "hello.yaml: there is no block 'listener'" in text
    solution = find_lesson("1").source("solution") / "hello.yaml"
    Path("hello.yaml").write_text(solution.read_text().replace("100 ms", "1 s"))
    text = invoke(command, "check")[1]
    words = next(line for line in text.splitlines() if "diffbotctl run" in line).split()
    assert Path(words[2]).is_file() and "--seed" not in words and "--dash" not in words
    shutil.copyfile(solution, "hello.yaml")
    assert invoke(command, "check")[0] == 0
    assert "Your folder: ../parameters" in invoke(command, "next")[1]
    assert sorted(path.name for path in folder.iterdir()) == [
        "checked",
        "parameters",
        "progress.json",
        "talker",
    ]
    assert invoke(command)[1].splitlines()[0].endswith("passed")


def test_work_that_is_not_checked_is_named(folder, monkeypatch):
    invoke(command, "next", "counter")
    (folder / "counter" / "numbers.py").write_text("# solved\n")
    monkeypatch.chdir(folder / "counter")
    code, text = invoke(command, "check")  # of this folder, not the first lesson
    assert code == 1 and "You have not changed ../counter/total.py yet" in text
    assert "Only total.py is checked. You have also changed numbers.py." in text
    shutil.copy(find_lesson("counter").source("solution") / "total.py", "total.py")
    assert "counter: passed" in invoke(command, "check")[1]
    assert "talker: not yet" in invoke(command, "check")[1]
    shutil.rmtree(folder / "talker")
    assert "../talker was not there" in invoke(command, "check")[1]


def test_reset_keeps_the_learner_s_files(folder):
    invoke(command, "check", "counter")
    (folder / "counter" / "total.py").write_text("# mine\n")
    invoke(command, "reset", "counter")
    invoke(command, "reset", "counter")
    kept = sorted(folder.glob("backups/counter-*/total.py"))
    assert len(kept) == 2 and kept[0].read_text() == "# mine\n"
    assert "class Total" in (folder / "counter" / "total.py").read_text()


def test_hints_come_one_by_one(folder):
    hints = find_lesson("counter").section.hints
    for number in range(1, len(hints) + 2):
        text = invoke(command, "hint", "counter")[1]
        assert hints[min(number, len(hints)) - 1] in text
        assert (hints[-1] in text) == (number >= len(hints))


def test_after_the_last_lesson_it_says_how_to_go_on():
    learner = LearnerFolder()
    for lesson in lessons():
        assert "learn next LESSON" not in invoke(command)[1]
        learner.note(lesson, LessonProgress("2026-01-01"))
    assert "diffbotctl start" in invoke(command)[1]
    assert "diffbotctl start" in invoke(command, "next")[1]


def test_a_half_deleted_folder_and_a_name_that_is_wrong(folder):
    invoke(command, "check", "counter")
    (folder / "counter" / "total.py").unlink()
    code, text = invoke(command, "check", "counter")
    assert code == 1 and "total.py is not there" in text
    (folder / "progress.json").write_text("[")
    assert invoke(command)[0] is None
    with pytest.raises(UsageError, match="counter"):
        invoke(command, "check", "countr")


def test_a_new_lesson_is_listed_judges_its_solution_and_passes_when_solved(folder):
    assert "written: lessons/twice/lesson.md" in invoke(new, "lesson", "twice")[1]
    assert invoke(command)[1].splitlines()[len(lessons()) - 1].split()[1] == "twice"
    code, text = invoke(command, "check", "twice", "--solution")
    assert code == 0 and text.startswith("start: does not pass") and "solution: passes." in text
    assert "Your folder: learn/twice" in invoke(command, "next", "twice")[1]
    path = folder / "twice" / "double.py"
    assert "Each number has to be published twice" in invoke(command, "check", "twice")[1]
    path.write_text(path.read_text().replace(", number.data", ", number.data + number.data"))
    assert "twice: passed" in invoke(command, "check", "twice")[1]
    solved = Path("lessons/twice/solution/double.py")
    solved.write_text(solved.read_text().replace("2.0", "3.0"))
    assert invoke(command, "check", "twice", "--solution")[0] == 1


def test_a_new_lesson_does_not_take_the_name_of_another(folder):
    with pytest.raises(UsageError, match="name of a lesson of diffbotctl"):
        invoke(new, "lesson", "talker")
