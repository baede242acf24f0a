"""Commands declared by their functions: each parameter of one is an argument or an option.

    @command("Look", 5, "Print messages")
    def echo(topic: str, once: bool = option("Print one."), engine: str | None = ENGINE) -> int:

A parameter without a default is an argument. `bool` is a flag, `tuple[...]` may be given several
times, `Path` is a file, `| None` may be left out. A parameter annotated with a NamedTuple stands
for all of its fields. `cli.main` finds the commands by the lines `@command(` and `@group(`.
"""

from __future__ import annotations

import re
from collections.abc import Callable
from functools import wraps
from inspect import Parameter, signature, unwrap
from itertools import pairwise
from pathlib import Path
from typing import Any, cast

import click

Function = Callable[..., Any]
Decorator = Callable[[Function], Function]

FILE = click.Path(dir_okay=False, path_type=Path)
ANY_PATH = click.Path(path_type=Path)
SENTENCE_MAX = 1000  # characters; longer than that of any command
NEGATIVE_NUMBERS = {"ignore_unknown_options": True}  # -0.2 is a number here, not an option
OPTION_MIN_LIKENESS = 0.7  # of 1
UNKNOWN_OPTION = re.compile(r"--?[A-Za-z]")


class DeclaredParameter:
    """What click is given for a parameter besides its name and type; `also`: hidden others."""

    def __init__(
        self, kind: Function, names: tuple[str, ...], settings: dict[str, Any], also: Any = None
    ) -> None:
        self.kind, self.names, self.settings, self.also = kind, names, settings, also

    def decorators(self, name: str, annotation: str) -> list[Decorator]:
        """The decorators of click that add the parameter `name` to a command."""
        settings = _settings_of(annotation, self.kind is click.option) | self.settings
        names = self.names
        if self.kind is click.option and not names:
            names = (f"--{name.replace('_', '-')}",)
        own = self.kind(*names, name, **settings)
        return [own] if self.also is None else [own, self.also]


def option(*words: str, also: Any = None, **settings: Any) -> Any:
    """Declare an option: its names, if they are not that of the parameter, and its help.

    `settings` are those of click.option.
    """
    names = tuple(word for word in words if word.startswith("-"))
    texts = [word for word in words if not word.startswith("-")]
    if texts:
        settings["help"] = texts[0]
    return DeclaredParameter(click.option, names, settings, also)


def argument(metavar: str | None = None, **settings: Any) -> Any:
    """Declare an argument; `settings` are those of click.argument."""
    if metavar is not None:
        settings["metavar"] = metavar
    return DeclaredParameter(click.argument, (), settings)


def _settings_of(annotation: str, is_option: bool) -> dict[str, Any]:
    if annotation == "bool":
        return {"is_flag": True}
    settings: dict[str, Any] = {}
    if "Path" in annotation:
        settings |= {"type": FILE, "metavar": "FILE"} if is_option else {"type": ANY_PATH}
    if annotation.startswith("tuple["):
        settings |= {"multiple": True} if is_option else {"nargs": -1}
    elif not is_option and "| None" in annotation:
        settings["required"] = False
    return settings


def _declared(function: Function) -> Function:
    """The function as click calls it, with all parameters that its signature declares."""
    own = unwrap(function)
    groups: dict[str, Any] = {}
    decorators: list[Decorator] = []
    for name, parameter in signature(own).parameters.items():
        kind: Any = own.__globals__.get(parameter.annotation)
        if hasattr(kind, "_field_defaults"):
            groups[name] = kind
            for field, annotation in kind.__annotations__.items():
                declared = kind._field_defaults.get(field) or argument()
                decorators += declared.decorators(field, _text(annotation))
        else:
            is_plain = parameter.default is Parameter.empty
            declared = argument() if is_plain else parameter.default
            decorators += declared.decorators(name, parameter.annotation)

    @wraps(function)
    def call(**values: Any) -> Any:
        for name, kind in groups.items():
            values[name] = kind(**{field: values.pop(field) for field in kind._fields})
        return function(**values)

    added: Function = call
    for decorate in reversed(decorators):
        added = decorate(added)
    return added


def _text(annotation: Any) -> str:
    """An annotation as it is written; NamedTuple wraps it."""
    return str(getattr(annotation, "__forward_arg__", annotation))


def command(
    group: str, place: int, help: str, **settings: Any
) -> Callable[[Function], click.Command]:
    """Declare a command of `diffbotctl`.

    `group`, `place`: where it is in --help. `help`: what it does, in a few words; `; ...` continues
    the row of the command before it. `settings` are those of click.command.
    """
    return subcommand(**settings)


def subcommand(name: str | None = None, **settings: Any) -> Callable[[Function], click.Command]:
    """Declare a command that a group of commands gets by `add_command`."""

    def make(function: Function) -> click.Command:
        own: Callable[[Function], Any] = click.command(name or function.__name__, **settings)
        return cast(click.Command, own(_declared(function)))

    return make


def group(group: str, place: int, help: str, **settings: Any) -> Callable[[Function], CommandGroup]:
    """As `command`, of a group of commands, which are added by its method `command`."""

    return cast(
        "Callable[[Function], CommandGroup]",
        command(group, place, help, cls=CommandGroup, **settings),
    )


class CommandGroup(click.Group):
    """A group whose help folds the sentences of its commands; click cuts each to one line.

    A command that it does not have is answered with those that it has.
    """

    def command(  # type: ignore[override]
        self, name: str | None = None, **settings: Any
    ) -> Callable[[Function], click.Command]:
        """Declare a command of this group; its name is that of the function unless it is given."""

        def add(function: Function) -> click.Command:
            made = subcommand(name, **settings)(function)
            self.add_command(made)
            return made

        return add

    def resolve_command(self, ctx: click.Context, args: list[str]) -> Any:
        """As click does; raises click.UsageError with the names of the commands."""
        if args and not args[0].startswith("-") and self.get_command(ctx, args[0]) is None:
            raise click.UsageError(self.unknown_command(args[0]), ctx)
        return super().resolve_command(ctx, args)

    def unknown_command(self, word: str) -> str:
        """The error text for a command that this group does not have."""
        from diffbotctl.errors import closest_match

        known = sorted(name for name, command in self.commands.items() if not command.hidden)
        near = closest_match(word, known)
        fix = f"use one of {', '.join(known)}" if near is None else f"did you mean {near}?"
        return f"there is no command '{word}' here; {fix}"

    def format_commands(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        """The section `Commands`: names and sentences."""
        commands = [(name, self.commands[name]) for name in self.list_commands(ctx)]
        rows = [
            (name, command.get_short_help_str(SENTENCE_MAX))
            for name, command in commands
            if not command.hidden
        ]
        with formatter.section("Commands"):
            formatter.write_dl(rows)


class NumbersCommand(click.Command):
    """A command with NEGATIVE_NUMBERS: an option that it does not have is refused all the same."""

    def parse_args(self, ctx: click.Context, args: list[str]) -> list[str]:
        """As click does; raises click.NoSuchOption."""
        known = [name for parameter in self.get_params(ctx) for name in parameter.opts]
        options = [name for name in known if name.startswith("-")]
        values = {  # that follow an option of their own
            after for word, after in pairwise(args) if word in options and word.startswith("--")
        }
        for word in args[: args.index("--")] if "--" in args else args:
            name = word.partition("=")[0]
            if UNKNOWN_OPTION.match(word) and name not in options and word not in values:
                from diffbotctl.errors import closest_match

                near = closest_match(name, options, OPTION_MIN_LIKENESS)
                raise click.NoSuchOption(name, possibilities=[near] if near else None, ctx=ctx)
        return super().parse_args(ctx, args)


def require_packages(code: str, subject: str, extra: str, *packages: str) -> None:
    """Raises RunError with `code` if a package of the optional `extra` is not installed."""
    from importlib import import_module

    from diffbotctl.errors import Problem, RunError

    try:
        for package in packages:
            import_module(package)
    except ImportError as error:
        cause = f"the package {error.name} is not installed"
        fix = f"pip install 'diffbotctl[{extra}]'"
        raise RunError(Problem(code, subject, cause, fix)) from error
