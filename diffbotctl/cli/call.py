"""`diffbotctl call`: an action of a running block."""

from __future__ import annotations

import click

from diffbotctl.cli.engine_client import attached, engine_option, quantity_of


@click.command()
@click.argument("action", required=False)
@click.argument("arguments", nargs=-1, metavar="[NAME=VALUE]...")
@engine_option
def command(action: str | None, arguments: tuple[str, ...], engine: str | None) -> int:
    """Call ACTION, such as odometry.set_pose x=0.5 heading=90deg; without one, list them all."""
    with attached(engine, "call") as caller:
        if action is None:
            for row in caller.ask("actions")["actions"]:
                given = " ".join(f"[{name}=...]" for name in row["arguments"])
                click.echo(f"{row['action']} {given}".rstrip())
                click.echo(f"    {row['help']}")
            return 0
        caller.ask("call", action=action, arguments=dict(_argument(each) for each in arguments))
    click.echo(f"{action}: done")
    return 0


def _argument(text: str) -> tuple[str, float]:
    name, equals, value = text.partition("=")
    if not equals:
        raise click.UsageError(f"'{text}': write NAME=VALUE, such as x=0.5")
    unit = "rad" if value.endswith(("deg", "rad", "turn")) else "m"
    return name, quantity_of(value, unit, name)
