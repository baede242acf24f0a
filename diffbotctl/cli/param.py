"""`diffbotctl param`: the parameters of a running engine's blocks."""

from __future__ import annotations

import json
import sys
from typing import Any

import click

from diffbotctl.cli.attach import attached, engine_option


@click.group()
def command() -> None:
    """List, read, change and save the parameters of running blocks."""


@command.command("list")
@click.option("--live", is_flag=True, help="Only those that may change while running.")
@engine_option
def list_(live: bool, engine: str | None) -> int:
    """Every parameter with its value and unit; * marks what may change while running."""
    for row in _parameters(engine):
        if row["live"] or not live:
            _show(row)
    return 0


@command.command("get")
@click.argument("parameter")
@engine_option
def get(parameter: str, engine: str | None) -> int:
    """The value of PARAMETER, such as guard.margin."""
    rows = {row["parameter"]: row for row in _parameters(engine)}
    if parameter not in rows:
        from diffbotctl.errors import nearest

        near = nearest(parameter, rows)
        hint = f" Did you mean {near}?" if near else ""
        raise click.UsageError(f"there is no parameter '{parameter}'.{hint}")
    _show(rows[parameter])
    return 0


@command.command("set")
@click.argument("parameter")
@click.argument("value")
@engine_option
def set_(parameter: str, value: str, engine: str | None) -> int:
    """Change PARAMETER to VALUE, such as guard.margin 8cm, while the robot runs.

    Only what its declaration calls live may change; nothing that the robot's safety rests on is.
    The change is recorded. It is gone after the run unless you `param save`.
    """
    with attached(engine, "param set") as caller:
        caller.ask("set", parameter=parameter, value=value)
    click.echo(f"{parameter} = {value}")
    return 0


def _parameters(engine: str | None) -> list[dict[str, Any]]:
    with attached(engine, "param") as caller:
        found: list[dict[str, Any]] = caller.ask("parameters")["parameters"]
    return found


def _show(row: dict[str, Any]) -> None:
    if not sys.stdout.isatty():
        click.echo(json.dumps(row))
        return
    mark = "*" if row["live"] else " "
    unit = "" if row["unit"] in ("", "1") else f" {row['unit']}"
    click.echo(f"{mark} {row['parameter']:26} {row['value']}{unit}")
