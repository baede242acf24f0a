"""Changing an HC-05's rate through the board it is wired to, and the board's with it.

A small program that joins the USB port to the module's port is flashed for the purpose, and the
firmware after it, whatever came of it.
"""

from __future__ import annotations

import time
from collections.abc import Generator
from dataclasses import replace
from typing import NamedTuple

from diffbotctl.bluetooth.hc05_at import AtModeError, AtReply, AtReplyReader, BaudChange, set_baud
from diffbotctl.board.progress import Event, FlashMessage
from diffbotctl.config.lookup import folder
from diffbotctl.errors import Problem, RunError
from diffbotctl.flash.flasher import Bootloader, flash
from diffbotctl.links.diffbot_settings import BoardSettings

BRIDGE, FIRMWARE = "bridge_mega2560.hex", "diffbot_mega2560.hex"
BOOT = 1.5  # s from opening the port until the bridge runs: what comes earlier holds it up
ANSWER = 0.6  # s for an answer; at 38400 baud one takes 10 ms
ATTEMPTS = 3  # at getting the module into AT mode
BUTTON = """\
Now the module: pull its VCC wire out. Hold its small button down, put VCC back, and let go after
a second. Its light must blink slowly, once in two seconds: that is AT mode."""
OUT_AGAIN = "Pull the module's VCC out and put it back, without the button: its light blinks fast."


class Ask(NamedTuple):
    """The person has something to do; the job goes on when they have."""

    text: str


def change_rate(
    device: str, settings: BoardSettings, baud: int
) -> Generator[Event | Ask | BaudChange, None, None]:
    """Set the module on the board behind the USB port `device` to `baud`, and the board too.

    Yields Ask wherever a person must act. Raises RunError; the firmware is back on the board then,
    unless the cable was pulled.
    """
    yield FlashMessage("a program that joins the USB port to the module's port, for a while:")
    yield from flash(device, folder("firmware") / BRIDGE)
    done: BaudChange | None = None
    try:
        for attempt in range(ATTEMPTS):
            yield Ask(BUTTON)
            try:
                done = _talk(device, baud)
                break
            except AtModeError as error:
                if attempt == ATTEMPTS - 1:
                    raise _no_answer(device, error) from error
                yield FlashMessage(f"No: {error}. Once more.")
    finally:
        # In a `finally`, since a person who gives up must not be left with the bridge.
        settings = replace(settings, baud=done.now if done else settings.baud)
        events = list(flash(device, folder("firmware") / FIRMWARE, settings=settings))
    yield from (event for event in events if isinstance(event, FlashMessage))
    assert done is not None
    yield done
    yield Ask(OUT_AGAIN)


def _talk(device: str, baud: int) -> BaudChange:
    with Bootloader(device) as board:
        time.sleep(BOOT)
        board.read(0.0)  # what the restart itself has put on the line
        talk = set_baud(baud)
        command = next(talk)
        while True:
            heard = _answer(board, command)
            try:
                command = talk.send(heard)
            except StopIteration as end:
                rate: BaudChange = end.value
                return rate


def _answer(board: Bootloader, command: str) -> AtReply:
    """The lines of the answer; none when it did not end in time."""
    lines = AtReplyReader()
    board.write(f"{command}\r\n".encode("ascii"))
    until = time.monotonic() + ANSWER
    while (left := until - time.monotonic()) > 0:
        if lines.feed(board.read(left)):
            return lines.lines
    return []


def _no_answer(device: str, error: AtModeError) -> RunError:
    return RunError(
        Problem(
            "E-BLUETOOTH-AT",
            f"port {device}",
            f"the module is not in AT mode, or not an HC-05: {error}",
            "does its light blink slowly? Its TX leads to pin 19, its RX (through the two "
            "resistors) to pin 18. An HC-06 has no button and no such mode",
        )
    )
