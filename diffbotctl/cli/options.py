"""Options and arguments that several commands share: each means the same everywhere.

Also the class of groups of commands.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Sequence
from functools import wraps
from itertools import pairwise
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

Command = Callable[..., Any]

VIRTUAL_PORTS = ("sim", "emulated")  # those of drivers.robot_ports, which takes 50 ms to import
ROBOT_HELP = "Robot file or name; default: the only one in ./robots, or book_2wd."


if TYPE_CHECKING:
    FloatType = click.ParamType[float]
else:  # before version 8.2 of click the class is not generic
    FloatType = click.ParamType


SENTENCE_MAX = 1000  # characters; longer than that of any command


class CommandGroup(click.Group):
    """A group whose help folds the sentences of its commands; click cuts each to one line.

    A command that it does not have is answered with those that it has.
    """

    def resolve_command(self, ctx: click.Context, args: list[str]) -> Any:
        """As click does; raises click.UsageError with the names of the commands."""
        if args and not args[0].startswith("-") and self.get_command(ctx, args[0]) is None:
            raise click.UsageError(self.unknown_command(args[0]), ctx)
        return super().resolve_command(ctx, args)

    def unknown_command(self, word: str) -> str:
        """The error text for a command that this group does not have."""
        known = sorted(name for name, command in self.commands.items() if not command.hidden)
        from diffbotctl.errors import closest_match

        near = closest_match(word, known)
        fix = f"use one of {', '.join(known)}" if near is None else f"did you mean {near}?"
        return f"there is no command '{word}' here; {fix}"

    def format_commands(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        """The section `Commands`: names and sentences."""
        commands = [(name, self.get_command(ctx, name)) for name in self.list_commands(ctx)]
        rows = [
            (name, command.get_short_help_str(SENTENCE_MAX))
            for name, command in commands
            if command is not None and not command.hidden
        ]
        with formatter.section("Commands"):
            formatter.write_dl(rows)


NEGATIVE_NUMBERS = {"ignore_unknown_options": True}  # -0.2 is a number here, not an option
OPTION_MIN_LIKENESS = 0.7  # of 1
UNKNOWN_OPTION = re.compile(r"--?[A-Za-z]")


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


class Quantity(FloatType):
    """A number with or without a unit, such as 20cm/s, as a float in SI.

    `unit` is the SI unit; `positive` refuses zero and negative values.
    """

    def __init__(self, unit: str, positive: bool = False) -> None:
        self.unit, self.positive = unit, positive
        self.name = unit

    def convert(
        self, value: Any, param: click.Parameter | None, ctx: click.Context | None
    ) -> float:
        """The value in SI; fails as click's types do."""
        from math import isfinite

        from diffbotctl.units import UnitError, magnitude_max, typed_quantity

        try:
            number = typed_quantity(value, self.unit) if isinstance(value, str) else float(value)
        except UnitError as error:
            self.fail(str(error), param, ctx)
        if not isfinite(number) or (self.positive and number <= 0.0):
            must = "a finite number" if not isfinite(number) else "above 0"
            self.fail(f"{value} is not possible: it must be {must}", param, ctx)
        limit = magnitude_max(self.unit)
        if abs(number) > limit:
            text = f"{limit:g} {self.unit}"
            self.fail(f"{value} is more than {text}, the largest that is possible", param, ctx)
        return number


FILE = click.Path(dir_okay=False, path_type=Path)

AT = "diffbotctl.at"  # key of the context: the computer named by --at


def _note_host(ctx: click.Context, param: click.Parameter, host: str | None) -> None:
    ctx.meta[AT] = host or ""


def engine_option(command: Command) -> Command:
    """`--engine NAME`, and `--at HOST`, which is not passed to the command but noted: see `AT`."""
    name = click.option(
        "--engine", metavar="NAME", help="Name of the engine; needed when several are running."
    )
    host = click.option(
        "--at",
        metavar="USER@HOST",
        expose_value=False,
        callback=_note_host,
        help="The engine is on this computer, reached through ssh.",
    )
    return name(host(command))


robot_option = click.option("--robot", metavar="ROBOT", help=ROBOT_HELP)
seed_option = click.option(
    "--seed", default=0, show_default=True, help="Random seed of the simulated robot."
)
set_option = click.option(
    "--set",
    "sets",
    multiple=True,
    metavar="BLOCK.PARAM=VALUE",
    help="Change one value of the files. Repeatable.",
)
json_option = click.option(
    "--json", "as_json", is_flag=True, help="Print JSON, one object on a line."
)
force_option = click.option("--force", is_flag=True, help="Overwrite an existing file.")
answers_option = click.option(
    "--answers", metavar="FILE", type=FILE, help="YAML file with the answers to all questions."
)
yes_option = click.option("--yes", is_flag=True, help="Do not ask for confirmation.")
for_option = click.option(
    "--for",
    "duration",
    metavar="TIME",
    type=Quantity("s", positive=True),
    help="Stop after this time, such as 10s.",
)


view_option = click.option(
    "--view", "view_file", metavar="FILE", type=FILE, help="Open with a saved view."
)


def number_option(
    name: str, default: float, minimum: float, maximum: float, help: str
) -> Callable[[Command], Command]:
    """An option with a number in a range, whole if `default` is; its help shows both."""
    kind: click.IntRange | click.FloatRange = click.FloatRange(minimum, maximum)
    if isinstance(default, int):
        kind = click.IntRange(int(minimum), int(maximum))
    return click.option(name, default=default, show_default=True, type=kind, help=help)


def choice_option(name: str, choices: Sequence[str], help: str) -> Callable[[Command], Command]:
    """An option with one of `choices`, the first one by default; its help shows them."""
    kind = click.Choice(choices)
    return click.option(name, type=kind, default=choices[0], show_default=True, help=help)


def port_option(
    default: str, only_board: bool = False, is_checked: bool = True
) -> Callable[[Command], Command]:
    """`--port`; `only_board`: a simulated robot makes no sense for the command.

    A device that is not there is refused, before anything is printed or asked, if `is_checked`.
    """
    kinds = "A serial device, bluetooth:ADDRESS, or auto (the only board connected)."
    if not only_board:
        kinds = f"sim, emulated, {kinds[0].lower()}{kinds[1:]}"
    words = ("auto",) if only_board else (*VIRTUAL_PORTS, "auto")

    def check(ctx: click.Context, param: click.Parameter, port: str) -> str:
        if is_checked and port not in words and not ctx.resilient_parsing:
            _check_port(port, words)
        return port

    return click.option(
        "--port", metavar="PORT", default=default, show_default=True, help=kinds, callback=check
    )


def _check_port(port: str, words: Sequence[str]) -> None:
    """Raises UserError for a device that is not there; `words` may be given in place of one."""
    import os

    if os.path.lexists(port):
        return
    if port in VIRTUAL_PORTS:
        from diffbotctl.errors import Problem, UsageError

        cause = "this command needs a board"
        fix = "`diffbotctl emulate` starts a virtual one"
        raise UsageError(Problem("E-PORT-KIND", f"port {port}", cause, fix))
    from diffbotctl.drivers.socket_port import is_socket

    if is_socket(port):
        return  # may appear later; its name is checked when it is opened
    from diffbotctl.drivers.serial_port import missing_port_error

    raise missing_port_error(port, words)


def output_option(help: str) -> Callable[[Command], Command]:
    """`--output FILE` with its `--force`."""

    def add(command: Command) -> Command:
        option = click.option("--output", metavar="FILE", type=FILE, help=help)
        return option(force_option(command))

    return add


def robot_object(command: Command) -> Command:
    """ROBOT as the command's argument; `--robot ROBOT` is accepted too."""

    @click.argument("robot_argument", metavar="[ROBOT]", required=False)
    @click.option("--robot", metavar="ROBOT", help="The same as the argument.")
    @wraps(command)
    def merged(robot_argument: str | None, robot: str | None, **others: Any) -> Any:
        if robot_argument is not None and robot is not None:
            raise click.UsageError("give the robot once: as an argument or with --robot")
        return command(robot=robot_argument or robot, **others)

    return merged
