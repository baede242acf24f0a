"""`diffbotctl blink`: does the board hear us? No motor moves."""

from __future__ import annotations

import click


@click.command()
@click.option("--port", default="auto", show_default=True, help="The board's port, or auto.")
@click.option("--robot", help="Robot file; the rules of `run` for none.")
@click.option("--times", default=10, show_default=True, type=click.IntRange(1, 1000))
def command(port: str, robot: str | None, times: int) -> None:
    """Check a board in a minute: make the link, and blink its light. No motor moves."""
    from diffbotctl.board.blink import blink
    from diffbotctl.cli.choose_port import choose_port
    from diffbotctl.config.load import load_robot
    from diffbotctl.runs.serial import diffbot_host

    device = choose_port(radio=True) if port == "auto" else port
    file = load_robot(robot)
    click.echo(f"robot {file.file}, port {device}")
    for said in blink(device, diffbot_host(file.robot, device), times):
        click.echo(said.text)
