"""`diffbotctl resume`: a person's consent to move again."""

from __future__ import annotations

import click

from diffbotctl.cli.attach import attached, engine_option, held_by, settled


@click.command()
@engine_option
def command(engine: str | None) -> int:
    """Let the robot move again after a stop that waits for a person. A waiting goal goes on."""
    with attached(engine, "resume") as caller:
        before = held_by(caller.ask("status"))
        caller.ask("resume")
        after = held_by(settled(caller, lambda status: not status["held"]))
    if after:
        click.echo(f"still held by {after}", err=True)
        return 1
    click.echo(f"released from {before}" if before else "nothing held the robot")
    return 0
