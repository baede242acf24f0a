"""`diffbotctl blocks`: the available blocks and drivers, their ports and parameters."""

from __future__ import annotations

import time
from collections.abc import Iterator
from inspect import cleandoc
from typing import TYPE_CHECKING, Any

import click

from diffbotctl.cli.command import group, option
from diffbotctl.cli.contradictions import refuse_before_subcommand
from diffbotctl.cli.engine_client import attached, host, rate_text
from diffbotctl.cli.options import ENGINE, JSON
from diffbotctl.cli.output import print_json, print_row
from diffbotctl.errors import Problem, UsageError
from diffbotctl.ui.text import fold_text

if TYPE_CHECKING:
    from diffbotctl.block import Block
    from diffbotctl.control_socket.client import ControlClient
    from diffbotctl.device import DeviceDriver
    from diffbotctl.params import Declaration

MEASURING_TIMEOUT_S = 3.0  # a load is measured over 1 s
POLL_PERIOD_S = 0.1


@group("Look", 8, "List blocks", invoke_without_command=True)
def blocks(
    running: bool = option(
        "--running", "--live", "The blocks of a running engine: rate, load, errors."
    ),
    as_json: bool = JSON,
    engine: str | None = ENGINE,
) -> int:
    """List the available blocks and drivers; `blocks show NAME` describes one."""
    ctx = click.get_current_context()
    if ctx.invoked_subcommand is not None:
        refuse_before_subcommand(ctx)
        return 0
    if running or engine is not None or host():
        return _list_running(engine, as_json)
    return _list_available(as_json)


def _list_available(as_json: bool) -> int:
    from diffbotctl.config import registry

    for name in registry.names():
        try:
            sentence = first_sentence(registry.block(name))
        except registry.RegistryError as error:
            sentence = f"cannot be used: {error}"
        print_row(
            as_json, {"block": name, "help": sentence}, fold_text(f"{name:15} {sentence}", hang=16)
        )
    for name in registry.driver_names():
        try:
            sentence = f"(driver) {first_sentence(registry.driver(name))}"
        except registry.RegistryError as error:
            sentence = f"(driver) cannot be used: {error}"
        print_row(
            as_json,
            {"driver": name, "help": sentence.removeprefix("(driver) ")},
            fold_text(f"{name:15} {sentence}", hang=16),
        )
    clashes = registry.clashes()
    for clash in clashes:
        click.echo(f"{clash.code}: {clash}; {clash.fix}", err=True)
    return 2 if clashes else 0


def _list_running(engine: str | None, as_json: bool) -> int:
    with attached(engine, "blocks") as client:
        rows = _measured_rows(client)
    if as_json:
        for row in rows:
            print_json(row)
        return 0
    click.echo(f"{'block':15} {'class':16} {'rate':>16} {'busy':>8} {'overruns':>9}  last error")
    for row in rows:
        click.echo(_row_text(row))
    return 0


def _measured_rows(client: ControlClient) -> list[dict[str, Any]]:
    """The rows when the engine has measured the load of every block, or at the time limit."""
    deadline = time.monotonic() + MEASURING_TIMEOUT_S
    while True:
        rows: list[dict[str, Any]] = client.request("list_blocks")["blocks"]
        if all(row["busy"] is not None for row in rows) or time.monotonic() > deadline:
            return rows
        time.sleep(POLL_PERIOD_S)


def _row_text(row: dict[str, Any]) -> str:
    busy = "-" if row["busy"] is None else f"{100 * row['busy']:.2f} %"
    overruns = "-" if row["overruns"] is None else row["overruns"]
    error = row["last_error"]
    error_text = "" if error is None else f"at {error['time'] / 1e9:.1f} s: {error['text']}"
    return (
        f"{row['block']:15} {row['class']:16} {rate_text(row).strip():>16} {busy:>8}"
        f" {overruns:>9}  {error_text}"
    ).rstrip()


@blocks.command()
def show(name: str, as_json: bool = JSON) -> None:
    """Show the ports and parameters of the block or driver NAME, or of ./FILE.py:CLASS."""
    from diffbotctl.block import Block
    from diffbotctl.config import registry
    from diffbotctl.config.code_files import CodeFiles, is_code

    kind: type[Block] | type[DeviceDriver]
    try:
        if is_code(name):
            kind = CodeFiles().find(name, None, Block)
        else:
            is_driver = name not in registry.names() and name in registry.driver_names()
            kind = registry.driver(name) if is_driver else registry.block(name)
    except registry.RegistryError as error:
        place = error.place or "blocks"
        raise UsageError(Problem(error.code, place, str(error), error.fix)) from None
    if as_json:
        print_json(block_record(name, kind))
        return
    for line in block_lines(name, kind):
        click.echo(fold_text(line, hang=4))


def first_sentence(kind: type[Block] | type[DeviceDriver]) -> str:
    return " ".join((kind.__doc__ or "").strip().split("\n\n")[0].split())


def block_record(name: str, kind: type[Block] | type[DeviceDriver]) -> dict[str, Any]:
    from diffbotctl.block import In, actions, inputs, outputs, robot_fields
    from diffbotctl.message_types import type_name
    from diffbotctl.params import declared

    ports = {port: entry for port, entry in inputs(kind).items() if isinstance(entry, In)}
    return {
        "block": name,
        "help": first_sentence(kind),
        "inputs": {port: type_name(entry.kind) for port, entry in ports.items()},
        "outputs": {port: type_name(entry.kind) for port, entry in outputs(kind).items()},
        "parameters": {
            setting.key: {
                "type": getattr(setting.kind, "__name__", str(setting.kind)),
                "unit": setting.unit,
                "default": None if setting.is_required else setting.default,
                "required": setting.is_required,
                "live": setting.live,
                "help": setting.help,
            }
            for setting in declared(kind).values()
        },
        "robot_fields": list(robot_fields(kind).values()),
        "actions": list(actions(kind)),
    }


def block_lines(name: str, kind: type[Block] | type[DeviceDriver]) -> Iterator[str]:
    from diffbotctl.block import actions, inputs, outputs, robot_fields
    from diffbotctl.message_types import type_name
    from diffbotctl.params import declared

    yield f"{name}\n"
    yield "\n\n".join(map(_paragraph, cleandoc(kind.__doc__ or "").split("\n\n")))
    yield from _section("inputs", [_input_row(port, entry) for port, entry in inputs(kind).items()])
    yield from _section(
        "outputs",
        [(port, f"{type_name(entry.kind)}  {entry.help}") for port, entry in outputs(kind).items()],
    )
    yield from _section(
        "parameters", [(entry.key, _parameter_text(entry)) for entry in declared(kind).values()]
    )
    yield from _section("from the robot file", [(path, "") for path in robot_fields(kind).values()])
    yield from _section(
        "actions",
        [(action, (method.__doc__ or "").strip()) for action, method in actions(kind).items()],
    )


def _paragraph(text: str) -> str:
    """A paragraph of a docstring for the terminal; an example, which is indented, stays."""
    if any(line.startswith(" ") for line in text.split("\n")):
        return text
    return fold_text(" ".join(text.split("\n")))


def _section(title: str, rows: list[tuple[str, str]]) -> Iterator[str]:
    if rows:
        yield f"\n{title}"
        width = max(len(name) for name, _ in rows)
        for name, text in rows:
            yield f"  {name:{width}}  {text}".rstrip()


def _input_row(name: str, port: Any) -> tuple[str, str]:
    from diffbotctl.block import In
    from diffbotctl.message_types import type_name

    if not isinstance(port, In):
        return name, f"timer, every {_period_text(port.period)}"
    notes = [
        "optional" if port.optional else "",
        "" if port.trigger else "sampled",
        f"fresh for {_period_text(port.fresh_for)}" if port.fresh_for is not None else "",
    ]
    note = ", ".join(filter(None, notes))
    return name, f"{type_name(port.kind)}{f' ({note})' if note else ''}  {port.help}"


def _period_text(period: float | str) -> str:
    return f"{period:g} s" if isinstance(period, float | int) else f"the parameter {period}"


def _parameter_text(setting: Declaration) -> str:
    unit = setting.unit if setting.unit not in ("", "1") else getattr(setting.kind, "__name__", "")
    default = "required" if setting.is_required else f"default {_default_text(setting)}"
    choices = [f"one of {', '.join(map(str, setting.choices))}"] if setting.choices else []
    live = ["may change while running"] if setting.live else []
    notes = ", ".join([default, *setting.bound_phrases(), *choices, *live])
    return f"{unit}, {notes}.  {setting.help}"


def _default_text(setting: Declaration) -> str:
    from diffbotctl.params import with_unit

    if isinstance(setting.default, float):
        return with_unit(setting.default, setting.unit)
    return "none" if setting.default is None else str(setting.default).replace("False", "false")
