"""`diffbotctl foxglove`: a running engine in Foxglove or Lichtblick."""

from __future__ import annotations

import os
from functools import partial
from typing import TYPE_CHECKING

import click

from diffbotctl.cli.command import command, option, require_packages
from diffbotctl.cli.engine_client import host
from diffbotctl.cli.options import ENGINE, tcp_port_option

if TYPE_CHECKING:
    from diffbotctl.foxglove.commands import Command
    from diffbotctl.foxglove.server import FoxgloveServer

TCP_PORT = 8765  # that viewers propose


@command("Drive", 7, "; to Foxglove")
def foxglove(
    allow: str = option(
        "What viewers may publish: goal, velocity, or both with a comma between.",
        metavar="LIST",
        default="",
    ),
    origins: tuple[str, ...] = option(
        "--origin",
        "Also accept a viewer that is a web page of this origin, such as http://localhost:8080.",
        metavar="URL",
    ),
    tcp_port: int = tcp_port_option(TCP_PORT, "TCP port for viewers."),
    engine: str | None = ENGINE,
) -> None:
    """Serve a running engine to Foxglove and Lichtblick on this machine.

    Prints the address to open in the viewer; it carries a secret. Without --allow viewers watch,
    and may stop the robot. With it they may also resume, and set parameters. Leaving this program
    stops a robot that a viewer drives.
    """
    import asyncio

    from diffbotctl.control_socket.client import choose_engine
    from diffbotctl.processes.screen import DRIVING_NICENESS

    os.nice(DRIVING_NICENESS)
    require_packages("E-FOXGLOVE-LIBRARY", "viewers", "foxglove", "aiohttp")
    allowed = _allowed(allow)

    from diffbotctl.client.connections import listen
    from diffbotctl.foxglove.server import KNOWN_ORIGINS, FoxgloveServer, ViewerRules

    address = choose_engine(engine, host())
    listener = listen("127.0.0.1", tcp_port, "E-FOXGLOVE-LISTEN", "viewers")
    rules = ViewerRules(allowed, KNOWN_ORIGINS | {origin.rstrip("/") for origin in origins})
    server = FoxgloveServer(address, listener, rules, _report)
    asyncio.run(server.run(partial(_print_start, server)))
    click.echo("the run has ended")


def _report(text: str) -> None:
    click.echo(text)


def _allowed(text: str) -> frozenset[Command]:
    from diffbotctl.foxglove.commands import Command

    words = [word.strip() for word in text.split(",") if word.strip()]
    known = [command.value for command in Command]
    for word in words:
        if word not in known:
            raise click.UsageError(f"--allow: '{word}' is none of {', '.join(known)}")
    return frozenset(Command(word) for word in words)


def _print_start(server: FoxgloveServer) -> None:
    click.echo("Open a connection of the kind Foxglove WebSocket in the viewer, with this address:")
    click.echo(f"  {server.address}")
    if server.allowed:
        click.echo(f"Viewers may publish: {', '.join(sorted(server.allowed))}; resume; parameters.")
    else:
        click.echo("Viewers watch, and may stop the robot; --allow goal,velocity lets them drive.")
