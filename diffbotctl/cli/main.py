"""`diffbotctl`: finds the command that was named and imports nothing else."""

from __future__ import annotations

import errno
import os
import sys
from importlib import import_module
from io import TextIOWrapper
from typing import TYPE_CHECKING, Any

import click

from diffbotctl.cli import COMPLETING

if TYPE_CHECKING:
    from click.shell_completion import CompletionItem

# One line a command: its help stands here too, so that --help need not import it.
COMMANDS = {
    "start": "Be guided from nothing to the first goal: simulated at once, then your robot.",
    "run": "Run a pipeline on the simulated robot, or on a real one with --port.",
    "show": "Draw a robot from above and from the side.",
    "frames": "Print the frames of a robot as a tree.",
    "export": "Write a robot as URDF, for other programs.",
    "check": "Check robot and pipeline files; print every problem with its place.",
    "explain": "Explain an error code at length.",
    "graph": "Draw a pipeline's blocks and wires.",
    "new": "Write a new robot, pipeline or block to start from.",
    "wiring": "Show every wire of a robot: a picture, a table, and what to mind.",
    "blocks": "List the blocks there are, or show one.",
    "stop": "Stop the robot of a running engine, whatever else is broken.",
    "resume": "Let a stopped robot move again.",
    "goto": "Send the robot of a running engine to a place.",
    "why": "Tell why the robot stopped, from the sensor to the motors.",
    "dash": "Show a running engine on one screen; click on the map to send the robot there.",
    "teleop": "Drive the robot of a running engine with the keys.",
    "drive": "Drive the robot of a running engine by hand, for a time, a distance or an angle.",
    "topic": "List, print and measure the messages of a running engine.",
    "param": "List and change the parameters of running blocks.",
    "call": "Call an action of a running block.",
    "log": "Follow the log of a running engine, or change what a block says.",
    "replay": "Run a recording again, as it was or with something changed.",
    "bag": "Look into recordings: info, plot, export, diff, recover.",
    "calibrate": "Find out what the robot's dimensions really are.",
    "flash": "Write our firmware onto a Mega 2560 and send it the robot's settings.",
    "blink": "Check board, cable and port: blink the board's light.",
    "ports": "List the serial ports: board, rights, who holds them, and what to do.",
    "doctor": "Check this machine: versions, rights, ports, Bluetooth, optional packages.",
    "bluetooth": "Find and pair a Bluetooth module, test its link, change its rate.",
    "service": "Print a systemd unit that starts the robot's engine with the machine.",
    "completion": "Print what bash, zsh or fish needs to complete these words.",
    "emulate": "Start a virtual board that runs the real firmware, on two ports.",
}

# The module of a command, where it has another name than the command.
MODULES = {
    "blink": "flash",
    "call": "param",
    "dash": "screens",
    "doctor": "ports",
    "explain": "check",
    "export": "robot_model",
    "frames": "robot_model",
    "goto": "drive",
    "resume": "stop",
    "show": "robot_model",
    "teleop": "screens",
    "why": "stop",
}


class Lazy(click.Group):
    """A group whose commands are modules of diffbotctl.cli."""

    def list_commands(self, ctx: click.Context) -> list[str]:
        """All commands, in the order of the table."""
        return list(COMMANDS)

    def get_command(self, ctx: click.Context, name: str) -> click.Command | None:
        """Import the module of the command."""
        if name not in COMMANDS:
            return None
        module = import_module(f"diffbotctl.cli.{MODULES.get(name, name)}")
        command: click.Command = getattr(module, name, None) or module.command
        if COMPLETING in os.environ:
            from diffbotctl.cli.completion import teach

            return teach(command)
        return command

    def shell_complete(self, ctx: click.Context, incomplete: str) -> list[CompletionItem]:
        """The commands that begin so, without importing any."""
        from click.shell_completion import CompletionItem

        options = click.Command.shell_complete(self, ctx, incomplete)
        named = COMMANDS.items()
        return options + [
            CompletionItem(name, help=about) for name, about in named if name.startswith(incomplete)
        ]

    def format_commands(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        """The table, without importing anything."""
        with formatter.section("Commands"):
            formatter.write_dl(list(COMMANDS.items()))

    def resolve_command(self, ctx: click.Context, args: list[str]) -> Any:
        """As click does, with the nearest command named when there is none."""
        if args and args[0] not in COMMANDS and not args[0].startswith("-"):
            from difflib import get_close_matches

            from diffbotctl.cli.ros_aliases import answer

            known = answer(args)
            if known:
                raise click.UsageError(known)
            near = get_close_matches(args[0], COMMANDS, n=1)
            hint = f" Did you mean '{near[0]}'?" if near else " See diffbotctl --help."
            raise click.UsageError(f"There is no command '{args[0]}'.{hint}")
        return super().resolve_command(ctx, args)


@click.group(cls=Lazy, context_settings={"help_option_names": ["-h", "--help"]})
@click.version_option(package_name="diffbotctl")
@click.option("--debug", is_flag=True, help="Show the traceback of an error.")
@click.pass_context
def program(ctx: click.Context, debug: bool) -> None:
    """Drive a low-cost differential-drive robot from YAML files."""
    ctx.obj = debug


def main() -> None:
    """Entry point. Errors leave as words and an exit code, never as a traceback."""
    from diffbotctl.errors import UserError

    _never_fail_at_letters()
    debug = "--debug" in sys.argv
    arguments = [argument for argument in sys.argv[1:] if argument != "--debug"]
    try:
        code = program.main(arguments, prog_name="diffbotctl", standalone_mode=False)
    except click.exceptions.Abort:
        sys.exit(130)
    except click.ClickException as error:
        error.show()
        sys.exit(2)
    except UserError as error:
        if debug:
            raise
        print(error, file=sys.stderr)
        sys.exit(error.exit_code)
    except BrokenPipeError:
        sys.exit(1)  # whoever read our output has gone
    except Exception as error:
        if debug:
            raise
        if isinstance(error, OSError) and error.errno in FULL:
            print(_full(error), file=sys.stderr)
            sys.exit(1)
        print(_defect(error), file=sys.stderr)
        sys.exit(1)
    sys.exit(code if isinstance(code, int) else 0)


FULL = (errno.ENOSPC, errno.EDQUOT)


def _never_fail_at_letters() -> None:
    """What a terminal, a pipe or a file name's bytes cannot say is a question mark, no failure."""
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, TextIOWrapper) and stream.errors == "strict":
            stream.reconfigure(errors="replace")


def _full(error: OSError) -> str:
    """Words for a disk that takes no more."""
    from diffbotctl.errors import Problem

    place = str(error.filename or "the output")
    cause = "no space is left where this had to be written"
    fix = "make room (`df -h` shows where), or write elsewhere"
    return Problem("E-DISK-FULL", place, cause, fix).render()


def _defect(error: Exception) -> str:
    """Words for an error that nobody foresaw: ours to mend, not the user's."""
    from diffbotctl.errors import Problem

    cause = f"diffbotctl itself failed: {type(error).__name__}: {error}"
    fix = "this is a defect of ours; run again with --debug and send us what it prints"
    return Problem("E-DEFECT", "diffbotctl", cause, fix).render()
