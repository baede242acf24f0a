"""Options and arguments that several commands share: each means the same everywhere."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import click

from diffbotctl.cli.command import option

VIRTUAL_PORTS = ("sim", "emulated")  # those of drivers.robot_ports, which takes 50 ms to import
ROBOT_HELP = "Robot file or name; default: the only one in ./robots, or book_2wd."
TCP_PORT_MAX = 65535
AT = "diffbotctl.at"  # key of the context: the computer named by --at
ROBOT_ARGUMENT = "diffbotctl.robot"  # key of the context: the robot named by the argument
METAVARS = {"s": "TIME", "m": "LENGTH", "rad": "ANGLE", "m/s": "SPEED", "rad/s": "RATE"}

if TYPE_CHECKING:
    FloatType = click.ParamType[float]
else:  # before version 8.2 of click the class is not generic
    FloatType = click.ParamType


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


def _note_host(ctx: click.Context, param: click.Parameter, host: str | None) -> None:
    ctx.meta[AT] = host or ""


def _note_robot(ctx: click.Context, param: click.Parameter, robot: str | None) -> None:
    ctx.meta[ROBOT_ARGUMENT] = robot


def _robot_once(ctx: click.Context, param: click.Parameter, robot: str | None) -> str | None:
    argument: str | None = ctx.meta.get(ROBOT_ARGUMENT)
    if argument is not None and robot is not None:
        raise click.UsageError("give the robot once: as an argument or with --robot")
    return argument or robot


def quantity_option(unit: str, *words: str, positive: bool = False, **settings: Any) -> Any:
    """An option with a quantity; `words`, `settings`: as for `option`."""
    kind = Quantity(unit, positive)
    return option(*words, type=kind, **{"metavar": METAVARS[unit]} | settings)


# `--engine NAME`, and `--at HOST`, which is not passed to the command but noted: see `AT`.
ENGINE = option(
    "Name of the engine; needed when several are running.",
    metavar="NAME",
    also=click.option(
        "--at",
        metavar="USER@HOST",
        expose_value=False,
        callback=_note_host,
        help="The engine is on this computer, reached through ssh.",
    ),
)
ROBOT = option(ROBOT_HELP, metavar="ROBOT")
# ROBOT as the command's argument; `--robot ROBOT` is accepted too.
ROBOT_OBJECT = option(
    "The same as the argument.",
    metavar="ROBOT",
    callback=_robot_once,
    also=click.argument(
        "robot_argument",
        metavar="[ROBOT]",
        required=False,
        expose_value=False,
        is_eager=True,
        callback=_note_robot,
    ),
)
SEED = option("Random seed of the simulated robot.", default=0, show_default=True)
SETS = option("--set", "Change one value of the files. Repeatable.", metavar="BLOCK.PARAM=VALUE")
JSON = option("--json", "Print JSON, one object on a line.")
FORCE = option("Overwrite an existing file.")
ANSWERS = option("YAML file with the answers to all questions.")
YES = option("Do not ask for confirmation.")
FOR = quantity_option("s", "--for", "Stop after this time, such as 10s.", positive=True)
VIEW = option("--view", "Open with a saved view.")
ASCII = option("--ascii", "Draw with ASCII characters only.")


def number_option(
    default: float, minimum: float, maximum: float, *words: str, **settings: Any
) -> Any:
    """An option with a number in a range, whole if `default` is; its help shows both."""
    kind: click.IntRange | click.FloatRange = click.FloatRange(minimum, maximum)
    if isinstance(default, int):
        kind = click.IntRange(int(minimum), int(maximum))
    return option(*words, default=default, show_default=True, type=kind, **settings)


def choice_option(choices: Sequence[str], *words: str, default: str | None = "") -> Any:
    """An option with one of `choices`, by default the first one; its help shows them."""
    chosen = choices[0] if default == "" else default
    return option(*words, type=click.Choice(choices), default=chosen, show_default=True)


def tcp_port_option(default: int, help: str) -> Any:
    """`--tcp-port NUMBER`."""
    return number_option(default, 1, TCP_PORT_MAX, help, metavar="NUMBER")


def port_option(default: str, only_board: bool = False, is_checked: bool = True) -> Any:
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

    return option(kinds, metavar="PORT", default=default, show_default=True, callback=check)


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
