"""`diffbotctl param` and `call`: the parameters and actions of a running engine's blocks."""

from __future__ import annotations

import json
from collections.abc import Container, Iterable
from pathlib import Path
from typing import Any

import click

from diffbotctl.cli.command import (
    NEGATIVE_NUMBERS,
    NumbersCommand,
    argument,
    command,
    group,
    option,
)
from diffbotctl.cli.contradictions import needs
from diffbotctl.cli.engine_client import attached
from diffbotctl.cli.options import ENGINE, FORCE, JSON, Quantity
from diffbotctl.cli.output import check_overwrite, print_json, print_row
from diffbotctl.config.lookup import is_shipped
from diffbotctl.errors import Problem, RunError, UsageError

CENTIMETRES_MAX = 50  # a larger whole number is rather one of millimetres
NEW_PIPELINE = "format: 1\nkind: pipeline\ninclude: {}\nblocks: {{}}\n"


@group("Look", 10, "Change parameters")
def param() -> None:
    """List, read, change and save the parameters of running blocks."""


@param.command("list")
def list_(
    live: bool = option("Only parameters that may change while running."),
    as_json: bool = JSON,
    engine: str | None = ENGINE,
) -> None:
    """List every parameter with its value and unit; * marks those that may change while running."""
    for row in _parameters(engine):
        if row["live"] or not live:
            _print_parameter(row, as_json)
    if not as_json and not live:
        click.echo("* may change while running: diffbotctl param set PARAMETER VALUE")


@param.command("get")
def get(parameter: str, as_json: bool = JSON, engine: str | None = ENGINE) -> None:
    """Print the value of PARAMETER, such as guard.margin."""
    rows = {row["parameter"]: row for row in _parameters(engine)}
    if parameter not in rows:
        from diffbotctl.errors import closest_match

        near = closest_match(parameter, rows)
        own = [name for name in rows if name.startswith(f"{parameter}.")]
        hint = f" Did you mean {near}?" if near else ""
        hint = f" The block has {', '.join(own)}." if own else hint
        raise click.UsageError(f"there is no parameter '{parameter}'.{hint}")
    _print_parameter(rows[parameter], as_json)


@param.command("set", cls=NumbersCommand, context_settings=NEGATIVE_NUMBERS)
def set_(parameter: str, value: str, engine: str | None = ENGINE) -> None:
    """Change PARAMETER to VALUE, such as guard.margin 8cm, while the robot runs.

    Only parameters declared as live may change; none of them weakens the safety. The change is
    recorded. It is lost after the run unless you use `param save`.
    """
    with attached(engine, "param set") as client:
        rows = client.request("list_parameters")["parameters"]
        if "m" in [row["unit"] for row in rows if row["parameter"] == parameter]:
            _refuse_bare_metres(parameter, value)
        client.request("set_parameter", parameter=parameter, value=value)
    click.echo(f"{parameter} = {value}")


def _refuse_bare_metres(parameter: str, value: str) -> None:
    """Raises RunError for a whole number of metres without its unit: most people mean less."""
    if value.isdecimal() and int(value):
        smaller = "cm" if int(value) < CENTIMETRES_MAX else "mm"
        cause = f"{value} without a unit is {value} m"
        fix = f"did you mean {value} {smaller}? For metres write {value}m"
        raise RunError(Problem("E-REQUEST", parameter, cause, fix))


def _parameters(engine: str | None) -> list[dict[str, Any]]:
    with attached(engine, "param") as client:
        rows: list[dict[str, Any]] = client.request("list_parameters")["parameters"]
    return rows


def _print_parameter(row: dict[str, Any], as_json: bool) -> None:
    if as_json:
        print_json(row)
        return
    mark = "*" if row["live"] else " "
    click.echo(f"{mark} {row['parameter']:26} {_value_text(row)}")


def _value_text(row: dict[str, Any]) -> str:
    """The value for a person: `2 deg`."""
    value = row["value"]
    if isinstance(value, float):
        from diffbotctl.params import with_unit

        return with_unit(value, row["unit"])
    return value if isinstance(value, str) else _yaml_value(row)


@param.command()
@needs(("--force",), ("--output",), "it overwrites a file")
def save(
    parameters: tuple[str, ...],
    output: Path | None = option(
        "--output",
        "--to",
        "Write a new pipeline file that includes the present one.",
    ),
    force: bool = FORCE,
    engine: str | None = ENGINE,
) -> None:
    """Write the parameters changed in this run into the pipeline file; its comments are kept.

    Without PARAMETERS, all that were changed. Files that ship with diffbotctl are not written: use
    --output for those.
    """
    if output is not None:
        check_overwrite(output, force)
    with attached(engine, "param save") as client:
        rows = client.request("list_parameters")["parameters"]
        pipeline = client.request("status")["pipeline"]
    if parameters:
        saved = [row for row in rows if row["parameter"] in parameters]
    else:
        saved = [row for row in rows if row["changed"]]
    missing = set(parameters) - {row["parameter"] for row in saved}
    if missing:
        raise click.UsageError(f"there is no parameter {', '.join(sorted(missing))}")
    if not saved:
        click.echo("no parameter was changed in this run")
        return
    path = _write_parameters(Path(pipeline), output, saved)
    for row in saved:
        click.echo(f"{path}: {row['parameter']}: {_yaml_value(row)}")


def _write_parameters(pipeline: Path, new: Path | None, rows: list[dict[str, Any]]) -> Path:
    """Write `rows` into the pipeline, or into a new file that includes it; returns the file."""
    from diffbotctl.calibrate.yaml_edit import with_entry

    if new is None and is_shipped(pipeline):
        cause = "this file ships with diffbotctl and is not written"
        raise UsageError(Problem("E-SAVE", str(pipeline), cause, "add --output mine.yaml"))
    path = new or pipeline
    if path.exists() and not path.is_file():
        cause, fix = "this is a device or a folder, not a file", "choose another name"
        raise UsageError(Problem("E-SAVE", str(path), cause, fix))
    try:
        text = (
            NEW_PIPELINE.format(json.dumps(str(pipeline)))
            if new
            else path.read_text(encoding="utf-8")
        )
        for row in rows:
            block, _, key = row["parameter"].rpartition(".")
            if "." in block:
                raise ValueError(f"{block} is in a pipeline that is included")
            text = with_entry(text, ["blocks", block, "with", key], _yaml_value(row))
        temporary = path.with_name(f".{path.name}.new")
        temporary.write_text(text, encoding="utf-8")
        temporary.replace(path)
    except (OSError, ValueError) as error:
        cause = f"cannot save there: {error}"
        raise UsageError(Problem("E-SAVE", str(path), cause, "edit the file by hand")) from error
    return path


def _yaml_value(row: dict[str, Any]) -> str:
    """The value as the file has it: `0.08 m`."""
    value = row["value"]
    if value is None:
        return "none"
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, str):
        return value if value.replace("_", "").isalpha() else json.dumps(value)
    return repr(value) if row["unit"] in ("", "1") else f"{value!r} {row['unit']}"


@command("Look", 11, "; call an action of a block")
def call(
    action: str | None,
    arguments: tuple[str, ...] = argument("[NAME=VALUE]..."),
    as_json: bool = JSON,
    engine: str | None = ENGINE,
) -> None:
    """Call ACTION, such as odometry.set_pose x=0.5 heading=90deg; without ACTION, list all.

    What the action returns is printed. `call reset` puts everything back to the start: the
    simulated robot, the odometry, and the turtles.
    """
    with attached(engine, "call") as client:
        rows = {row["action"]: row for row in client.request("list_actions")["actions"]}
        if action is None:
            _print_actions(rows.values(), as_json)
            return
        for name in _meant(action, rows):
            values: dict[str, float | str] = {}
            for text in arguments:
                key, given = _argument(text, rows.get(name, {}))
                if key in values:
                    raise click.UsageError(f"'{text}': {key} is given twice")
                values[key] = given
            value = client.request("call_action", action=name, arguments=values).get("value")
            print_row(
                as_json,
                {"action": name, "value": value},
                f"{name}: {'done' if value is None else _returned_text(value)}",
            )


def _meant(action: str, known: Container[str]) -> list[str]:
    """The actions that `action` means: several for `reset`, as a service of ROS is called."""
    from diffbotctl.control_socket.protocol import RESET_ACTIONS

    parts = [name for name in RESET_ACTIONS if name in known]
    return parts if action.strip("/") == "reset" and parts else [action]


def _returned_text(value: Any) -> str:
    """What an action returned: a text and a number as they are."""
    return value if isinstance(value, str) else json.dumps(value, ensure_ascii=False)


def _print_actions(rows: Iterable[dict[str, Any]], as_json: bool) -> None:
    for row in rows:
        if as_json:
            print_json(row)
            continue
        texts = row.get("texts", ())
        arguments = (
            f"[{name}={'TEXT' if name in texts else row['units'].get(name) or '...'}]"
            for name in row["arguments"]
        )
        click.echo(f"{row['action']} {' '.join(arguments)}".rstrip())
        for paragraph in row["help"].split("\n\n"):
            click.echo(f"    {' '.join(paragraph.split())}")


def _argument(text: str, action: dict[str, Any]) -> tuple[str, float | str]:
    """NAME and value: a text, or a number in SI whose unit is of the argument's declared kind."""
    name, equals, value = text.partition("=")
    if not equals:
        raise click.UsageError(f"'{text}': write NAME=VALUE, such as x=0.5")
    if name in action.get("texts", ()):
        return name, value
    # An argument without a declared unit takes a length, an angle or a plain number.
    unit = action.get("units", {}).get(name) or (
        "rad" if value.endswith(("deg", "rad", "turn")) else "m"
    )
    try:
        return name, Quantity(unit).convert(value, None, None)
    except click.BadParameter as error:
        raise click.UsageError(f"{name}: {error.message}") from error
