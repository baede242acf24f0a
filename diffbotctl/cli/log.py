"""`diffbotctl log`: what happens in a running engine, one line an event."""

from __future__ import annotations

import json
import os
import sys
import time
from collections.abc import Iterator
from typing import TYPE_CHECKING, Any

import click

from diffbotctl.cli.engine_client import attached, engine_option, quantity_of
from diffbotctl.messages import LOG_LEVELS, LogLine

if TYPE_CHECKING:
    from diffbotctl.control_socket.client import ControlClient

WATCHING = 10  # niceness: whoever looks on leaves a small machine to the control path
COLOURS = {"debug": "bright_black", "warning": "yellow", "error": "red"}


@click.group(invoke_without_command=True)
@click.option("--level", type=click.Choice(LOG_LEVELS), default="debug", help="Only from it on.")
@click.option("--block", help="Only what this block says; also robot, operator or engine.")
@click.option(
    "--last",
    metavar="N",
    type=click.IntRange(0, 500),
    default=50,
    show_default=True,
    help="Begin with so many lines that were said before.",
)
@click.option("--once", is_flag=True, help="Only what was said before; do not wait for more.")
@click.option("--for", "duration", metavar="TIME", help="Only so long, such as 10s.")
@engine_option
@click.pass_context
def command(
    ctx: click.Context,
    level: str,
    block: str | None,
    last: int,
    once: bool,
    duration: str | None,
    engine: str | None,
) -> int:
    """Follow the log of a running engine: words on a terminal, JSON lines when piped.

    A block speaks from the level info on; `log level guard debug` lets one say more.
    """
    if ctx.invoked_subcommand is not None:
        return 0
    until = None if duration is None else time.monotonic() + quantity_of(duration, "s", "--for")
    os.nice(WATCHING)
    wanted = {"level": level, **({} if block is None else {"block": block})}
    with attached(engine, "log") as caller:
        for line in _lines(caller, last, once, until, wanted):
            _print(line)
    return 0


def _lines(
    caller: ControlClient, last: int, once: bool, until: float | None, wanted: dict[str, str]
) -> Iterator[dict[str, Any]]:
    """Lines said before, then those that come."""
    if not once:
        caller.ask("watch", topic="log")
    yield from caller.ask("log", last=last, **wanted)["lines"]
    if once:
        return
    caller.streamed.clear()  # what came between the two answers stood in the second one
    levels = LOG_LEVELS[LOG_LEVELS.index(wanted["level"]) :]
    for said in caller.stream(until):
        if "lost" in said:
            click.echo(f"({said['lost']} lines were lost: this client reads too slowly)", err=True)
        line = said.get("message")
        if (
            line
            and line["level"] in levels
            and wanted.get("block", line["source"]) == line["source"]
        ):
            yield line


def _print(line: dict[str, Any]) -> None:
    if not sys.stdout.isatty():
        print(json.dumps(line), flush=True)
        return
    from diffbotctl.ui.run_text import log_line_text as words

    click.secho(words(LogLine(**line)), fg=COLOURS.get(line["level"]))


@command.command()
@click.argument("block")
@click.argument("level", type=click.Choice(LOG_LEVELS))
@engine_option
def level(block: str, level: str, engine: str | None) -> int:
    """Hear BLOCK from LEVEL on, while it runs; '*' is every block.

    The change is recorded, so that a replay has the same log.
    """
    with attached(engine, "log level") as caller:
        caller.ask("log_level", block=block, level=level)
    who = "every block" if block == "*" else block
    click.echo(f"{who} is heard from level {level} on")
    return 0
