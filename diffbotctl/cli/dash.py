"""`diffbotctl dash`: the dashboard of a running engine."""

from __future__ import annotations

import click

from diffbotctl.cli.engine_client import engine_option
from diffbotctl.cli.fullscreen import cockpit_options, launch, wishes_of


@click.command()
@click.option("--once", is_flag=True, help="Print the panels once and end; so does a pipe.")
@click.option("--plot", "fields", multiple=True, metavar="FIELD", help="What to plot. Repeatable.")
@cockpit_options
@engine_option
def command(
    once: bool,
    fields: tuple[str, ...],
    keys: str,
    mode: str,
    hz: float,
    speed: str | None,
    turn: str | None,
    ascii_only: bool,
    engine: str | None,
) -> int:
    """Show a running engine on one screen: map, wheels, range, link, plots, parameters, log.

    Click on the map and the robot goes there; drag, and it looks that way when it arrives. `?`
    shows every key.
    """
    import sys

    from diffbotctl.control_socket.client import choose_engine

    wishes = wishes_of(keys, mode, hz, speed, turn, ascii_only)
    if once or not sys.stdout.isatty():
        from diffbotctl.ui.dash.print_once import print_once

        print_once(choose_engine(engine), wishes, list(fields))
        return 0
    from diffbotctl.ui.dash.app import Dashboard

    return launch(Dashboard(choose_engine(engine), "diffbotctl dash", wishes, list(fields)))
