"""`diffbotctl check`: every problem of robot and pipeline files, with its place.

`diffbotctl explain`: an error code at length.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import click

if TYPE_CHECKING:
    from diffbotctl.errors import Problem


@click.command()
@click.argument("files", nargs=-1, required=True, metavar="FILE...")
@click.option("--robot", help="Robot for the pipelines; wins over their own.")
@click.option("--set", "sets", multiple=True, metavar="BLOCK.PARAM=VALUE", help="Change one value.")
@click.option("--real", is_flag=True, help="Warn also of what matters only on a real robot.")
def check(files: tuple[str, ...], robot: str | None, sets: tuple[str, ...], real: bool) -> int:
    """Check robot and pipeline files, or names. Nothing is started.

    Exit code: 0 when they can be run (warnings may be printed), 2 when they cannot.
    """
    problems: list[Problem] = []
    for file in files:
        found = _problems(file, robot, sets, real)
        errors = sum(problem.severity == "error" for problem in found)
        verdict = f"{_counted(errors, 'error')}" if errors else "fine"
        warnings = len(found) - errors
        if warnings:
            verdict += f", {_counted(warnings, 'warning')}"
        for problem in found:
            if problem not in problems:
                click.echo(f"{problem.render()}\n")
        problems += found
        click.echo(f"{file}: {verdict}")
    if problems:
        click.echo(f"`diffbotctl explain {problems[0].code}` tells more.")
    return 2 if any(problem.severity == "error" for problem in problems) else 0


def _problems(file: str, robot: str | None, sets: tuple[str, ...], real: bool) -> list[Problem]:
    from diffbotctl.config.load import check
    from diffbotctl.config.registry import clashes
    from diffbotctl.errors import Problem

    found = [
        Problem(clash.code, "installation", str(clash), clash.fix)
        for group in ("diffbotctl.blocks", "diffbotctl.drivers")
        for clash in clashes(group)
    ]
    return [*found, *check(file, robot, sets, real=real)]


def _counted(count: int, what: str) -> str:
    return f"{count} {what}{'' if count == 1 else 's'}"


@click.command()
@click.argument("code", required=False)
def explain(code: str | None) -> int:
    """Explain CODE, such as E-PIN-PWM; without one, list all codes."""
    from diffbotctl.codes import code_texts
    from diffbotctl.errors import Problem, UsageError, closest_match
    from diffbotctl.ui.text import render_columns

    codes = code_texts()
    if code is None:
        for line in render_columns([(name, entry.title) for name, entry in codes.items()]):
            click.echo(line)
        return 0
    by_name = {name.upper(): name for name in codes}
    name = by_name.get(code.upper(), "")
    entry = codes.get(name)
    if entry is None:
        near = by_name.get(closest_match(code.upper(), by_name) or "")
        fix = f"did you mean {near}?" if near else "`diffbotctl explain` lists them all"
        raise UsageError(Problem("E-CODE", "explain", f"there is no code '{code}'", fix))
    click.echo(f"{name}: {entry.title}\n")
    click.echo(click.wrap_text(entry.text, 78, preserve_paragraphs=True))
    return 0
