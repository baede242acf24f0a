"""What `--port auto` means: the one board there is, or the one of several that a person picks."""

from __future__ import annotations

import sys

import click


def choose_port(radio: bool = False) -> str:
    """The device of the board; with `radio`, bound Bluetooth ports count too.

    Raises NoBoardError; SeveralBoardsError where nobody is there to ask.
    """
    from diffbotctl.flash.find import candidates, choose
    from diffbotctl.flash.trouble import SeveralBoardsError

    found = candidates(radio)
    try:
        return choose(found).device
    except SeveralBoardsError:
        if not sys.stdin.isatty():
            raise
    for number, each in enumerate(found, 1):
        click.echo(f"{number}  {each.device}  {each.title}  {each.stable}".rstrip())
    number = click.prompt("Which board", type=click.IntRange(1, len(found)))
    return found[number - 1].device
