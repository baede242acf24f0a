"""`diffbotctl check` and `explain`: the problems of files, and what an error code means."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import click

from diffbotctl.cli.command import argument, command, option
from diffbotctl.cli.options import JSON, ROBOT, SETS
from diffbotctl.cli.output import print_json, problem_record
from diffbotctl.config.lookup import is_path
from diffbotctl.errors import Problem, UsageError, UserError, closest_match, join_words, rendered
from diffbotctl.ui.text import fold_text, render_columns

if TYPE_CHECKING:
    from diffbotctl.config.configuration import Omission
    from diffbotctl.errors import Problem

SIMILAR_CODES_MAX = 12  # that are listed for a part of a code


@command("Files", 2, "Check files")
def check(
    files: tuple[str, ...] = argument("[FILE]..."),
    robot: str | None = ROBOT,
    sets: tuple[str, ...] = SETS,
    real: bool = option("Also warn about what matters on a real robot only."),
    as_json: bool = JSON,
) -> int:
    """Check robot, pipeline and trials files, or names. Nothing is started.

    One robot among them, if it has no errors, is that of the pipelines that name none.

    Without FILE, those in ./robots, ./pipelines and ./trials, or the shipped robot and pipeline
    `goal`.

    Exit code: 0 when they can be run (warnings may be printed), 2 when they cannot.
    """
    from diffbotctl.config.load import check_all, takes_robot

    files = files or _files_here()
    others = {file for file in files if _is_view_or_trials(file)}
    robots = [file for file in files if file not in others and not takes_robot(file)]
    default_robot = None
    if len(robots) == 1 and not any(each.severity == "error" for each in check_all(robots[0])[0]):
        default_robot = robots[0]
    if len(robots) + len(others) == len(files):
        _refuse_pipeline_options(files[0], robot, sets)
    problems: list[Problem] = []
    reported: set[str] = set()
    for file in files:
        is_other = file in others
        file_problems, omissions = _problems(file, robot, sets, real, is_other, default_robot)
        new_problems = [problem for problem in file_problems if problem.render() not in reported]
        reported |= {problem.render() for problem in new_problems}
        problems += new_problems
        if as_json:
            for problem in new_problems:
                print_json(problem_record(problem))
        else:
            for text in rendered(new_problems):
                click.echo(f"{text}\n")
            above = ", reported above" if file_problems and not new_problems else ""
            click.echo(f"{file}: {_verdict(file_problems)}{above}")
            if any(problem.code == "E-CODE-CONSENT" for problem in new_problems):
                click.echo(f"To allow the code: `diffbotctl run {file}` asks")
            for omission in omissions:
                click.echo(fold_text(f"  {omission.text()}", hang=4))
            if not is_other:
                _print_pulses(file, file_problems)
    if problems and not as_json:
        click.echo(f"`diffbotctl explain {problems[0].code}` explains more.")
    return 2 if any(problem.severity == "error" for problem in problems) else 0


def _files_here() -> tuple[str, ...]:
    """The user's files in the working directory; the names of shipped ones where there are none."""
    from pathlib import Path

    folders = (Path("robots"), Path("pipelines"), Path("trials"))
    found = [str(path) for folder in folders for path in sorted(folder.glob("*.yaml"))]
    return tuple(found) or ("book_2wd", "goal")


def _is_view_or_trials(file: str) -> bool:
    from pathlib import Path

    from diffbotctl.trials.plan import is_trials
    from diffbotctl.ui.saved_view import is_view

    return is_path(file) and (is_view(Path(file)) or is_trials(file))


def _print_pulses(file: str, problems: Sequence[Problem]) -> None:
    """Print where the pulses for the motors of a robot file are, and why, if it has a board."""
    from diffbotctl.config.board_pins import BOARDS
    from diffbotctl.config.load import load_robot, takes_robot
    from diffbotctl.config.motor_pulses import pulses_text

    if takes_robot(file) or any(problem.severity == "error" for problem in problems):
        return
    robot = load_robot(file).robot
    if robot.board.type in BOARDS:
        click.echo(f"  {pulses_text(robot)}")


def _refuse_pipeline_options(file: str, robot: str | None, sets: tuple[str, ...]) -> None:
    """Raises click.UsageError for options that have an effect on pipelines only."""
    if robot is not None:
        raise click.UsageError(
            f"--robot has no effect: {file} is no pipeline, whose robot it replaces; leave it out, "
            f"or check that robot: diffbotctl check {robot}"
        )
    for text in sets:
        name = text.partition("=")[0].strip()
        if name.partition(".")[0] != "robot" and name:
            raise click.UsageError(
                f"--set {name} has no effect: {file} is no pipeline; a value of a robot file is "
                f"set with --set robot.{name}"
            )


def _verdict(problems: Sequence[Problem]) -> str:
    errors = sum(problem.severity == "error" for problem in problems)
    warnings = len(problems) - errors
    verdict = _count_text(errors, "error") if errors else "no errors"
    return f"{verdict}, {_count_text(warnings, 'warning')}" if warnings else verdict


def _problems(
    file: str,
    robot: str | None,
    sets: tuple[str, ...],
    real: bool,
    is_other: bool,
    default_robot: str | None,
) -> tuple[Sequence[Problem], tuple[Omission, ...]]:
    from diffbotctl.config.load import check_all
    from diffbotctl.config.registry import clashes
    from diffbotctl.trials.plan import is_trials, read_plan
    from diffbotctl.ui.saved_view import read_view

    if is_other:
        try:
            if is_trials(file):
                return read_plan(file).warnings, ()
            read_view(file)
        except UserError as error:
            return error.problems, ()
        return (), ()
    conflicts = [Problem(clash.code, "installation", str(clash), clash.fix) for clash in clashes()]
    problems, omissions = check_all(file, robot, sets, real=real, default_robot=default_robot)
    return [*conflicts, *problems], omissions


def _count_text(count: int, noun: str) -> str:
    return f"{count} {noun}{'' if count == 1 else 's'}"


@command("Files", 3, "; explain an error code")
def explain(code: str | None, as_json: bool = JSON) -> int:
    """Explain the error CODE, such as E-PIN-PWM; without CODE, list all codes."""
    from diffbotctl.codes import code_texts

    if code is not None:
        return _explain_one(code, as_json)
    if as_json:
        for name, entry in code_texts().items():
            print_json({"code": name, "title": entry.title})
        return 0
    for line in render_columns([(name, entry.title) for name, entry in code_texts().items()]):
        click.echo(line)
    return 0


def _explain_one(code: str, as_json: bool) -> int:
    from diffbotctl.codes import code_texts

    by_name = {name.upper(): name for name in code_texts()}
    name = by_name.get(code.upper())
    if name is None:
        near = by_name.get(closest_match(code.upper(), by_name) or "")
        with_word = [name for upper, name in by_name.items() if code.upper() in upper]
        fix = f"did you mean {near}?" if near else "`diffbotctl explain` lists all codes"
        if 0 < len(with_word) <= SIMILAR_CODES_MAX:
            fix = f"did you mean {join_words(with_word)}?"
        raise UsageError(Problem("E-CODE", "explain", f"there is no code '{code}'", fix))
    entry = code_texts()[name]
    if as_json:
        print_json({"code": name, "title": entry.title, "text": entry.text})
        return 0
    click.echo(f"{name}: {entry.title}\n")
    click.echo(click.wrap_text(entry.text, 78, preserve_paragraphs=True))
    return 0
