"""`diffbotctl teleop`: drive a running engine's robot with the keys."""

from __future__ import annotations

import click

from diffbotctl.cli.engine_client import engine_option
from diffbotctl.cli.fullscreen import cockpit_options, launch, wishes_of


@click.command()
@cockpit_options
@engine_option
def command(
    keys: str,
    mode: str,
    hz: float,
    speed: str | None,
    turn: str | None,
    ascii_only: bool,
    engine: str | None,
) -> int:
    """Drive by hand: arrows, or u i o j k l m , . as in ROS, or w a s d x (`--keys turtle`).

    A key drives while it is held, and 0.4 s longer. With `--mode latched` it drives until the next
    key, as ROS did, as long as this terminal answers. Whatever ends this ends the driving.
    """
    import sys

    from diffbotctl.control_socket.client import choose_engine

    found = choose_engine(engine)
    if not sys.stdin.isatty() or not sys.stdout.isatty():
        raise click.UsageError(
            "teleop needs a terminal for its keys; from a program speak to the socket, or use "
            "`diffbotctl drive --v 0.1 --for 1s`"
        )
    from diffbotctl.ui.teleop.app import Teleop

    return launch(
        Teleop(found, "diffbotctl teleop", wishes_of(keys, mode, hz, speed, turn, ascii_only))
    )
