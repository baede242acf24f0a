"""`diffbotctl start`: one guided path from nothing to the first goal."""

from __future__ import annotations

from pathlib import Path

import click

from diffbotctl.cli.command import command, option
from diffbotctl.cli.contradictions import exclusive
from diffbotctl.cli.options import ANSWERS, port_option


@command("Set up", 1, "Guided setup")
@exclusive("--status", ("--again", "--answers"), "it prints the state and changes nothing")
def start(
    robot: str | None = option(
        "Your robot file; default: the only one in ./robots.", metavar="ROBOT"
    ),
    port: str = port_option("auto", only_board=True),
    radio: str | None = option("Port to drive over; default: the USB cable.", metavar="PORT"),
    answers: Path | None = ANSWERS,
    status: bool = option("Print the state and the next step only."),
    again: bool = option("Start from the beginning."),
) -> int:
    """Guided setup: from nothing to a robot that drives to a goal, step by step.

    First on a simulated robot; then, with a board connected, on yours. Ctrl-C leaves at any time;
    the next `diffbotctl start` in this folder continues from there.
    """
    from diffbotctl.cli.start_guide import SetupGuide
    from diffbotctl.cli.start_steps import GuideProgress, read_answers, state_path

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
