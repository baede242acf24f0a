"""`diffbotctl why`: the cause chain of the last stop."""

from __future__ import annotations

import click

from diffbotctl.cli.engine_client import attached, engine_option


@click.command()
@engine_option
def command(engine: str | None) -> int:
    """Tell why the robot last stopped, from the sensor to the motors, and what ends it."""
    with attached(engine, "why") as caller:
        text = caller.ask("why")["text"]
    click.echo(click.wrap_text(text, 78))
    return 0
