"""`diffbotctl log`: the events of a running engine, one line each."""

from __future__ import annotations

import os
import sys
import time
from collections.abc import Iterator
from shutil import get_terminal_size
from typing import TYPE_CHECKING, Any

import click

from diffbotctl.cli.command import argument, group, option
from diffbotctl.cli.contradictions import exclusive, refuse_before_subcommand
from diffbotctl.cli.engine_client import WATCHER_NICENESS, attached
from diffbotctl.cli.options import ENGINE, FOR, JSON, choice_option, number_option
from diffbotctl.cli.output import print_json
from diffbotctl.messages import LOG_LEVELS, LogLine
from diffbotctl.printable import fold_line, printable, write_raw

if TYPE_CHECKING:
    from diffbotctl.control_socket.client import ControlClient

COLOURS = {"debug": "bright_black", "warning": "yellow", "error": "red"}


@group("Look", 7, "; follow the log", invoke_without_command=True)
@exclusive("--once", ("--for",), "the earlier lines need no time limit")
def log(
    level: str = choice_option(LOG_LEVELS, "Lowest level shown."),
    block: str | None = option("Only lines of this block; also robot, operator or engine."),
    last: int = number_option(50, 0, 500, "Number of earlier lines printed first.", metavar="N"),
    once: bool = option("Print the earlier lines and end."),
    duration: float | None = FOR,
    as_json: bool = JSON,
    engine: str | None = ENGINE,
) -> None:
    """Follow the log of a running engine.

    Blocks log from level info; `log level guard debug` lowers that of one block.
    """
    ctx = click.get_current_context()
    if ctx.invoked_subcommand is not None:
        refuse_before_subcommand(ctx)
        return
    until = None if duration is None else time.monotonic() + duration
    os.nice(WATCHER_NICENESS)
    selection = {"level": level, **({} if block is None else {"block": block})}
    with attached(engine, "log") as client:
        for line in _lines(client, last, once, until, selection):
            if as_json:
                print_json(line)
            else:
                _print_line(line)


def _lines(
    client: ControlClient, last: int, once: bool, until: float | None, selection: dict[str, str]
) -> Iterator[dict[str, Any]]:
    """The earlier lines, then those that arrive."""
    if not once:
        client.request("subscribe", topic="log")
    yield from client.request("read_log", last=last, **selection)["lines"]
    if once:
        return
    client.streamed.clear()  # lines between the two replies are in the second one
    levels = LOG_LEVELS[LOG_LEVELS.index(selection["level"]) :]
    for event in client.stream(until):
        if "lost" in event:
            click.echo(f"({event['lost']} lines lost: this client reads too slowly)", err=True)
        line = event.get("message")
        if (
            line
            and line["level"] in levels
            and selection.get("block", line["source"]) == line["source"]
        ):
            yield line


def _print_line(line: dict[str, Any]) -> None:
    from diffbotctl.ui.run_text import log_line_text

    text = printable(log_line_text(LogLine(**line)))
    if sys.stdout.isatty():
        text = fold_line(text, get_terminal_size().columns)
        text = click.style(text, fg=COLOURS.get(line["level"]))
    write_raw(sys.stdout, f"{text}\n")
    sys.stdout.flush()


@log.command()
def level(
    block: str, level: str = argument(type=click.Choice(LOG_LEVELS)), engine: str | None = ENGINE
) -> None:
    """Set a block's log level while it runs; '*' is every block.

    The change is recorded, so that a replay has the same log.
    """
    with attached(engine, "log level") as client:
        client.request("set_log_level", block=block, level=level)
    click.echo(f"{'every block' if block == '*' else block} logs from level {level}")
