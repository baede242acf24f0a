"""Options that contradict each other, or have no effect without another one: they are refused.

What is silently ignored is taken for done: a person who types `--json` waits for JSON.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import wraps
from typing import Any

import click
from click.core import ParameterSource

Command = Callable[..., Any]
TYPED = (ParameterSource.COMMANDLINE, ParameterSource.ENVIRONMENT)


def exclusive(one: str, others: Sequence[str], reason: str) -> Callable[[Command], Command]:
    """Refuse the parameter `one` together with any of `others`, for `reason`.

    A parameter is named as it is typed: `--json`, or `PIPELINE` for an argument.
    """

    def check(context: click.Context) -> None:
        for other in others:
            if is_typed(context, one) and is_typed(context, other):
                refuse_pair(one, other, reason)

    return _checked_first(check)


def needs(
    options: Sequence[str], needed: Sequence[str], reason: str
) -> Callable[[Command], Command]:
    """Refuse each of `options` without any of the options `needed`, for `reason`."""

    def check(context: click.Context) -> None:
        if any(is_typed(context, option) for option in needed):
            return
        for option in options:
            if is_typed(context, option):
                raise click.UsageError(f"{option} has no effect without {needed[0]}: {reason}")

    return _checked_first(check)


def refuse_pair(one: str, other: str, reason: str) -> None:
    """Raises click.UsageError for two options that exclude each other."""
    raise click.UsageError(f"{one} and {other} exclude each other: {reason}; leave one out")


def check_span(begin: float | None, end: float | None) -> None:
    """Raises click.UsageError for a span from `begin` to `end` (s) without anything in it."""
    if begin is not None and begin < 0.0:
        raise click.UsageError(f"--from {begin:g} s is before the start, which is 0 s")
    if end is not None and end <= 0.0:
        raise click.UsageError(f"--until {end:g} s is not after the start, which is 0 s")
    if begin is not None and end is not None and begin >= end:
        raise click.UsageError(f"--from {begin:g} s is not before --until {end:g} s")


def is_typed(context: click.Context, name: str) -> bool:
    """Whether the user gave the parameter called `name` on the command line."""
    for parameter in context.command.params:
        if name in (*parameter.opts, parameter.human_readable_name.strip("[].")):
            own = parameter.name or ""
            # Before version 8.2 of click an argument that takes any number of words counts as
            # typed with none, too.
            is_empty = context.params.get(own) == ()
            return context.get_parameter_source(own) in TYPED and not is_empty
    raise AssertionError(f"{context.command_path} has no parameter {name}")


def refuse_before_subcommand(context: click.Context) -> None:
    """Raises click.UsageError for options of a group in front of its command, which has its own."""
    for parameter in context.command.params:
        if is_typed(context, parameter.opts[0]):
            option, command = parameter.opts[0], context.invoked_subcommand
            raise click.UsageError(
                f"{option} has no effect before '{command}': write it after '{command}', if that "
                f"has the option (`{context.command_path} {command} --help`)"
            )


def _checked_first(check: Callable[[click.Context], None]) -> Callable[[Command], Command]:
    def decorate(command: Command) -> Command:
        @wraps(command)
        def checked(*arguments: Any, **values: Any) -> Any:
            context = click.get_current_context(silent=True)
            if context is not None:  # another module may call the function: nothing was typed
                check(context)
            return command(*arguments, **values)

        return checked

    return decorate
