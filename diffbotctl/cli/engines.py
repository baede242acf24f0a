"""`diffbotctl engines`: the engines that are running, here and on other computers."""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any, NamedTuple

import click

from diffbotctl.cli.command import command, option
from diffbotctl.cli.engine_client import held_by
from diffbotctl.cli.options import JSON
from diffbotctl.cli.output import print_json
from diffbotctl.errors import UserError
from diffbotctl.ui.text import render_columns

HERE = ""
HEADER = ("computer", "engine", "pipeline", "robot", "port", "state")


class EngineRow(NamedTuple):
    """An engine on the computer `at`, empty for this one; `robot` is empty without a robot."""

    at: str
    engine: str
    pipeline: str
    robot: str
    port: str
    state: str


@command("Look", 3, "List the running engines")
def engines(
    hosts: tuple[str, ...] = option(
        "--at", "Also ask this computer, through ssh. Repeatable.", metavar="USER@HOST"
    ),
    as_json: bool = JSON,
) -> int:
    """List the engines that you may command, here and on other computers, and their states.

    Exit code: 1 when a computer or an engine did not answer.
    """
    with ThreadPoolExecutor(1 + len(hosts)) as pool:
        answers = list(pool.map(_ask, (HERE, *dict.fromkeys(hosts))))
    rows = [row for found, _ in answers for row in found]
    if as_json:
        for row in rows:
            print_json(row._asdict())
    else:
        _print_table(rows)
    complaints = [complaint for _, found in answers for complaint in found]
    for complaint in complaints:
        click.echo(complaint, err=True)
    return int(bool(complaints))


def _print_table(rows: list[EngineRow]) -> None:
    if not rows:
        click.echo("no engine is running; start one: diffbotctl run goal", err=True)
        return
    for line in render_columns([HEADER, *((row.at or "here", *row[1:]) for row in rows)]):
        click.echo(line)


def _ask(at: str) -> tuple[list[EngineRow], list[str]]:
    """The engines on the computer `at`, and what did not answer."""
    from diffbotctl.control_socket.address import engines
    from diffbotctl.control_socket.far_engine import SeveralEnginesError

    names: list[str | None] = [None] if at else [engine.name for engine in engines()]
    rows: list[EngineRow] = []
    complaints: list[str] = []
    for name in names:
        try:
            rows.append(_row(at, name))
        except SeveralEnginesError as several:
            names += several.engines
        except UserError as error:
            if error.problems[0].code != "E-NO-ENGINE":
                complaints.append(str(error))
    return rows, complaints


def _row(at: str, name: str | None) -> EngineRow:
    from diffbotctl.control_socket.client import ControlClient, choose_engine

    client = ControlClient(choose_engine(name, at), "diffbotctl engines")
    try:
        status = client.request("status")
    finally:
        client.close()
    return EngineRow(
        at,
        str(status["engine"]),
        Path(status["pipeline"]).stem,
        Path(status["robot"] or "").stem,
        str(status["port"]),
        engine_state(status),
    )


def engine_state(status: dict[str, Any]) -> str:
    """What the robot does, from the reply to `status`."""
    wheels = status["gate.wheels"]
    if held_by(status):
        return f"stopped by {held_by(status)}"
    if wheels is not None and (wheels["left"] or wheels["right"]):
        return "moving"
    return "standing"
