"""Each lesson: the start fails, its solution passes, and usual mistakes are found and named."""

import shutil

import pytest

from diffbotctl.learn.check import check
from diffbotctl.learn.course import lessons
from tests.learn.turtle_recording import TURNS, record
from tests.learn.wrong_solutions import RIGHT, WRONG
from tests.sampling import by_day

LESSONS = {lesson.name: lesson for lesson in lessons()}
BY_HAND = "turtle_keys"
WRITTEN = [name for name in LESSONS if name != BY_HAND]


def copy_of(lesson, folder, kind):
    shutil.copytree(lesson.source(kind), folder, dirs_exist_ok=True)
    return folder


@pytest.mark.parametrize("name", WRITTEN)
def test_the_start_fails_and_the_solution_passes(name, tmp_path):
    lesson = LESSONS[name]
    started = check(lesson, copy_of(lesson, tmp_path / "start", "start"))
    assert not started.passed
    assert started.advice or started.finding.seen
    solved = check(lesson, copy_of(lesson, tmp_path / "solution", "solution"))
    assert solved.passed, solved


@pytest.mark.parametrize(("name", "old", "new"), RIGHT)
def test_another_right_solution_passes(name, old, new, tmp_path):
    path = copy_of(LESSONS[name], tmp_path, "solution") / LESSONS[name].section.files[0]
    assert old in path.read_text()
    path.write_text(path.read_text().replace(old, new))
    verdict = check(LESSONS[name], tmp_path)
    assert verdict.passed, verdict


@pytest.mark.parametrize(
    ("name", "number"),
    by_day(14, [(name, k) for k in range(6) for name in WRITTEN if k < len(WRONG[name])]),
)
def test_a_usual_mistake_is_rejected_with_what_was_seen(name, number, tmp_path):
    lesson, wrong = LESSONS[name], WRONG[name][number]
    folder = copy_of(lesson, tmp_path, "solution")
    path = folder / lesson.section.files[0]
    text = path.read_text()
    assert wrong.old in text
    path.write_text(text.replace(wrong.old, wrong.new, 1))
    verdict = check(lesson, folder)
    assert not verdict.passed
    assert wrong.code in ("", verdict.finding.code), verdict
    assert verdict.advice or verdict.finding.seen


@pytest.mark.parametrize(
    ("code", "seen"),
    [
        ("import os; os.kill(os.getpid(), 9)", "ended by SIGKILL"),
        ("import os; os._exit(0)", "before it gave a result"),
        ("bytearray(3 << 30)", "MemoryError"),
    ],
)
def test_code_that_ends_its_process_is_reported_as_that(code, seen, tmp_path):
    lesson = LESSONS["counter"]
    path = copy_of(lesson, tmp_path, "solution") / "total.py"
    path.write_text(path.read_text().replace("self.sum += number.data", code))
    finding = check(lesson, tmp_path).finding
    assert seen in finding.seen and "processor time" not in finding.seen


@pytest.mark.nightly
@pytest.mark.parametrize("name", WRITTEN)
def test_the_solution_passes_hidden_seeds(name, tmp_path):
    lesson = LESSONS[name]
    folder = copy_of(lesson, tmp_path, "solution")
    wanted = 5 if name in ("counter_cpp", "calibration") else 100  # these two take longer
    for _ in range(-(-wanted // sum(entry.count for entry in lesson.section.runs))):
        verdict = check(lesson, folder)
        assert verdict.passed, verdict


def test_driving_by_keys_is_judged_by_the_recording(tmp_path):
    lesson = LESSONS[BY_HAND]
    assert check(lesson, tmp_path).finding.code == "missing"
    forward, left, right, stop = TURNS
    for legs, code in (
        (TURNS, "passed"),
        ([forward, left, stop], "turn"),
        ([(0.5, 1.0, 0.0), stop], "path"),
        ([forward, left, right, forward], "rest"),
    ):
        (tmp_path / "turtle.mcap").unlink(missing_ok=True)
        record(tmp_path / "turtle.mcap", legs)
        assert check(lesson, tmp_path).finding.code == code
    (tmp_path / "turtle.mcap").write_text("driven, honestly")
    assert check(lesson, tmp_path).finding.code == "error"
