"""`diffbotctl learn`: lessons that check themselves."""

from __future__ import annotations

import shlex
import sys
import time
from pathlib import Path
from typing import TYPE_CHECKING

import click

from diffbotctl.cli.command import argument, group, option
from diffbotctl.cli.contradictions import exclusive
from diffbotctl.cli.options import JSON
from diffbotctl.cli.output import print_json
from diffbotctl.errors import join_words
from diffbotctl.printable import keep_lines

if TYPE_CHECKING:
    from diffbotctl.learn.check import LessonVerdict
    from diffbotctl.learn.learner_folder import LearnerFolder
    from diffbotctl.learn.lesson import Lesson

LOOK_PERIOD_S = 0.3  # between two looks at the files, with --watch
TEXT_COLUMNS_MAX = 100  # of the text of a lesson, on a wider terminal
LESSON = argument("[LESSON]")
ALL_PASSED = """All lessons have passed. To go on:
  diffbotctl start              a robot of your own, step by step
  diffbotctl new block NAME     a block of your own, with its test
  diffbotctl learn next LESSON  a lesson again"""


@group("Set up", 2, "; lessons that check themselves", invoke_without_command=True)
def learn() -> None:
    """Learn diffbotctl along the book's chapters: lessons that check what you did.

    Each lesson is a folder below ./learn with files of yours; the commands work in all folders
    below it. LESSON is its name or number; default: that of the present folder, or else the first,
    that has not passed yet.
    """
    context = click.get_current_context()
    if context.invoked_subcommand is None:
        _show_list()


def _show_list() -> None:
    from diffbotctl.learn.course import lessons

    folder = _folder()
    for number, lesson in enumerate(lessons(), 1):
        state = folder.progress(lesson).passed and "passed"
        state = state or ("begun" if folder.has_begun(lesson) else "")
        click.echo(f"{number:3}  {lesson.name:14} {lesson.section.title:44} {state}".rstrip())
    click.echo(f"\n{_what_next(folder)}")


def _what_next(folder: LearnerFolder) -> str:
    has_passed = folder.progress(_lesson(None)).passed
    return ALL_PASSED if has_passed else "Go on with: diffbotctl learn next"


@learn.command()
def next(name: str | None = LESSON) -> None:
    """Show the next lesson; its files are written when they are not there yet."""
    lesson = _lesson(name)
    if name is None and _folder().progress(lesson).passed:
        click.echo(ALL_PASSED)
        return
    _show(lesson, _folder().begin(lesson))


@learn.command()
@exclusive("--watch", ("--json",), "it prints until Ctrl-C")
@exclusive("--solution", ("--watch",), "the solution does not change")
def check(
    name: str | None = LESSON,
    seed: int | None = option(
        "--repeat", "Begin with the run of SEED.", type=click.IntRange(0), metavar="SEED"
    ),
    watch: bool = option("Check again each time a file is saved."),
    solution: bool = option("Check the solution of the lesson, for its author."),
    as_json: bool = JSON,
) -> int:
    """Check what you did, by simulated runs with values that are drawn anew each time.

    Your code runs with limits of time and memory, and sees only the files of the lesson.

    Exit code: 0 passed, 1 not yet, 2 wrong usage.
    """
    lesson, folder = _lesson(name), _folder()
    if solution:
        return _check_solution(lesson, seed, as_json)
    if not folder.has_begun(lesson):
        click.echo(f"{folder.of(lesson)} was not there. Written: the files to start from.")
        folder.begin(lesson)
    if watch:
        return _watch(lesson, folder)
    verdict = _checked(lesson, folder, seed)
    if as_json:
        _print_json(lesson, verdict)
    else:
        _print_verdict(lesson, folder, verdict)
    return 0 if verdict.passed else 1


def _print_json(lesson: Lesson, verdict: LessonVerdict) -> None:
    print_json({"lesson": lesson.name, "passed": verdict.passed, **verdict.finding._asdict()})


def _check_solution(lesson: Lesson, seed: int | None, as_json: bool) -> int:
    """Check the start, which must not pass, and the solution, which must."""
    from diffbotctl.learn.check import check

    start, solved = (check(lesson, lesson.source(kind), seed) for kind in ("start", "solution"))
    if as_json:
        _print_json(lesson, solved)
    else:
        result = "passes, which it must not" if start.passed else "does not pass, as it must not"
        click.echo(f"start: {result}. {start.advice}".rstrip())
        click.echo("solution: passes." if solved.passed else f"solution: {solved.finding.seen}")
    return 0 if solved.passed and not start.passed else 1


@learn.command()
def hint(name: str | None = LESSON) -> None:
    """Show a hint; each time one more."""
    lesson, folder = _lesson(name), _folder()
    hints, progress = lesson.section.hints, folder.progress(lesson)
    shown = min(progress.hints + 1, len(hints))
    for number, text in enumerate(hints[:shown], 1):
        click.echo(f"{number}. {text}")
    if shown == len(hints):
        click.echo(f"\nThe last hint: `diffbotctl learn solution {lesson.name}` shows a solution.")
    folder.note(lesson, progress._replace(hints=shown))


@learn.command()
def reset(name: str | None = LESSON) -> None:
    """Begin a lesson again; your files are kept in ./learn/backups."""
    lesson, folder = _lesson(name), _folder()
    backup = folder.reset(lesson)
    if backup is not None:
        click.echo(f"Your files are in {backup}")
    click.echo(f"Begun again: {folder.of(lesson)}")


@learn.command()
def solution(name: str | None = LESSON) -> None:
    """Show one solution of a lesson."""
    keep_lines(sys.stdout)  # code, which a person may copy
    lesson = _lesson(name)
    for path in [lesson.source("solution") / file for file in lesson.section.files]:
        if path.is_file():
            click.echo(f"# {path.name}\n{path.read_text()}")
        else:
            click.echo(f"{path.name} comes from your own hands; `learn hint` helps.")


@learn.command("class")
def class_table(folders: tuple[Path, ...] = argument(required=True)) -> None:
    """Show which lessons have passed in the FOLDERS of several learners."""
    from diffbotctl.learn.course import FOLDER, lessons
    from diffbotctl.learn.learner_folder import LearnerFolder

    known = lessons()
    for folder in folders:
        if not folder.is_dir():
            raise click.UsageError(f"there is no folder {folder}")
    names = [folder.resolve().name for folder in folders]
    width = max(map(len, names))
    for name, folder in zip(names, folders, strict=True):
        learner = LearnerFolder(folder / FOLDER)
        marks = ["x" if learner.progress(lesson).passed else "." for lesson in known]
        click.echo(f"{name:{width}}  {' '.join(marks)}  {marks.count('x')} of {len(known)}")


def _folder() -> LearnerFolder:
    from diffbotctl.learn.learner_folder import LearnerFolder

    return LearnerFolder()


def _lesson(name: str | None) -> Lesson:
    """The lesson called `name`; of the present one and all, the first that has not passed."""
    from diffbotctl.learn.course import find_lesson, lessons
    from diffbotctl.learn.learner_folder import lesson_in

    if name is not None:
        return find_lesson(name)
    here, known, folder = lesson_in(Path.cwd()), lessons(), _folder()
    for lesson in [here, *known] if here else known:
        if not folder.progress(lesson).passed:
            return lesson
    return known[-1]


def _argument(lesson: Lesson) -> str:
    """How a command names `lesson`; empty where it is the one without a name."""
    return "" if _lesson(None).name == lesson.name else f" {lesson.name}"


def _show(lesson: Lesson, path: Path) -> None:
    from rich.markdown import Markdown

    from diffbotctl.ui.console import PrintableConsole

    console = PrintableConsole(width=min(PrintableConsole().width, TEXT_COLUMNS_MAX))
    console.print(Markdown(lesson.text))
    click.echo(f"\nYour folder: {path}")
    click.echo(f"Your files:  {', '.join(lesson.section.files)}")
    click.echo(f"Then: diffbotctl learn check{_argument(lesson)}")


def _checked(lesson: Lesson, folder: LearnerFolder, seed: int | None = None) -> LessonVerdict:
    from diffbotctl.learn.check import check

    verdict = check(lesson, folder.of(lesson), seed, folder.checked(lesson))
    if verdict.passed:
        progress = folder.progress(lesson)
        folder.note(lesson, progress._replace(passed=time.strftime("%Y-%m-%d")))
    return verdict


def _print_verdict(lesson: Lesson, folder: LearnerFolder, verdict: LessonVerdict) -> None:
    if verdict.passed:
        click.echo(f"{lesson.name}: passed. {_what_next(folder)}")
        return
    found = verdict.finding
    click.echo(f"{lesson.name}: not yet.\n")
    click.echo(verdict.advice or found.seen)
    _print_changed(lesson, folder)
    run = verdict.run
    if run is not None and verdict.pipeline and found.code not in ("error", "missing", "endless"):
        words = ["diffbotctl", "run", str(folder.checked(lesson) / verdict.pipeline)]
        words += ["--seed", str(run.seed), "--dash"] if run.has_robot else ["--for", "5s"]
        for each in run.sets:
            words += ["--set", each]
        click.echo(f"\nThe same run, to look at:\n    {shlex.join(words)}")
    click.echo(f"\nA hint: diffbotctl learn hint{_argument(lesson)}")


def _print_changed(lesson: Lesson, folder: LearnerFolder) -> None:
    """Tell a learner whose work is in another file or folder, or was not saved."""
    checked, changed = set(lesson.section.files), folder.changed(lesson)
    names = join_words(sorted(checked), "and")
    if not checked & changed and checked <= set(lesson.start_files()):
        click.echo(f"\nYou have not changed {folder.of(lesson) / names} yet, or not saved it.")
    if others := changed - checked:
        click.echo(f"\nOnly {names} is checked. You have also changed {', '.join(sorted(others))}.")


def _watch(lesson: Lesson, folder: LearnerFolder) -> int:
    """Check whenever a file was saved, until it has passed or Ctrl-C."""
    files = [folder.of(lesson) / name for name in lesson.section.files]
    before: list[int] | None = None
    while True:
        times = [path.stat().st_mtime_ns if path.exists() else 0 for path in files]
        if times != before:
            before = times
            click.echo(time.strftime("\n%H:%M:%S"))
            verdict = _checked(lesson, folder)
            _print_verdict(lesson, folder, verdict)
            if verdict.passed:
                return 0
            click.echo("Waiting for you to save; Ctrl-C ends.")
        time.sleep(LOOK_PERIOD_S)
