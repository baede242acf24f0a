"""`diffbotctl start`: one guided path from nothing to the first goal."""

from __future__ import annotations

from pathlib import Path

import click


@click.command()
@click.option("--robot", help="Your robot's file; without it the one in ./robots, or a new one.")
@click.option("--port", default="auto", show_default=True, help="The board's USB port, or auto.")
@click.option("--radio", metavar="PORT", help="Drive over this port; without it over the cable.")
@click.option(
    "--answers",
    type=click.Path(dir_okay=False, path_type=Path),
    help="A YAML file that answers the questions.",
)
@click.option("--status", is_flag=True, help="Only say what is true now and what comes next.")
@click.option("--again", is_flag=True, help="From the beginning, whatever is done already.")
def command(
    robot: str | None,
    port: str,
    radio: str | None,
    answers: Path | None,
    status: bool,
    again: bool,
) -> int:
    """Go from nothing to a robot that drives to a goal, one step after another.

    First a simulated robot; then, with a board plugged in, yours. Leave at any time with Ctrl-C:
    the next `diffbotctl start` in this folder goes on where you left.
    """
    from diffbotctl.cli.start_guide import SetupGuide
    from diffbotctl.start.progress import GuideProgress, state_path
    from diffbotctl.start.steps import read_answers

    progress = GuideProgress(state_path(), str(Path.cwd()))
    if again:
        progress.reset()
    answers_file = None if answers is None else read_answers(answers)
    guide = SetupGuide(progress, robot, None if port == "auto" else port, radio, answers_file)
    if status:
        guide.show_status()
        return 0
    try:
        return guide.run()
    except (click.Abort, KeyboardInterrupt):
        click.echo("\nLeft here. `diffbotctl start` goes on from this point.")
        raise click.Abort from None
