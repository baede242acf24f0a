"""The program `diffbotctl`: finds the command that was named and imports nothing else."""

from __future__ import annotations

import errno
import os
import signal
import sys
from importlib import import_module
from typing import TYPE_CHECKING, Any, NamedTuple

import click

from diffbotctl.cli import COMPLETING

if TYPE_CHECKING:
    from click.shell_completion import CompletionItem

    from diffbotctl.errors import UserError

OTHER_WORDS = {  # that people try -> the command
    "continue": "resume",
    "halt": "stop",
    "move": "drive",
    "play": "replay",
    "setup": "start",
    "sim": "run",
    "simulate": "run",
    "status": "engines",
    "upload": "flash",
    "version": "--version",
}
INTERRUPTED = 130  # exit code, as shells use it
DISK_FULL = (errno.ENOSPC, errno.EDQUOT)


class HelpRow(NamedTuple):
    """A row of --help: commands, what each does, and the modules that have them.

    The help stands here so that --help need not import the commands. One module may have all of
    the row, or the command the name of its module.
    """

    commands: str
    help: str
    modules: str = ""

    def entries(self) -> list[tuple[str, str, str]]:
        """Name, module and help of each command."""
        names = self.commands.split(", ")
        modules = self.modules.split(", ") if self.modules else names
        modules = modules * len(names) if len(modules) == 1 else modules
        texts = self.help.split("; ", len(names) - 1)
        return list(zip(names, modules, texts, strict=True))


GROUPS = {
    "Set up": (
        HelpRow("start, learn", "Guided setup; lessons that check themselves"),
        HelpRow("flash, blink", "Write the firmware to the board; blink its light", "flash"),
        HelpRow("ports, doctor", "List the serial ports; check this machine", "ports"),
        HelpRow("bluetooth", "Find, pair and test a Bluetooth module"),
        HelpRow("service", "Print a systemd unit that starts a run at boot"),
        HelpRow("completion", "Print the completion script of a shell"),
    ),
    "Run": (
        HelpRow("run, trials", "Run a pipeline, real or simulated; judge many runs"),
        HelpRow("emulate", "Start a virtual board that runs the real firmware"),
    ),
    "Look": (
        HelpRow("dash, web", "Show a running engine on one screen; on a page", "screens, web"),
        HelpRow(
            "engines, why", "List the running engines; explain why one stopped", "engines, stop"
        ),
        HelpRow(
            "topic, types, log",
            "Print messages; list message types; follow the log",
            "topic, topic, log",
        ),
        HelpRow("blocks, graph", "List blocks; draw a pipeline"),
        HelpRow("param, call", "Change parameters; call an action of a block", "param"),
    ),
    "Drive": (
        HelpRow("stop, resume", "Stop the robot; allow it to move again", "stop"),
        HelpRow("goto, drive", "Drive to a pose; drive for a time, distance or angle", "drive"),
        HelpRow("teleop", "Drive with the keys", "screens"),
        HelpRow("ros2, foxglove", "Connect a running engine to ROS 2; to Foxglove"),
    ),
    "Calibrate": (HelpRow("calibrate", "Measure wheels, track, motors and sensors"),),
    "Record": (
        HelpRow("replay", "Replay a recording, unchanged or changed"),
        HelpRow("bag", "Recordings: record, save, info, plot, export, diff"),
    ),
    "Files": (
        HelpRow("new", "Write a new robot, pipeline or block"),
        HelpRow("check, explain", "Check files; explain an error code", "check"),
        HelpRow(
            "wiring, show", "Draw the wiring of a robot; draw the robot", "wiring, robot_model"
        ),
        HelpRow("frames, export", "Print coordinate frames; write URDF", "robot_model"),
    ),
}


class CommandEntry(NamedTuple):
    """Where a command is, and its help."""

    module: str
    help: str


COMMANDS = {
    name: CommandEntry(module, f"{text[0].upper()}{text[1:]}.")
    for rows in GROUPS.values()
    for row in rows
    for name, module, text in row.entries()
} | {"help": CommandEntry("main", "Show the help of a command.")}


class LazyGroup(click.Group):
    """A group whose commands are imported when they are used."""

    def list_commands(self, ctx: click.Context) -> list[str]:
        """All commands, in the order of the table."""
        return list(COMMANDS)

    def get_command(self, ctx: click.Context, name: str) -> click.Command | None:
        """Import the module of the command."""
        if name == "help":
            return help_command
        if name not in COMMANDS:
            return None
        module = import_module(f"diffbotctl.cli.{COMMANDS[name].module}")
        if signal.getsignal(signal.SIGINT) is not signal.SIG_IGN:
            # From here on commands clean up on KeyboardInterrupt.
            signal.signal(signal.SIGINT, signal.default_int_handler)
        command: click.Command = getattr(module, name, None) or module.command
        if COMPLETING in os.environ:
            from diffbotctl.cli.completion import teach

            return teach(command)
        return command

    def shell_complete(self, ctx: click.Context, incomplete: str) -> list[CompletionItem]:
        """The commands that start with `incomplete`; imports none of them."""
        from click.shell_completion import CompletionItem

        options = click.Command.shell_complete(self, ctx, incomplete)
        return options + [
            CompletionItem(name, help=entry.help)
            for name, entry in COMMANDS.items()
            if name.startswith(incomplete)
        ]

    def format_commands(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        """The rows of GROUPS; imports nothing."""
        formatter.write_paragraph()
        for group, rows in GROUPS.items():
            for number, row in enumerate(rows):
                title = "" if number else group
                formatter.write(f"{title:<9} {row.commands:<17} {row.help}\n")

    def resolve_command(self, ctx: click.Context, args: list[str]) -> Any:
        """As click does; names the closest command when there is none."""
        if args and args[0] not in COMMANDS and not args[0].startswith("-"):
            raise _unknown_command(args)
        return super().resolve_command(ctx, args)


def _commands_in_groups(name: str) -> list[str]:
    """The commands called `name` of all groups, such as `topic echo`."""
    found = []
    context = click.Context(program)
    for group_name in COMMANDS:
        group = program.get_command(context, group_name)
        if isinstance(group, click.Group) and name in group.commands:
            found.append(f"{group_name} {name}")
    return found


def _unknown_command(words: list[str]) -> Exception:
    from difflib import get_close_matches

    from diffbotctl.cli.ros_aliases import ros_error

    error = ros_error(words)
    if error is not None:
        return error
    meant = OTHER_WORDS.get(words[0].lower())
    near = [meant] if meant else get_close_matches(words[0], COMMANDS, n=1)
    inside = _commands_in_groups(words[0])
    hint = "See diffbotctl --help."
    if near or inside:
        hint = f"Did you mean {' or '.join(repr(name) for name in [*near, *inside])}?"
    return click.UsageError(f"There is no command '{words[0]}'. {hint}")


@click.group(cls=LazyGroup, context_settings={"help_option_names": ["-h", "--help"]})
@click.version_option(None, "-V", "--version", package_name="diffbotctl")
@click.option("--debug", is_flag=True, help="Show the traceback of an error.")
def program(debug: bool) -> None:
    """Drive a low-cost differential-drive robot from YAML files.

    `diffbotctl help COMMAND` shows the help of a command.
    """


@click.command("help")
@click.argument("words", nargs=-1, metavar="[COMMAND]...")
@click.pass_context
def help_command(ctx: click.Context, words: tuple[str, ...]) -> None:
    """Show the help of COMMAND, such as `help run` or `help topic echo`."""
    from diffbotctl.cli.options import CommandGroup

    shown = ctx.find_root()
    command: click.Command = shown.command
    for word in words:
        child = command.get_command(shown, word) if isinstance(command, click.Group) else None
        if child is None and isinstance(command, CommandGroup):
            raise click.UsageError(command.unknown_command(word))
        if child is None:
            raise _unknown_command([word])
        shown = click.Context(child, info_name=word, parent=shown)
        command = child
    click.echo(command.get_help(shown))


def main() -> None:
    """Entry point. Errors end in a message and an exit code, never in a traceback.

    An interrupt ends the process with exit code 130, also while modules are imported: the modules
    `__main__` and this one are imported with a handler that does so.
    """
    from diffbotctl.cli.closed_streams import open_closed_streams
    from diffbotctl.printable import printable_stream

    open_closed_streams()
    # Control characters become dots, and what the output's encoding lacks question marks.
    sys.stdout, sys.stderr = printable_stream(sys.stdout), printable_stream(sys.stderr)
    _fold_for_terminal()
    debug = "--debug" in sys.argv
    arguments = [argument for argument in sys.argv[1:] if argument != "--debug"]
    try:
        code = _exit_code(arguments, debug)
    except KeyboardInterrupt:
        code = INTERRUPTED
    sys.exit(code)


def _fold_for_terminal() -> None:
    """Fold the output on a terminal: our texts have 80 columns, and names of files any number."""
    from diffbotctl.printable import fold_lines

    for stream in (sys.stdout, sys.stderr):
        try:
            columns = os.get_terminal_size(stream.fileno()).columns
        except (OSError, ValueError, AttributeError):
            continue  # no terminal
        if columns > 0:
            fold_lines(stream, columns)


def _exit_code(arguments: list[str], debug: bool) -> int:
    from diffbotctl.errors import UserError

    try:
        code = program.main(arguments, prog_name="diffbotctl", standalone_mode=False)
        return code if isinstance(code, int) else 0
    except click.exceptions.Abort:
        return INTERRUPTED
    except click.ClickException as error:
        _print_usage_error(error)
        return 2
    except UserError as error:
        if debug:
            raise
        print_error(error)
        return error.exit_code
    except BrokenPipeError:
        return 1  # the reader of the output has ended
    except Exception as error:
        if _is_interrupt(error):
            return INTERRUPTED
        if debug:
            raise
        print_error(_unexpected(error))
        return 1


def _is_interrupt(error: BaseException | None) -> bool:
    """Whether an interrupt caused it: Python 3.11 wraps what `__set_name__` raises."""
    while error is not None and not isinstance(error, KeyboardInterrupt):
        error = error.__cause__
    return error is not None


def print_error(error: UserError) -> None:
    """Print an error to standard error, `error:` in front, in red on a terminal.

    NO_COLOR is respected.
    """
    print_error_mark()
    print(f" {error}", file=sys.stderr)


def print_error_mark() -> None:
    """Print `error:`, red where standard error is a terminal."""
    from diffbotctl.printable import write_raw

    is_plain = "NO_COLOR" in os.environ or not sys.stderr.isatty()
    mark = "error:" if is_plain else click.style("error:", fg="red", bold=True)
    write_raw(sys.stderr, mark)


def _print_usage_error(error: click.ClickException) -> None:
    context = getattr(error, "ctx", None)
    # Of click 8.2 and later: its message is the help of a group that was given no command.
    if isinstance(error, getattr(click.exceptions, "NoArgsIsHelpError", ())):
        print(error.format_message(), file=sys.stderr)
        return
    if context is not None:
        print(context.get_usage(), file=sys.stderr)
    from diffbotctl.cli.extra_words import explained

    print_error_mark()
    print(f" {explained(error, sys.argv[1:])}", file=sys.stderr)


def _unexpected(error: Exception) -> UserError:
    """A full disk, or a defect of this program, as an error for a person."""
    from diffbotctl.errors import Problem, RunError

    if isinstance(error, OSError) and error.errno in DISK_FULL:
        place = str(error.filename or "the output")
        cause = "no space is left on the disk"
        fix = "free some space (`df -h` shows where), or write to another disk"
        return RunError(Problem("E-DISK-FULL", place, cause, fix))
    cause = f"internal error: {type(error).__name__}: {error}"
    fix = "this is a defect of diffbotctl; run it again with --debug and report what it prints"
    return RunError(Problem("E-DEFECT", "diffbotctl", cause, fix))
