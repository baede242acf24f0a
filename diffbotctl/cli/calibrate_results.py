"""What becomes of results: shown, agreed to, written; listed; undone."""

from __future__ import annotations

import sys
from datetime import UTC, datetime
from itertools import groupby
from typing import TYPE_CHECKING

import click

from diffbotctl.cli.command import subcommand
from diffbotctl.cli.options import ROBOT
from diffbotctl.config.lookup import display_path, simulated_copy_of
from diffbotctl.errors import ELLIPSIS, WIDTH
from diffbotctl.ui.text import render_columns

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence
    from pathlib import Path

    from diffbotctl.calibrate.result import CalibrationEntry, Finding, Provenance
    from diffbotctl.calibrate.robot_file import FileChange

COPIED = "{name} ships with diffbotctl and stays as it is:\ncopied to {mine}"
FOR_SIMULATED = "{name} stays as it is: results of a simulated robot go into\n{mine}"
UNWRITTEN = "Nothing was written. The entries are those with a + in front."


def keep(path: Path, findings: Sequence[Finding], origin: Provenance, yes: bool) -> bool:
    """Show what would change in the robot file at `path`, ask, and write it. False: declined.

    Raises UserError where it cannot be written or is not plausible.
    """
    from diffbotctl.calibrate.robot_file import plan_change

    return put(plan_change(own(path, origin.simulated), findings, origin), yes)


def own(path: Path, is_simulated: bool = False) -> Path:
    """The file to write for the robot at `path`; a shipped one is copied, with a message.

    Results of a simulated robot go into a file beside it.
    """
    from diffbotctl.calibrate.robot_file import simulated_copy, writable_copy

    mine, is_new = simulated_copy(path) if is_simulated else writable_copy(path)
    if is_new:
        text = FOR_SIMULATED if is_simulated else COPIED
        click.echo(text.format(name=path.name, mine=display_path(mine)))
    return mine


def put(made: FileChange, yes: bool) -> bool:
    """Show the change, ask, and write it. False: declined. Raises RunError."""
    from diffbotctl.calibrate.robot_file import write_change

    difference = made.difference()
    click.echo(_short(difference))
    if not yes and not _agreed():
        if _short(difference) != difference:
            click.echo(difference)
        click.echo(UNWRITTEN)
        return False
    kept = write_change(made)
    click.echo(f"{display_path(made.path)} is written; as it was: {display_path(kept)}.")
    click.echo(f"`diffbotctl calibrate undo --robot {display_path(made.path)}` goes back.")
    return True


def _short(difference: str) -> str:
    """The lines cut at the terminal's edge, so that what changes is seen at a glance.

    A pipe gets them whole.
    """
    if not sys.stdout.isatty():
        return difference
    lines = difference.split("\n")
    return "\n".join(
        line if len(line) <= WIDTH else line[: WIDTH - len(ELLIPSIS)] + ELLIPSIS for line in lines
    )


def require_consent(otherwise: str) -> None:
    """Raises click.UsageError without a terminal to ask on, before anything moves.

    `otherwise`: what the command offers beside --yes.
    """
    # Standard input is None if it was closed.
    if sys.stdin is None or not sys.stdin.isatty():
        raise click.UsageError(f"There is no terminal to ask on: add --yes, or {otherwise}.")


def _agreed() -> bool:
    require_consent("start it in a terminal")
    return click.confirm("Write this?", default=True)


@subcommand("show")
def show_results(robot: str | None = ROBOT) -> None:
    """List what was calibrated, how sure it is and how old, and what was not."""
    from diffbotctl.calibrate.result import calibration_entries, missing_entries
    from diffbotctl.config.load import load_robot

    file = load_robot(robot)
    rows = calibration_entries(file, datetime.now(UTC))
    click.echo(display_path(file.file))
    for line in _grouped(rows):
        click.echo(line)
    unknown = missing_entries(file)
    if unknown:
        click.echo("never calibrated, and found by:")
    for line in render_columns(
        [(f"  {path}", f"diffbotctl calibrate {by}") for path, by in unknown.items()]
    ):
        click.echo(line)
    simulated = simulated_copy_of(file.file)
    if simulated != file.file and simulated.exists():
        click.echo(f"simulated robot: diffbotctl calibrate show --robot {display_path(simulated)}")


def _grouped(rows: Sequence[CalibrationEntry]) -> Iterator[str]:
    """The entries that one calibration found under what they have in common."""
    table = render_columns([("", "value", "sd"), *((f"  {row.field}", *row[1:3]) for row in rows)])
    heads = next(table)
    for (age, method, volts, recording), entries in groupby(rows, key=lambda row: row[3:]):
        yield f"{method}, {age}; battery {volts}; recording {recording}"
        yield heads
        yield from (next(table) for _ in entries)
        yield ""


@subcommand()
def undo(robot: str | None = ROBOT) -> None:
    """Bring the robot file back as it was before the last calibration. Repeat to go further."""
    from diffbotctl.calibrate.robot_file import undo as undone
    from diffbotctl.config.load import load_robot

    made = undone(load_robot(robot).file)
    click.echo(_short(made.difference("as before")))
    click.echo(f"{display_path(made.path)} is as it was before.")
