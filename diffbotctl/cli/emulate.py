"""`diffbotctl emulate`: a virtual board with the robot behind it, to try everything on."""

from __future__ import annotations

import click


@click.command()
@click.argument("robot", required=False)
@click.option("--blank", is_flag=True, help="With the stock bootloader alone, to be flashed.")
@click.option("--seed", default=0, show_default=True, help="Draws the simulated robot.")
def command(robot: str | None, blank: bool, seed: int) -> None:
    """Start a virtual Mega 2560 that runs the real firmware, wired to the simulated ROBOT.

    Prints its two ports, and keeps pace with real time until Ctrl-C. Use them from another
    terminal as those of a real board: flash, run --port, blink.
    """
    from diffbotctl.config.load import load_robot
    from diffbotctl.runs.signals import Signals
    from diffbotctl.runs.virtual_board import virtual_board

    file = load_robot(robot)
    signals = Signals()
    with virtual_board(file.robot, seed, blank=blank) as board:
        what = "a blank board with its bootloader" if blank else "the board runs diffbotctl's own"
        click.echo(f"EMULATED board, SIMULATED robot {file.file} (seed {seed}); {what}")
        click.echo(f"USB port    {board.usb}")
        click.echo(f"radio port  {board.radio}")
        click.echo("Ctrl-C ends it.")
        board.serve(signals.file)
        if board.lost:
            click.echo(f"This machine was too slow for {board.lost:.1f} s of it.", err=True)
