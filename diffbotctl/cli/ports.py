"""`diffbotctl ports`: the serial ports, who may use them, and what stands in the way.

`diffbotctl doctor`: is this machine ready for a robot?
"""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import click

if TYPE_CHECKING:
    from diffbotctl.errors import Problem
    from diffbotctl.ports.diagnosis import PortReport, PortSurvey

RESETS = "Asking. A board on a USB port is reset by it: lift the wheels."


@click.command()
@click.argument("port", required=False)
@click.option("--ask", is_flag=True, help="Ask who is behind each port; resets boards on USB.")
@click.option("--robot", help="Robot file whose baud rates --ask tries; the rules of `run`.")
@click.option(
    "--root",
    default="/",
    type=click.Path(exists=True, file_okay=False, path_type=Path),
    help="A folder that stands for /, such as a copy of another machine's.",
)
def ports(port: str | None, ask: bool, robot: str | None, root: Path) -> int:
    """List the serial ports, or look at one PORT: chip, board, name that stays, rights, users.

    Exit code: 0 when a port could be used (or PORT can), 1 when not.
    """
    from diffbotctl.ports.access import current_user
    from diffbotctl.ports.diagnosis import survey_ports

    seen = survey_ports(root, current_user())
    if port is not None:
        usable = _one(root, seen, port)
        names = [port] if usable else []
    else:
        usable = _all(seen)
        names = [report.port.device for report in seen.reports if report.usable]
    if ask and names:
        usable = _ask(names, robot)
    return 0 if usable else 1


def _all(seen: PortSurvey) -> bool:
    for report in seen.reports:
        _show(report)
    _tell(seen.problems)
    return any(report.usable for report in seen.reports)


def _one(root: Path, seen: PortSurvey, name: str) -> bool:
    from diffbotctl.ports.diagnosis import PortReport, diagnose_name

    found = diagnose_name(root, seen, name)
    if found is None:
        click.echo(f"{name}  a pseudo-terminal, such as an emulated board's")
        return True
    if isinstance(found, PortReport):
        _show(found)
        return found.usable
    _tell((found,))
    return False


def _show(report: PortReport) -> None:
    port = report.port
    click.echo(f"{port.device}  {report.title}")
    if port.usb is not None:
        chip = f"USB {port.usb.identity}  {port.usb.title}".rstrip()
        click.echo(f"  {chip}  on {port.usb.place}")
    if port.stable:
        click.echo(f"  always called {port.stable}")
    if report.usable:
        click.echo("  free, and you may use it")
    _tell(report.problems)


def _tell(problems: tuple[Problem, ...]) -> None:
    for problem in problems:
        click.echo(problem.render())


def _ask(names: list[str], robot: str | None) -> bool:
    from diffbotctl.board.session import identify
    from diffbotctl.config.load import load_robot
    from diffbotctl.drivers.robot_link import diffbot_host
    from diffbotctl.errors import RunError

    file = load_robot(robot)
    click.echo(RESETS)
    answered = False
    for name in names:
        try:
            for said in identify(name, diffbot_host(file.robot, name)):
                click.echo(f"{name}  {said.text}")
            answered = True
        except RunError as error:
            click.echo(str(error))
    return answered


BESIDE = 20  # columns of verdict and topic
NOTHING = "# nothing to mend"  # a comment, for all of it may be handed to a shell


@click.command()
@click.option("--fix", is_flag=True, help="Print the commands that mend it; nothing is changed.")
@click.option(
    "--root",
    default="/",
    type=click.Path(exists=True, file_okay=False, path_type=Path),
    help="A folder that stands for /, such as a copy of another machine's.",
)
def doctor(fix: bool, root: Path) -> int:
    """Look over the machine: versions, groups, ports, Bluetooth, optional packages.

    Each line begins with ok, -- (worth knowing) or !! (in the way). Exit code: 1 with any !!.
    """
    from diffbotctl.diagnostics.doctor import BAD, doctor_findings
    from diffbotctl.ports.access import current_user
    from diffbotctl.ports.diagnosis import survey_ports
    from diffbotctl.ports.fixes import fix_commands
    from diffbotctl.ui.text import fold_text

    person = current_user()
    seen = survey_ports(root, person)
    if fix:
        for line in fix_commands(root, seen, person) or [NOTHING]:
            click.echo(line)
        return 0
    bad = False
    for found in doctor_findings(root, person, seen):
        click.echo(fold_text(f"{found.verdict}  {found.topic:<14}  {found.words}", hang=BESIDE))
        if found.fix:
            click.echo(fold_text(f"{'':<{BESIDE}}-> {found.fix}", hang=len("-> ")))
        bad |= found.verdict == BAD
    return 1 if bad else 0
