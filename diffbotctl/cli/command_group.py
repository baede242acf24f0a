"""Groups of commands, whose help shows the whole sentence of each command."""

from __future__ import annotations

import click

SENTENCE_MAX = 1000  # characters; longer than any


class CommandGroup(click.Group):
    """A group that folds the sentences of its commands; click cuts each to what one line holds."""

    def format_commands(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        """The section `Commands`: names and sentences."""
        commands = [(name, self.get_command(ctx, name)) for name in self.list_commands(ctx)]
        rows = [
            (name, command.get_short_help_str(SENTENCE_MAX))
            for name, command in commands
            if command is not None and not command.hidden
        ]
        with formatter.section("Commands"):
            formatter.write_dl(rows)
