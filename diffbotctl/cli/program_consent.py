"""Asking whether the programs of a pipeline may run."""

from __future__ import annotations

import shlex
import sys
from contextlib import suppress
from typing import TYPE_CHECKING

import click

if TYPE_CHECKING:
    from diffbotctl.config.configuration import Configuration
    from diffbotctl.programs.driver import ProgramsDriver


def allowed_programs(configuration: Configuration, is_given: bool) -> type[ProgramsDriver] | None:
    """The driver of the pipeline's programs, once they are allowed; None if there are none.

    `is_given`: --allow-programs; otherwise a person is asked, once. Raises RunError without
    a terminal to ask on, or if the person refuses.
    """
    if not configuration.programs:
        return None
    from diffbotctl.programs.driver import ProgramsDriver

    if not is_given:
        _require_consent(configuration)
    return ProgramsDriver


def _require_consent(configuration: Configuration) -> None:
    from diffbotctl.errors import Problem, RunError
    from diffbotctl.programs import consent

    try:
        key = consent.consent_key(configuration)
    except OSError as error:
        problem = Problem("E-PROGRAM", str(error.filename), f"cannot be read: {error.strerror}")
        raise RunError(problem) from error
    if consent.is_allowed(key):
        return
    if sys.stdin.isatty() and sys.stdout.isatty():
        click.echo(f"{configuration.file} starts these programs with your rights:")
        for use in configuration.programs:
            click.echo(f"  {use.name}: {shlex.join(use.words)}   (in {use.folder})")
        if click.confirm("Allow them, until the pipeline or a program changes?"):
            with suppress(OSError):  # it is asked again
                consent.remember(key)
            return
    cause = f"the programs of {configuration.file} have not been allowed"
    fix = "run it on a terminal, which asks, or give --allow-programs"
    raise RunError(Problem("E-PROGRAM-CONSENT", "programs", cause, fix))
