"""`diffbotctl doctor`: is this machine ready for a robot?"""

from __future__ import annotations

from pathlib import Path

import click

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
def command(fix: bool, root: Path) -> int:
    """Look over the machine: versions, groups, ports, Bluetooth, optional packages.

    Each line begins with ok, -- (worth knowing) or !! (in the way). Exit code: 1 with any !!.
    """
    from diffbotctl.diagnostics.doctor import BAD, doctor_findings
    from diffbotctl.ports.diagnosis import survey_ports
    from diffbotctl.ports.fixes import fix_commands
    from diffbotctl.ports.permissions import current_user
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
