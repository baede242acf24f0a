"""`diffbotctl show`: a robot from above and from the side."""

from __future__ import annotations

from pathlib import Path

import click


@click.command()
@click.argument("robot", required=False)
@click.option(
    "--output", type=click.Path(dir_okay=False, path_type=Path), help="Write an SVG picture."
)
def command(robot: str | None, output: Path | None) -> int:
    """Draw ROBOT from above and from its left side, to scale: here, or as a picture."""
    from diffbotctl.cli.robot_argument import loaded, written
    from diffbotctl.render.robot_views import side, top

    found = loaded(robot)
    views = [top(found.robot), side(found.robot)]
    if output is not None:
        from diffbotctl.render.robot_svg import svg

        written(output, svg(found.file.stem, views))
        return 0
    from rich.console import Console

    from diffbotctl.ui.robot_view import portrait

    console = Console(highlight=False)
    console.print(f"[bold]{found.file.stem}[/bold]")
    for view in views:
        console.print(portrait(view, console.width))
    return 0
