"""`diffbotctl service`: a systemd unit for a robot that carries its own computer."""

from __future__ import annotations

import re
import sys
from collections.abc import Iterable
from getpass import getuser
from pathlib import Path
from string import Template
from typing import TYPE_CHECKING

import click

from diffbotctl.cli.command import argument, command, option
from diffbotctl.cli.options import ROBOT, port_option
from diffbotctl.config.lookup import folder
from diffbotctl.errors import Problem, UsageError
from diffbotctl.printable import keep_lines

if TYPE_CHECKING:
    from diffbotctl.config.configuration import Configuration


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
    template = Template((folder("templates") / "unit.service.tmpl").read_text(encoding="utf-8"))
    keep_lines(sys.stdout)
    click.echo(
        template.substitute(
            pipeline=pipeline,
            port=port,
            name=name,
            group=group,
            user=user or getuser(),
            folder=_escaped(str(Path.cwd())),
            command=_command_line(words),
        ),
        nl=False,
    )


def _program() -> list[str]:
    """The command that starts this program, by absolute path: a service has another PATH."""
    beside = Path(sys.executable).with_name("diffbotctl")
    if beside.is_file():
        return [str(beside)]
    return [sys.executable, "-m", "diffbotctl"]


def _command_line(words: Iterable[str]) -> str:
    """The words as systemd reads them, each option on a line of its own."""
    parts = (f" \\\n    {word}" if word.startswith("--") else f" {_quoted(word)}" for word in words)
    return "".join(parts).strip()


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
