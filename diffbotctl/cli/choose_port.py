"""The meaning of `--port auto`: the only board connected, or the one the user picks."""

from __future__ import annotations

import sys
from collections.abc import Sequence
from pathlib import Path
from shlex import join
from typing import TYPE_CHECKING

import click

if TYPE_CHECKING:
    from diffbotctl.links.diffbot_frames import BoardCode
    from diffbotctl.ports.sysfs import SerialPort


def choose_port(radio: bool = False, simulates: bool = False) -> str:
    """The device of the board; with `radio`, bound Bluetooth ports count too.

    `simulates`: the command works on the simulated robot too; the error then mentions it.

    Raises NoBoardError, with `radio` one that names the modules that are paired but not bound;
    SeveralBoardsError without a terminal to ask at.
    """
    from diffbotctl.drivers.board_ports import candidates

    return _choose(candidates(radio), radio, simulates)


def choose_board_port(board: BoardCode) -> str:
    """The device that may lead to a `board`. Raises as `choose_port`, and OtherBoardError."""
    from diffbotctl.drivers.board_ports import OtherBoardError, board_of, candidates

    boards = candidates()
    fitting = [port for port in boards if board_of(port) in (None, board)]
    if boards and not fitting:
        found = board_of(boards[0])
        assert found is not None
        raise OtherBoardError(f"port {boards[0].name}", found, board)
    return _choose(fitting)


def _choose(boards: list[SerialPort], radio: bool = False, simulates: bool = False) -> str:
    from diffbotctl.drivers.board_ports import NoBoardError, SeveralBoardsError, choose
    from diffbotctl.ports.diagnosis import unlisted_ports
    from diffbotctl.ports.sysfs import serial_ports

    try:
        return choose(boards).device
    except SeveralBoardsError:
        if not sys.stdin.isatty():
            raise
    except NoBoardError:
        if radio:
            _refuse_unbound_modules()
        raise NoBoardError(simulates, unlisted_ports(serial_ports(Path("/")))) from None
    for number, board in enumerate(boards, 1):
        title = (board.usb.title or "USB serial") if board.usb else "Bluetooth"
        click.echo(f"{number}  {board.device}  {title}  {board.stable}".rstrip())
    number = click.prompt("Which board", type=click.IntRange(1, len(boards)))
    return boards[number - 1].device


def _refuse_unbound_modules() -> None:
    """Raises OnlyRadioError when a module is paired.

    It is not chosen automatically: only the user knows whether it belongs to this robot.
    """
    from diffbotctl.bluetooth.bluez import RfcommPort, paired_modules
    from diffbotctl.drivers.board_ports import OnlyRadioError

    modules = paired_modules()
    if modules:
        raise OnlyRadioError(
            [f"{module.name} {module.address}".lstrip() for module in modules],
            [command_over(sys.argv[1:], str(RfcommPort(module.address))) for module in modules],
        )


def command_over(words: Sequence[str], port: str) -> str:
    """The command line of `words` with `port` instead of `auto`."""
    arguments = list(words)
    if "--port" in arguments[:-1]:
        arguments[arguments.index("--port") + 1] = port
    elif "--port=auto" in arguments:
        arguments[arguments.index("--port=auto")] = f"--port={port}"
    else:
        arguments += ["--port", port]
    return f"diffbotctl {join(arguments)}"
