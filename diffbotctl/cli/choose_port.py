"""What `--port auto` means: the one board there is, or the one of several that a person picks."""

from __future__ import annotations

import sys
from collections.abc import Sequence

import click


def choose_port(radio: bool = False) -> str:
    """The device of the board; with `radio`, bound Bluetooth ports count too.

    Raises NoBoardError, with `radio` one that names the modules that are paired but not bound;
    SeveralBoardsError where nobody is there to ask.
    """
    from diffbotctl.drivers.board_candidates import candidates, choose
    from diffbotctl.drivers.board_errors import NoBoardError, SeveralBoardsError

    found = candidates(radio)
    try:
        return choose(found).device
    except SeveralBoardsError:
        if not sys.stdin.isatty():
            raise
    except NoBoardError:
        if radio:
            _name_modules()
        raise
    for number, each in enumerate(found, 1):
        click.echo(f"{number}  {each.device}  {each.title}  {each.stable}".rstrip())
    number = click.prompt("Which board", type=click.IntRange(1, len(found)))
    return found[number - 1].device


def _name_modules() -> None:
    """Raises OnlyRadioError when a module is paired. It is not chosen by itself: whether the robot
    at hand is the one behind it, only a person can tell."""
    from diffbotctl.bluetooth.bluez import RfcommPort, paired_modules
    from diffbotctl.drivers.board_errors import OnlyRadioError

    modules = paired_modules()
    if modules:
        raise OnlyRadioError(
            [f"{each.name} {each.address}".lstrip() for each in modules],
            [over(sys.argv[1:], str(RfcommPort(each.address))) for each in modules],
        )


def over(words: Sequence[str], port: str) -> str:
    """The command line of `words`, with `port` in place of the `auto` that it says or means."""
    from shlex import join

    said = list(words)
    if "--port" in said[:-1]:
        said[said.index("--port") + 1] = port
    elif "--port=auto" in said:
        said[said.index("--port=auto")] = f"--port={port}"
    else:
        said += ["--port", port]
    return f"diffbotctl {join(said)}"
