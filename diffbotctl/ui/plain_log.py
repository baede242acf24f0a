"""Plain lines for a pipe or a file: the log, one line an event, never one a message."""

from __future__ import annotations

import sys
from collections.abc import Iterator

from diffbotctl.messages import Text
from diffbotctl.processes.screen import RunSnapshot
from diffbotctl.ui import message_text


def lines(pictures: Iterator[RunSnapshot]) -> Iterator[str]:
    """The lines of the log, and the newest text of each wire that carries texts."""
    heard: dict[str, int] = {}
    for picture in pictures:
        yield from map(message_text.line, picture.lines)
        yield from _texts(picture, heard)


def _texts(picture: RunSnapshot, heard: dict[str, int]) -> Iterator[str]:
    """A line for each text of a block that is newer than the one `heard` on its wire."""
    for wire, message in picture.messages.items():
        if isinstance(message, Text) and wire != BOARD and heard.get(wire, -1) < message.time:
            heard[wire] = message.time
            yield f"{message.time / 1e9:8.2f} s  {wire}: {message.text}"


BOARD = "robot.text"  # what a board says stands in the log


def show(pictures: Iterator[RunSnapshot]) -> None:
    """Print lines to standard output as they come."""
    for text in lines(pictures):
        print(text, file=sys.stdout, flush=True)
