"""`diffbotctl ports` and `doctor`: the serial ports, and whether this machine is ready."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from diffbotctl.cli.options import json_option, robot_option
from diffbotctl.cli.output import print_json, problem_record

if TYPE_CHECKING:
    from diffbotctl.errors import Problem
    from diffbotctl.ports.diagnosis import PortReport, PortSurvey

RESET_NOTICE = "Asking each board. A board on a USB port is reset by this: lift the wheels."
DOCTOR_INDENT = 20  # columns of verdict and topic
NOTHING_TO_FIX = "# nothing to fix"  # a comment: the output may be given to a shell

root_option = click.option(
    "--root",
    default="/",
    type=click.Path(exists=True, file_okay=False, path_type=Path),
    help="A folder to use instead of /, such as a copy of another machine's.",
)


@click.command()
@click.argument("port", required=False)
@click.option("--ask", is_flag=True, help="Ask the board on each port; resets boards on USB.")
@robot_option
@root_option
@json_option
def ports(port: str | None, ask: bool, robot: str | None, root: Path, as_json: bool) -> int:
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
        if as_json:
            print_json({"device": name, "usable": True, "kind": "pseudo-terminal"})
        else:
            click.echo(f"{name}  a pseudo-terminal, such as that of an emulated board")
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
        if as_json:
            print_json(problem_record(problem))
        else:
            click.echo(problem.render())


def _ask_boards(devices: list[str], robot: str | None) -> bool:
    from diffbotctl.board.jobs import identify
    from diffbotctl.config.load import load_robot
    from diffbotctl.drivers.robot_link import diffbot_host
    from diffbotctl.errors import RunError

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


@click.command()
@click.option("--fix", is_flag=True, help="Print the commands that fix the problems; run none.")
@root_option
@json_option
def doctor(fix: bool, root: Path, as_json: bool) -> int:
    """Check this machine: versions, groups, ports, Bluetooth, optional packages.

    Each line starts with ok, -- (a note) or !! (a problem). Exit code: 1 with any !!.
    """
    from diffbotctl.diagnostics.doctor import Verdict, doctor_findings
    from diffbotctl.ports.access import current_user
    from diffbotctl.ports.diagnosis import survey_ports
    from diffbotctl.ports.fixes import fix_commands
    from diffbotctl.ui.text import fold_text

    user = current_user()
    survey = survey_ports(root, user)
    if fix:
        for line in fix_commands(root, survey, user) or [NOTHING_TO_FIX]:
            click.echo(line)
        return 0
    is_bad = False
    for finding in doctor_findings(root, user, survey):
        is_bad |= finding.verdict == Verdict.BAD
        if as_json:
            print_json(finding._asdict())
            continue
        line = f"{finding.verdict}  {finding.topic:<14}  {finding.text}"
        click.echo(fold_text(line, hang=DOCTOR_INDENT))
        if finding.fix:
            click.echo(fold_text(f"{'':<{DOCTOR_INDENT}}-> {finding.fix}", hang=len("-> ")))
    return 1 if is_bad else 0
