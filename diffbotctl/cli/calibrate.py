"""`diffbotctl calibrate`: find out what the robot's dimensions really are."""

from __future__ import annotations

from datetime import UTC, datetime
from pathlib import Path
from typing import TYPE_CHECKING

import click

from diffbotctl.calibrate.runner import STEPS
from diffbotctl.cli import calibrate_steps
from diffbotctl.cli.calibrate_results import keep, require_consent, show_results, undo
from diffbotctl.cli.calibrate_steps import CalibrateOptions
from diffbotctl.cli.command import ANY_PATH, argument, group, option
from diffbotctl.cli.contradictions import refuse_before_subcommand
from diffbotctl.cli.options import ROBOT, YES
from diffbotctl.errors import Problem, RunError

if TYPE_CHECKING:
    from diffbotctl.calibrate.dead_reckoning import Geometry, RecordedDrive
    from diffbotctl.calibrate.geometry_fit import GeometryFit
    from diffbotctl.calibrate.log_reader import CountLog

ENDS_SHOWN_MAX = 3


@group("Calibrate", 1, "Measure wheels, track, motors and sensors", invoke_without_command=True)
def calibrate(
    options: CalibrateOptions,
    skip: tuple[str, ...] = option("Leave a step out.", type=click.Choice(list(STEPS))),
) -> None:
    """Find out what the robot's dimensions really are: all steps in order, or one of them.

    encoders, motors (wheels off the ground), distance, geometry, imu (on the floor), range and
    battery. Each announces what it will do and waits; any key stops it.
    """
    context = click.get_current_context()
    if context.invoked_subcommand is not None:
        refuse_before_subcommand(context)
    else:
        names = [name for name in STEPS if name not in skip]
        calibrate_steps.run(names, options)


for step in (*calibrate_steps.COMMANDS, show_results, undo):
    calibrate.add_command(step)


@calibrate.command("from-log")
def from_log(
    files: tuple[Path, ...] = argument("FILE...", required=True),
    robot: str | None = ROBOT,
    ends: Path | None = option("CSV file with the end pose of each drive.", type=ANY_PATH),
    truth: tuple[Path, ...] = option("CSV file of true poses; one a FILE.", type=ANY_PATH),
    save: bool = option("Write the result into the robot file."),
    yes: bool = YES,
) -> None:
    """Fit wheel diameters and track to recorded drives whose ends, or paths, are known.

    FILE: a recording, or a CSV file with counts. Nothing moves.
    """
    from diffbotctl.calibrate.geometry_fit import diameter_sd, fit_geometry
    from diffbotctl.config.load import load_robot
    from diffbotctl.ui.calibration_screen import fit_report

    if save and not yes:
        require_consent("leave out --save")
    drives, stated = _logs(files, robot, ends, truth)
    sd = diameter_sd(load_robot(robot).robot)
    try:
        found = fit_geometry(drives, stated, sd)
    except ValueError as error:
        fix = "`diffbotctl explain E-CALIBRATE-FIT` lists the usual causes"
        place = ", ".join(map(str, files))
        raise RunError(Problem("E-CALIBRATE-FIT", place, str(error), fix)) from error
    for line in fit_report(found):
        click.echo(line)
    if save or yes:
        _save(found, files, robot, yes)


def _save(found: GeometryFit, files: tuple[Path, ...], robot: str | None, yes: bool) -> None:
    from diffbotctl.calibrate.geometry_fit import geometry_findings
    from diffbotctl.calibrate.log_reader import fingerprint, is_simulated
    from diffbotctl.calibrate.result import Provenance, format_date
    from diffbotctl.config.load import load_robot

    date, simulated = format_date(datetime.now(UTC)), any(map(is_simulated, files))
    origin = Provenance("from-log", date, None, fingerprint(files), simulated)
    keep(load_robot(robot).file, geometry_findings(found), origin, yes)


def _logs(
    files: tuple[Path, ...], robot: str | None, ends: Path | None, truth: tuple[Path, ...]
) -> tuple[list[RecordedDrive], Geometry]:
    from diffbotctl.calibrate.dead_reckoning import Geometry
    from diffbotctl.calibrate.log_reader import read_counts, refuse_unusable
    from diffbotctl.config.load import load_robot

    if truth and (ends or len(truth) != len(files)):
        raise click.UsageError("Give --truth once for each FILE, in their order, or --ends.")
    machine = load_robot(robot).robot
    drive = machine.drive
    right, left = drive.right, drive.left
    stated = Geometry(right.wheel.diameter, left.wheel.diameter, drive.track)
    ticks = (right.encoder.counts, left.encoder.counts)
    counts = [read_counts(file, ticks, machine) for file in files]
    refuse_unusable(counts)
    return _placed(counts, ends, truth, max(stated.right, stated.left)), stated


def _placed(
    counts: list[CountLog], ends: Path | None, truth: tuple[Path, ...], diameter: float
) -> list[RecordedDrive]:
    """The drives with their measured poses, of truth files, ends or their own columns."""
    from diffbotctl.calibrate.csv_table import unusable_log
    from diffbotctl.calibrate.log_reader import with_end, with_own_poses, with_truth
    from diffbotctl.calibrate.measured_ends import read_ends, refuse_part, refuse_too_far

    if truth:
        return [with_truth(*each) for each in zip(counts, truth, strict=True)]
    if ends is None:
        return [with_own_poses(each) for each in counts]
    measured = read_ends(ends)
    for each in counts:
        if each.name not in measured:
            shown = [*measured][:ENDS_SHOWN_MAX] + ["..."] * (len(measured) > ENDS_SHOWN_MAX)
            cause = f"has no line for the recording {each.name}"
            raise unusable_log(ends, cause, f"its recordings are {', '.join(shown) or 'none'}")
        refuse_part(each)
        refuse_too_far(each, measured[each.name], diameter, ends)
    return [with_end(each, measured[each.name]) for each in counts]
