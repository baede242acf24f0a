"""`diffbotctl blocks`: the blocks there are, and what each takes and gives."""

from __future__ import annotations

import json
import sys
import time
from collections.abc import Iterator
from typing import TYPE_CHECKING, Any

import click

from diffbotctl.cli.engine_client import engine_option

if TYPE_CHECKING:
    from diffbotctl.block import Block
    from diffbotctl.control_socket.client import ControlClient
    from diffbotctl.params import Declaration


@click.group(invoke_without_command=True)
@click.option("--live", is_flag=True, help="Those of a running engine: rate, cost, last error.")
@engine_option
@click.pass_context
def command(ctx: click.Context, live: bool, engine: str | None) -> int:
    """List the blocks there are; `blocks show NAME` tells all about one."""
    if ctx.invoked_subcommand is not None:
        return 0
    if live or engine is not None:
        return _live(engine)
    from diffbotctl.config import registry
    from diffbotctl.ui.text import fold_text

    for name in registry.names():
        try:
            sentence = first_sentence(registry.block(name))
        except registry.RegistryError as error:
            sentence = f"cannot be used: {error}"
        click.echo(fold_text(f"{name:15} {sentence}", hang=16))
    clashes = registry.clashes()
    for clash in clashes:
        click.echo(f"{clash.code}: {clash}; {clash.fix}", err=True)
    return 2 if clashes else 0


def _live(engine: str | None) -> int:
    from diffbotctl.cli.engine_client import attached

    with attached(engine, "blocks") as caller:
        rows = _measured(caller)
    if not sys.stdout.isatty():
        for row in rows:
            click.echo(json.dumps(row))
        return 0
    click.echo(f"{'block':15} {'class':16} {'rate':>16} {'busy':>8} {'overruns':>9}  last error")
    for row in rows:
        click.echo(_row(row))
    return 0


def _measured(caller: ControlClient) -> list[dict[str, Any]]:
    """The rows once the engine has measured them; as they are when it does not in time."""
    deadline = time.monotonic() + MEASURING
    while True:
        rows: list[dict[str, Any]] = caller.ask("blocks")["blocks"]
        if all(row["busy"] is not None for row in rows) or time.monotonic() > deadline:
            return rows
        time.sleep(LOOK)


MEASURING = 3.0  # s; a share is taken over one, and a robot that is away wakes nobody
LOOK = 0.1  # s between two looks


def _row(row: dict[str, Any]) -> str:
    from diffbotctl.cli.engine_client import paced

    busy = "-" if row["busy"] is None else f"{100 * row['busy']:.2f} %"
    overruns = "-" if row["overruns"] is None else row["overruns"]
    error = row["last_error"]
    said = "" if error is None else f"at {error['time'] / 1e9:.1f} s: {error['text']}"
    return (
        f"{row['block']:15} {row['class']:16} {paced(row).strip():>16} {busy:>8} {overruns:>9}"
        f"  {said}"
    ).rstrip()


@command.command()
@click.argument("name")
def show(name: str) -> int:
    """Show the ports and parameters of the block NAME."""
    from diffbotctl.config import registry
    from diffbotctl.errors import Problem, UsageError
    from diffbotctl.ui.text import fold_text

    try:
        kind = registry.block(name)
    except registry.RegistryError as error:
        raise UsageError(Problem(error.code, "blocks", str(error), error.fix)) from None
    for line in described(name, kind):
        click.echo(fold_text(line, hang=4))
    return 0


def first_sentence(kind: type[Block]) -> str:
    """What a block is for, in one line."""
    return " ".join((kind.__doc__ or "").strip().split("\n\n")[0].split())


def described(name: str, kind: type[Block]) -> Iterator[str]:
    """All that is declared about a block, as lines."""
    from inspect import cleandoc

    from diffbotctl.block import actions, inputs, outputs, robot_fields
    from diffbotctl.params import declared

    yield f"{name}\n"
    yield cleandoc(kind.__doc__ or "")
    yield from _titled("inputs", [_input(port, each) for port, each in inputs(kind).items()])
    yield from _titled(
        "outputs",
        [(port, f"{each.kind.__name__}  {each.help}") for port, each in outputs(kind).items()],
    )
    yield from _titled(
        "parameters", [(each.key, _parameter(each)) for each in declared(kind).values()]
    )
    yield from _titled("from the robot file", [(path, "") for path in robot_fields(kind).values()])
    yield from _titled(
        "actions", [(each, (doing.__doc__ or "").strip()) for each, doing in actions(kind).items()]
    )


def _titled(title: str, rows: list[tuple[str, str]]) -> Iterator[str]:
    if rows:
        yield f"\n{title}"
        width = max(len(name) for name, _ in rows)
        for name, text in rows:
            yield f"  {name:{width}}  {text}".rstrip()


def _input(name: str, port: Any) -> tuple[str, str]:
    from diffbotctl.block import In

    if not isinstance(port, In):
        return name, f"timer, every {_seconds(port.period)}"
    notes = [
        "optional" if port.optional else "",
        "" if port.trigger else "only looked at",
        f"fresh for {_seconds(port.fresh_for)}" if port.fresh_for is not None else "",
    ]
    noted = ", ".join(note for note in notes if note)
    return name, f"{port.kind.__name__}{f' ({noted})' if noted else ''}  {port.help}"


def _seconds(period: float | str) -> str:
    return f"{period:g} s" if isinstance(period, float | int) else f"the parameter {period}"


def _parameter(setting: Declaration) -> str:
    unit = setting.unit if setting.unit not in ("", "1") else getattr(setting.kind, "__name__", "")
    default = "must be given" if setting.is_required else f"default {_written(setting)}"
    choices = [f"one of {', '.join(map(str, setting.choices))}"] if setting.choices else []
    live = ["may change while running"] if setting.live else []
    notes = ", ".join([default, *setting.bound_phrases(), *choices, *live])
    return f"{unit}, {notes}.  {setting.help}"


def _written(setting: Declaration) -> str:
    from diffbotctl.params import with_unit

    if isinstance(setting.default, float):
        return with_unit(setting.default, setting.unit)
    return "none" if setting.default is None else str(setting.default).replace("False", "false")
