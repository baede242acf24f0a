"""`diffbotctl param`: the parameters of a running engine's blocks.

`diffbotctl call`: an action of a running block.
"""

from __future__ import annotations

import json
import sys
from pathlib import Path
from typing import Any

import click

from diffbotctl.cli.engine_client import attached, engine_option, quantity_of


@click.group()
def param() -> None:
    """List, read, change and save the parameters of running blocks."""


@param.command("list")
@click.option("--live", is_flag=True, help="Only those that may change while running.")
@engine_option
def list_(live: bool, engine: str | None) -> int:
    """Every parameter with its value and unit; * marks what may change while running."""
    for row in _parameters(engine):
        if row["live"] or not live:
            _show(row)
    if sys.stdout.isatty() and not live:
        click.echo("* may change while running: diffbotctl param set PARAMETER VALUE")
    return 0


@param.command("get")
@click.argument("parameter")
@engine_option
def get(parameter: str, engine: str | None) -> int:
    """The value of PARAMETER, such as guard.margin."""
    rows = {row["parameter"]: row for row in _parameters(engine)}
    if parameter not in rows:
        from diffbotctl.errors import closest_match

        near = closest_match(parameter, rows)
        hint = f" Did you mean {near}?" if near else ""
        raise click.UsageError(f"there is no parameter '{parameter}'.{hint}")
    _show(rows[parameter])
    return 0


@param.command("set")
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
    click.echo(f"{mark} {row['parameter']:26} {_shown(row)}")


def _shown(row: dict[str, Any]) -> str:
    """The value as a person reads it: `0.0349 rad`."""
    value = row["value"]
    if isinstance(value, float):
        from diffbotctl.params import with_unit

        return with_unit(value, row["unit"])
    return value if isinstance(value, str) else _written(row)


@param.command()
@click.argument("parameters", nargs=-1)
@click.option("--to", "file", metavar="FILE", help="A new pipeline file that includes the old one.")
@engine_option
def save(parameters: tuple[str, ...], file: str | None, engine: str | None) -> int:
    """Write what was changed in this run into the pipeline file; comments stay.

    Without PARAMETERS everything that was changed. Files that ship with diffbotctl are not
    touched: give --to for those.
    """
    with attached(engine, "param save") as caller:
        rows = caller.ask("parameters")["parameters"]
        pipeline = caller.ask("status")["pipeline"]
    wanted = [row for row in rows if row["changed"] and not parameters] + [
        row for row in rows if row["parameter"] in parameters
    ]
    missing = set(parameters) - {row["parameter"] for row in wanted}
    if missing:
        raise click.UsageError(f"there is no parameter {', '.join(sorted(missing))}")
    if not wanted:
        click.echo("nothing was changed in this run")
        return 0
    path = _saved(Path(pipeline), None if file is None else Path(file), wanted)
    for row in wanted:
        click.echo(f"{path}: {row['parameter']}: {_written(row)}")
    return 0


def _saved(pipeline: Path, new: Path | None, rows: list[dict[str, Any]]) -> Path:
    """Write `rows` into the pipeline, or into a new file that includes it; the file written."""
    from diffbotctl.config.lookup import is_shipped
    from diffbotctl.config.yaml_edit import with_entry
    from diffbotctl.errors import Problem, UsageError

    if new is None and is_shipped(pipeline):
        cause = "this file ships with diffbotctl and stays as it is"
        raise UsageError(Problem("E-SAVE", str(pipeline), cause, "add --to mine.yaml"))
    path = new or pipeline
    if new is not None and new.exists():
        raise UsageError(Problem("E-SAVE", str(new), "it exists already", "give another --to"))
    try:
        text = NEW.format(json.dumps(str(pipeline))) if new is not None else path.read_text()
        for row in rows:
            block, _, key = row["parameter"].partition(".")
            text = with_entry(text, ["blocks", block, "with", key], _written(row))
        beside = path.with_name(f".{path.name}.new")
        beside.write_text(text)
        beside.replace(path)
    except (OSError, ValueError) as error:
        cause = f"cannot save there: {error}"
        raise UsageError(Problem("E-SAVE", str(path), cause, "change it by hand")) from error
    return path


NEW = "format: 1\nkind: pipeline\ninclude: {}\nblocks: {{}}\n"


def _written(row: dict[str, Any]) -> str:
    """The value as the file has it: `0.08 m`."""
    value = row["value"]
    if value is None:
        return "none"
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, str):
        return value if value.replace("_", "").isalpha() else json.dumps(value)
    return repr(value) if row["unit"] in ("", "1") else f"{value!r} {row['unit']}"


@click.command()
@click.argument("action", required=False)
@click.argument("arguments", nargs=-1, metavar="[NAME=VALUE]...")
@engine_option
def call(action: str | None, arguments: tuple[str, ...], engine: str | None) -> int:
    """Call ACTION, such as odometry.set_pose x=0.5 heading=90deg; without one, list them all."""
    with attached(engine, "call") as caller:
        if action is None:
            for row in caller.ask("actions")["actions"]:
                given = " ".join(f"[{name}=...]" for name in row["arguments"])
                click.echo(f"{row['action']} {given}".rstrip())
                click.echo(f"    {row['help']}")
            return 0
        caller.ask("call", action=action, arguments=dict(_argument(each) for each in arguments))
    click.echo(f"{action}: done")
    return 0


def _argument(text: str) -> tuple[str, float]:
    name, equals, value = text.partition("=")
    if not equals:
        raise click.UsageError(f"'{text}': write NAME=VALUE, such as x=0.5")
    unit = "rad" if value.endswith(("deg", "rad", "turn")) else "m"
    return name, quantity_of(value, unit, name)
