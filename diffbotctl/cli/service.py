"""`diffbotctl service`: a systemd unit for a robot that carries its own computer."""

from __future__ import annotations

import re
import sys
from pathlib import Path
from typing import TYPE_CHECKING

import click

if TYPE_CHECKING:
    from diffbotctl.config.configuration import Configuration

UNIT = """\
# diffbotctl: {pipeline} on {port}
#     sudo cp THIS /etc/systemd/system/{name}.service
#     sudo systemctl daemon-reload
#     sudo systemctl enable --now {name}
# Then, as a member of the group {group}: diffbotctl why; diffbotctl goto 0.5 0
[Unit]
Description=diffbotctl, {pipeline}
Documentation=man:systemd.service(5)
# Without end: the board may be plugged in an hour from now.
StartLimitIntervalSec=0

[Service]
Type=exec
User={user}
Group={group}
WorkingDirectory={folder}
# {group} may use serial ports, and may command this engine through its socket here.
RuntimeDirectory=diffbotctl-{group}
RuntimeDirectoryMode=0750
ExecStart={command}
# A run that is told to end stops the robot, confirms it, and ends with code 130. Its screens and
# its recorder are its children: they must not be told before it.
KillSignal=SIGINT
KillMode=mixed
TimeoutStopSec=10
SuccessExitStatus=130
Restart=on-failure
RestartSec=5
# The control path wakes 40 times a second and must not wait behind other work.
Nice=-5
NoNewPrivileges=yes
ProtectSystem=full

[Install]
WantedBy=multi-user.target
"""


@click.command()
@click.argument("pipeline", default="standby")
@click.option("--robot", help="Robot file; the rules of `run` for none.")
@click.option("--port", default="auto", show_default=True, help="The board's port, or auto.")
@click.option("--user", help="Who runs it; without it you.")
@click.option("--group", default="dialout", show_default=True, help="Who may command it.")
@click.option("--name", default="robot", show_default=True, help="Of the service.")
def command(
    pipeline: str, robot: str | None, port: str, user: str | None, group: str, name: str
) -> int:
    """Print a systemd unit that runs PIPELINE whenever the machine is on, from this folder.

    `standby` stands still until somebody says goto or drive. A pipeline with goals would drive off
    whenever the machine starts, and is refused.
    """
    from getpass import getuser

    from diffbotctl.config.load import load

    configuration = load(pipeline, robot)
    _refuse_goals(configuration, pipeline)
    words = [*_program(), "run", pipeline, "--port", port, "--stay", "--quiet", "--group", group]
    words += ["--name", name]
    if configuration.robot_file is not None:
        words += ["--robot", str(configuration.robot_file.resolve())]
    click.echo(
        UNIT.format(
            pipeline=pipeline,
            port=port,
            name=name,
            group=group,
            user=user or getuser(),
            folder=_escaped(str(Path.cwd())),
            command=" ".join(map(_quoted, words)),
        ),
        nl=False,
    )
    return 0


def _program() -> list[str]:
    """How this program is started, by its whole path: a service knows no PATH of yours."""
    beside = Path(sys.executable).with_name("diffbotctl")
    if beside.is_file():
        return [str(beside)]
    return [sys.executable, "-m", "diffbotctl"]


def _escaped(text: str) -> str:
    """Without what systemd would put something else for."""
    return text.replace("%", "%%")


def _quoted(word: str) -> str:
    """A word of a command line as systemd reads it (systemd.service(5), "Command lines")."""
    if re.fullmatch(r"[\w@/.:=+-]+", word):
        return word
    safe = word.replace("\\", "\\\\").replace('"', '\\"').replace("$", "$$")
    return f'"{_escaped(safe)}"'


def _refuse_goals(configuration: Configuration, pipeline: str) -> None:
    from diffbotctl.errors import Problem, UsageError

    if configuration.goals:
        cause = f"{pipeline} has goals: the robot would drive off whenever the machine starts"
        fix = "take `standby`, or a pipeline with goals: [], and send it with `diffbotctl goto`"
        raise UsageError(Problem("E-SERVICE-GOALS", str(configuration.file), cause, fix))
