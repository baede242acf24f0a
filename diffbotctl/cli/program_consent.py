"""Asking whether the programs of a pipeline, and the code in its files, may run."""

from __future__ import annotations

import shlex
import sys
from collections.abc import Callable
from contextlib import suppress
from typing import TYPE_CHECKING, TypeVar

import click

from diffbotctl.errors import Problem, RunError

if TYPE_CHECKING:
    from diffbotctl.config.configuration import Configuration
    from diffbotctl.programs.driver import ProgramsDriver

Result = TypeVar("Result")


def with_code_consent(read: Callable[[], Result], is_given: bool = False) -> Result:
    """What `read` returns, which reads a configuration, once its files with code are allowed.

    `is_given`: --allow-programs; otherwise a person is asked, once for each content of a file.
    Raises CodeConsentError without a terminal to ask on, or if the person refuses.
    """
    from diffbotctl.config import consents
    from diffbotctl.config.code_files import CodeConsentError

    while True:
        try:
            return read()
        except CodeConsentError as error:
            keys = dict.fromkeys(code.consent_key for code in error.files)
            if is_given:
                for key in keys:
                    consents.allow_here(key)
                continue
            if not _is_on_terminal():
                raise
            click.echo("The code in these files would run with your rights:")
            for path in dict.fromkeys(code.path.resolve() for code in error.files):
                click.echo(f"  {path}")
            if not click.confirm("Allow it, until a file changes?"):
                raise
            for key in keys:
                _remember(key)


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
    from diffbotctl.config import consents
    from diffbotctl.programs.consent import consent_key

    try:
        key = consent_key(configuration)
    except OSError as error:
        problem = Problem("E-PROGRAM", str(error.filename), f"cannot be read: {error.strerror}")
        raise RunError(problem) from error
    if consents.is_allowed(key):
        return
    if _is_on_terminal():
        click.echo(f"{configuration.file} starts these programs with your rights:")
        for use in configuration.programs:
            click.echo(f"  {use.name}: {shlex.join(use.words)}   (in {use.folder})")
        if click.confirm("Allow them, until the pipeline or a program changes?"):
            _remember(key)
            return
    cause = f"the programs of {configuration.file} have not been allowed"
    fix = "run it on a terminal, which asks, or give --allow-programs"
    raise RunError(Problem("E-PROGRAM-CONSENT", "programs", cause, fix))


def _is_on_terminal() -> bool:
    return sys.stdin.isatty() and sys.stdout.isatty()


def _remember(key: str) -> None:
    from diffbotctl.config import consents

    with suppress(OSError):  # it is asked again
        consents.remember(key)
