"""`diffbotctl service`: a systemd unit for a robot that carries its own computer."""

from __future__ import annotations

import re
import sys
from getpass import getuser
from pathlib import Path
from typing import TYPE_CHECKING

import click

from diffbotctl.cli.command import argument, command, option
from diffbotctl.cli.options import ROBOT, port_option
from diffbotctl.errors import Problem, UsageError
from diffbotctl.printable import keep_lines

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
# No limit: the board may be connected an hour from now.
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
# On SIGINT a run stops the robot, confirms the stop and exits with code 130. Screens and recorder
# are its child processes and must not receive the signal before it.
KillSignal=SIGINT
KillMode=mixed
TimeoutStopSec=10
SuccessExitStatus=130
Restart=on-failure
RestartSec=5
# The control path runs 40 times a second and must not wait for other processes.
Nice=-5
LimitRTPRIO=2
NoNewPrivileges=yes
ProtectSystem=full

[Install]
WantedBy=multi-user.target
"""


@command("Set up", 8, "Print a systemd unit that starts a run at boot")
def service(
    pipeline: str = argument(default="standby"),
    robot: str | None = ROBOT,
    port: str = port_option("auto", only_board=True, is_checked=False),
    user: str | None = option("User that runs the service; default: you."),
    group: str = option("Group that may command the robot.", default="dialout", show_default=True),
    name: str = option("Name of the service.", default="robot", show_default=True),
) -> None:
    """Print a systemd unit that runs PIPELINE from this folder when the machine starts.

    `standby` stands still until it receives a goal or a drive command. A pipeline with goals is
    refused: the robot would start to drive whenever the machine starts.
    """
    from diffbotctl.config.load import load
    from diffbotctl.control_socket.address import NAME

    if not NAME.fullmatch(name):
        raise click.UsageError(f"--name {name}: use letters, digits, - and _ only, such as mower")
    configuration = load(pipeline, robot)
    _refuse_goals(configuration, pipeline)
    words = [*_program(), "run", pipeline, "--port", port, "--stay", "--quiet", "--group", group]
    words += ["--name", name]
    if configuration.robot_file is not None:
        words += ["--robot", str(configuration.robot_file.resolve())]
    keep_lines(sys.stdout)
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


def _program() -> list[str]:
    """The command that starts this program, by absolute path: a service has another PATH."""
    beside = Path(sys.executable).with_name("diffbotctl")
    if beside.is_file():
        return [str(beside)]
    return [sys.executable, "-m", "diffbotctl"]


def _escaped(text: str) -> str:
    """`text` with systemd's specifier character escaped."""
    return text.replace("%", "%%")


def _quoted(word: str) -> str:
    """A word of a command line as systemd reads it (systemd.service(5), "Command lines")."""
    if re.fullmatch(r"[\w@/.:=+-]+", word):
        return word
    safe = word.replace("\\", "\\\\").replace('"', '\\"').replace("$", "$$")
    return f'"{_escaped(safe)}"'


def _refuse_goals(configuration: Configuration, pipeline: str) -> None:
    if configuration.goals:
        cause = f"{pipeline} has goals: the robot would drive whenever the machine starts"
        fix = "use `standby`, or a pipeline with goals: [], and send goals with `diffbotctl goto`"
        raise UsageError(Problem("E-SERVICE-GOALS", str(configuration.file), cause, fix))
