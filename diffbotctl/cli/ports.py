"""`diffbotctl ports` and `doctor`: the serial ports, and whether this machine is ready."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from diffbotctl.cli.command import ANY_PATH, command, option
from diffbotctl.cli.contradictions import exclusive, needs
from diffbotctl.cli.options import FORCE, JSON, ROBOT
from diffbotctl.cli.output import check_output, print_json, print_row, problem_record, write_output
from diffbotctl.errors import RunError
from diffbotctl.ui.text import fold_text

if TYPE_CHECKING:
    from diffbotctl.diagnostics.doctor import DoctorFinding
    from diffbotctl.errors import Problem
    from diffbotctl.ports.access import SystemUser
    from diffbotctl.ports.diagnosis import PortReport, PortSurvey

RESET_NOTICE = "Asking each board. A board on a USB port is reset by this: lift the wheels."
BUNDLE_SUFFIXES = (".zip",)
DOCTOR_INDENT = 20  # columns of verdict and topic
BUNDLE_HEADLINE = (
    "To be packed, without names of users and computers, home folders, addresses, serial "
    "numbers and access codes:"
)
NO_FLIGHT = (
    "There is no flight recording. Name the files of the robot and the pipeline: --with FILE"
)
NOTHING_TO_FIX = "# nothing to fix"  # a comment: the output may be given to a shell

ROOT = option(
    "A folder to use instead of /, such as a copy of another machine's.",
    default="/",
    metavar=None,
    type=click.Path(exists=True, file_okay=False, path_type=Path),
)


@command("Set up", 5, "List the serial ports")
@exclusive("--ask", ("--json",), "what a board answers is printed as text")
@exclusive("--ask", ("--root",), "the boards of a copied folder cannot be asked")
@needs(("--robot",), ("--ask",), "it states how to ask the board")
def ports(
    port: str | None,
    ask: bool = option("Ask the board on each port; resets boards on USB."),
    robot: str | None = ROBOT,
    root: Path = ROOT,
    as_json: bool = JSON,
) -> int:
    """List the serial ports, or one PORT: chip, board, stable name, access rights, users.

    Exit code: 0 when a port can be used (or PORT can), 1 when not.
    """
    from diffbotctl.ports.access import current_user
    from diffbotctl.ports.diagnosis import survey_ports

    survey = survey_ports(root, current_user())
    if port is not None:
        usable = _print_one(root, survey, port, as_json)
        devices = [port] if usable else []
    else:
        usable = _print_all(survey, as_json)
        devices = [report.port.device for report in survey.reports if report.usable]
    if ask and devices:
        usable = _ask_boards(devices, robot)
    return 0 if usable else 1


def _print_all(survey: PortSurvey, as_json: bool) -> bool:
    for report in survey.reports:
        _print_report(report, as_json)
    _print_problems(survey.problems, as_json)
    return any(report.usable for report in survey.reports)


def _print_one(root: Path, survey: PortSurvey, name: str, as_json: bool) -> bool:
    from diffbotctl.ports.diagnosis import PortReport, diagnose_name

    verdict = diagnose_name(root, survey, name)
    if verdict is None:
        print_row(
            as_json,
            {"device": name, "usable": True, "kind": "pseudo-terminal"},
            f"{name}  a pseudo-terminal, such as that of an emulated board",
        )
        return True
    if isinstance(verdict, PortReport):
        _print_report(verdict, as_json)
        return verdict.usable
    _print_problems((verdict,), as_json)
    return False


def _print_report(report: PortReport, as_json: bool) -> None:
    port = report.port
    if as_json:
        print_json(_report_record(report))
        return
    click.echo(f"{port.device}  {report.title}")
    if port.usb is not None:
        chip = f"USB {port.usb.identity}  {port.usb.title}".rstrip()
        click.echo(f"  {chip}  on {port.usb.place}")
    if port.stable:
        click.echo(f"  stable name {port.stable}")
    if report.usable:
        click.echo("  free, and you may use it")
    _print_problems(report.problems, as_json)


def _report_record(report: PortReport) -> dict[str, Any]:
    usb = report.port.usb
    return {
        "device": report.port.device,
        "title": report.title,
        "usb": None if usb is None else {"identity": usb.identity, "title": usb.title},
        "stable_name": report.port.stable,
        "usable": report.usable,
        "problems": [problem_record(problem) for problem in report.problems],
    }


def _print_problems(problems: tuple[Problem, ...], as_json: bool) -> None:
    for problem in problems:
        print_row(as_json, problem_record(problem), problem.render())


def _ask_boards(devices: list[str], robot: str | None) -> bool:
    from diffbotctl.config.load import load_robot
    from diffbotctl.drivers.robot_link import diffbot_host
    from diffbotctl.flash.board_jobs import identify

    file = load_robot(robot)
    click.echo(RESET_NOTICE)
    has_answer = False
    for device in devices:
        try:
            for message in identify(device, diffbot_host(file.robot, device)):
                click.echo(f"{device}  {message.text}")
            has_answer = True
        except RunError as error:
            click.echo(str(error))
    return has_answer


@command("Set up", 6, "; check this machine")
@exclusive("--fix", ("--bundle", "--json"), "it prints commands only")
@exclusive("--bundle", ("--json",), "it prints what is packed, as text")
@needs(("--with", "--force"), ("--bundle",), "it is for the file that is packed")
def doctor(
    fix: bool = option("Print the commands that fix the problems; run none."),
    bundle: Path | None = option(
        "Pack what a person who helps needs, nothing private.", metavar="FILE.zip"
    ),
    added: tuple[Path, ...] = option(
        "--with",
        "With --bundle: pack this file too: a robot, a pipeline, a recording, a log. Repeatable.",
        type=ANY_PATH,
    ),
    force: bool = FORCE,
    root: Path = ROOT,
    as_json: bool = JSON,
) -> int:
    """Check this machine: versions, groups, ports, Bluetooth, optional packages, running IMUs.

    Each line starts with ok, -- (a note) or !! (a problem). Exit code: 1 with any !!.

    --bundle writes a zip file: these findings, versions, ports, the last flight recording with the
    files of its run. It first lists them. It removes names of users and computers, home folders,
    addresses, serial numbers and access codes.
    """
    if bundle is not None:
        check_output(bundle, BUNDLE_SUFFIXES, force)
    from diffbotctl.diagnostics.doctor import Verdict
    from diffbotctl.ports.access import current_user
    from diffbotctl.ports.diagnosis import survey_ports
    from diffbotctl.ports.fixes import fix_commands

    user = current_user()
    survey = survey_ports(root, user)
    if bundle is not None:
        _write_bundle(bundle, force, added, root, user, survey)
        return 0
    if fix:
        for line in fix_commands(root, survey, user) or [NOTHING_TO_FIX]:
            click.echo(line)
        return 0
    is_bad = False
    for finding in _findings(root, user, survey):
        is_bad |= finding.verdict == Verdict.BAD
        if as_json:
            print_json(finding._asdict())
            continue
        line = f"{finding.verdict}  {finding.topic:<14}  {finding.text}"
        click.echo(fold_text(line, hang=DOCTOR_INDENT))
        if finding.fix:
            click.echo(fold_text(f"{'':<{DOCTOR_INDENT}}-> {finding.fix}", hang=len("-> ")))
    return 1 if is_bad else 0


def _findings(root: Path, user: SystemUser, survey: PortSurvey) -> Iterator[DoctorFinding]:
    """The findings about the machine, and about the robots that run on it."""
    from diffbotctl.diagnostics.doctor import doctor_findings, engine_findings

    yield from doctor_findings(root, user, survey)
    if root == Path("/"):
        yield from engine_findings()


def _write_bundle(
    output: Path,
    force: bool,
    added: tuple[Path, ...],
    root: Path,
    user: SystemUser,
    survey: PortSurvey,
) -> None:
    from diffbotctl.diagnostics.bundle import collect, pack
    from diffbotctl.diagnostics.private_text import private_text
    from diffbotctl.recording.run_end import newest_flight

    findings: list[DoctorFinding] = list(_findings(root, user, survey))
    entries = collect(root, findings, survey, added, private_text(root, user, survey))
    click.echo(BUNDLE_HEADLINE)
    for entry in entries:
        click.echo(f"  {entry.name:<30} {len(entry.data) / 1000:8.1f} kB  {entry.words}")
    if newest_flight() is None:
        click.echo(NO_FLIGHT)
    write_output(output, {".zip": lambda: pack(entries)}, force)
    click.echo("Look into it before you pass it on.")
