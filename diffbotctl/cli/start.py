"""`diffbotctl start`: one guided path from nothing to the first goal."""

from __future__ import annotations

from pathlib import Path

import click

from diffbotctl.cli.contradictions import exclusive
from diffbotctl.cli.options import answers_option, port_option


@click.command()
@exclusive("--status", ("--again", "--answers"), "it prints the state and changes nothing")
@click.option(
    "--robot",
    metavar="ROBOT",
    help="Your robot file; default: the only one in ./robots.",
)
@port_option("auto", only_board=True)
@click.option("--radio", metavar="PORT", help="Port to drive over; default: the USB cable.")
@answers_option
@click.option("--status", is_flag=True, help="Print the state and the next step only.")
@click.option("--again", is_flag=True, help="Start from the beginning.")
def command(
    robot: str | None,
    port: str,
    radio: str | None,
    answers: Path | None,
    status: bool,
    again: bool,
) -> int:
    """Guided setup: from nothing to a robot that drives to a goal, step by step.

    First on a simulated robot; then, with a board connected, on yours. Ctrl-C leaves at any time;
    the next `diffbotctl start` in this folder continues from there.
    """
    from diffbotctl.cli.start_guide import SetupGuide
    from diffbotctl.cli.start_progress import GuideProgress, state_path
    from diffbotctl.cli.start_steps import read_answers

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
