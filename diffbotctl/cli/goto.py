"""`diffbotctl goto`: send the robot to a place."""

from __future__ import annotations

from math import degrees

import click

from diffbotctl.cli.engine_client import attached, engine_option, held_by, quantity_of


@click.command(context_settings={"ignore_unknown_options": True})  # -0.5 is a number here
@click.argument("x")
@click.argument("y")
@click.argument("heading", required=False)
@engine_option
def command(x: str, y: str, heading: str | None, engine: str | None) -> int:
    """Drive to X Y, and turn to HEADING: metres and radians, or with a unit, such as 50cm 0 90deg.

    It replaces the goals that the run had. The run no longer ends when a goal is reached.
    """
    place = quantity_of(x, "m", "X"), quantity_of(y, "m", "Y")
    turn = None if heading is None else quantity_of(heading, "rad", "HEADING")
    with attached(engine, "goto") as caller:
        caller.ask("goto", x=place[0], y=place[1], heading=turn)
        held = held_by(caller.ask("status"))
    facing = "" if turn is None else f", heading {degrees(turn):.0f} deg"
    click.echo(f"goal: x {place[0]:g} m, y {place[1]:g} m{facing}")
    if held:
        click.echo(f"the robot is held by {held}; `diffbotctl resume` lets it go", err=True)
    return 0
