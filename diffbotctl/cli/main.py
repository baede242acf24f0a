"""The program `diffbotctl`: finds the command that was named and imports nothing else."""

from __future__ import annotations

import errno
import os
import re
import signal
import sys
from functools import cache
from importlib import import_module
from pathlib import Path
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


GROUPS = ("Set up", "Run", "Look", "Drive", "Calibrate", "Record", "Files")  # of commands
# A command, as its module declares it by `cli.command`; a line break is found faster than `^`.
DECLARED = re.compile(r'\n@(?:command|group)\(\s*"(.+?)",\s*(\d+),\s*"(.+?)"')
FUNCTION = re.compile(r"\ndef (\w+)")


class CommandEntry(NamedTuple):
    """Where a command is, and its help."""

    module: str
    group: str
    place: int
    help: str

    @property
    def sentence(self) -> str:
        text = self.help.removeprefix("; ")
        return f"{text[0].upper()}{text[1:]}."


@cache
def commands() -> dict[str, CommandEntry]:
    """All commands, in the order of --help.

    They are found in the text of the modules, so that --help need not import them.
    """
    found: dict[str, CommandEntry] = {}
    for path in Path(__file__).parent.glob("[a-z]*.py"):
        text = path.read_text(encoding="utf-8")
        for match in DECLARED.finditer(text):
            function = FUNCTION.search(text, match.end())
            if function is not None:
                place = match[1], int(match[2]), match[3]
                found[function[1]] = CommandEntry(path.stem, *place)
    rows = sorted(found.items(), key=lambda row: (GROUPS.index(row[1].group), row[1].place))
    return {**dict(rows), "help": CommandEntry("main", "", 0, "Show the help of a command")}


def help_rows(group: str) -> list[tuple[str, str]]:
    """The rows of a group: names, and what these commands do."""
    rows: list[tuple[str, str]] = []
    for name, entry in commands().items():
        if entry.group == group and entry.help.startswith("; "):
            names, text = rows[-1]
            rows[-1] = f"{names}, {name}", f"{text}{entry.help}"
        elif entry.group == group:
            rows.append((name, entry.help))
    return rows


class LazyGroup(click.Group):
    """A group whose commands are imported when they are used."""

    def list_commands(self, ctx: click.Context) -> list[str]:
        """All commands, in the order of the table."""
        return list(commands())

    def get_command(self, ctx: click.Context, name: str) -> click.Command | None:
        if name == "help":
            return help_command
        if name not in commands():
            return None
        module = import_module(f"diffbotctl.cli.{commands()[name].module}")
        if signal.getsignal(signal.SIGINT) is not signal.SIG_IGN:
            # From here on commands clean up on KeyboardInterrupt.
            signal.signal(signal.SIGINT, signal.default_int_handler)
        command: click.Command = getattr(module, name)
        if COMPLETING in os.environ:
            from diffbotctl.cli.completion import teach

            return teach(command)
        return command

    def shell_complete(self, ctx: click.Context, incomplete: str) -> list[CompletionItem]:
        """The commands that start with `incomplete`; imports none of them."""
        from click.shell_completion import CompletionItem

        options = click.Command.shell_complete(self, ctx, incomplete)
        return options + [
            CompletionItem(name, help=entry.sentence)
            for name, entry in commands().items()
            if name.startswith(incomplete)
        ]

    def format_commands(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        """The rows of all groups; imports nothing."""
        formatter.write_paragraph()
        for group in GROUPS:
            for number, (names, text) in enumerate(help_rows(group)):
                title = "" if number else group
                formatter.write(f"{title:<9} {names:<17} {text}\n")

    def resolve_command(self, ctx: click.Context, args: list[str]) -> Any:
        """As click does; names the closest command when there is none."""
        if args and args[0] not in commands() and not args[0].startswith("-"):
            raise _unknown_command(args)
        return super().resolve_command(ctx, args)


def _commands_in_groups(name: str) -> list[str]:
    """The commands called `name` of all groups, such as `topic echo`."""
    found = []
    context = click.Context(program)
    for group_name in commands():
        group = program.get_command(context, group_name)
        if isinstance(group, click.Group) and name in group.commands:
            found.append(f"{group_name} {name}")
    return found


def _unknown_command(words: list[str]) -> Exception:
    from difflib import get_close_matches

    from diffbotctl.cli.other_words import ros_error

    error = ros_error(words)
    if error is not None:
        return error
    meant = OTHER_WORDS.get(words[0].lower())
    near = [meant] if meant else get_close_matches(words[0], commands(), n=1)
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
    from diffbotctl.cli.command import CommandGroup

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
    from diffbotctl.cli.standard_streams import open_closed_streams
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
    from diffbotctl.cli.other_words import explained

    print_error_mark()
    print(f" {explained(error, sys.argv[1:])}", file=sys.stderr)


def _unexpected(error: Exception) -> UserError:
    """A full disk, a deleted directory, or a defect of this program, as an error for a person."""
    from diffbotctl.errors import Problem, RunError

    if isinstance(error, OSError) and error.errno in DISK_FULL:
        place, cause = str(error.filename or "the output"), "no space is left on the disk"
        fix = "free some space (`df -h` shows where), or write to another disk"
        return RunError(Problem("E-DISK-FULL", place, cause, fix))
    if isinstance(error, FileNotFoundError) and error.filename is None:  # of `os.getcwd`
        cause, fix = "the working directory was deleted", "go to another one: `cd`"
        return RunError(Problem("E-FILE-READ", ".", cause, fix))
    cause = f"internal error: {type(error).__name__}: {error}"
    fix = "this is a defect of diffbotctl; run it again with --debug and report what it prints"
    return RunError(Problem("E-DEFECT", "diffbotctl", cause, fix))
