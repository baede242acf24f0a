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
from diffbotctl.board.session import BoardSession, JobEvent, JobMessage
from diffbotctl.config.lookup import folder
from diffbotctl.errors import Problem, RunError
from diffbotctl.flash.flasher import flash
from diffbotctl.links.diffbot_settings import BoardSettings
from diffbotctl.links.stk500_frames import BAUD

BRIDGE, FIRMWARE = "bridge_mega2560.hex", "diffbot_mega2560.hex"
BRIDGE_START_TIME_S = (
    1.5  # from opening the port until the bridge runs: what comes earlier holds it up
)
REPLY_TIMEOUT_S = 0.6  # at 38400 baud one takes 10 ms
ATTEMPTS_MAX = 3  # at getting the module into AT mode
BUTTON = """\
Now the module: pull its VCC wire out. Hold its small button down, put VCC back, and let go after
a second. Its light must blink slowly, once in two seconds: that is AT mode."""
OUT_AGAIN = "Pull the module's VCC out and put it back, without the button: its light blinks fast."


class ManualStep(NamedTuple):
    """The user has something to do; the job goes on when it is done."""

    text: str


def change_rate(
    device: str, settings: BoardSettings, baud: int
) -> Generator[JobEvent | ManualStep | BaudChange, None, None]:
    """Set the module on the board behind the USB port `device` to `baud`, and the board too.

    Yields ManualStep wherever the user must act. Raises RunError; the firmware is back on the board
    then, unless the cable was pulled.
    """
    yield JobMessage("a program that joins the USB port to the module's port, for a while:")
    yield from flash(device, folder("firmware") / BRIDGE)
    change: BaudChange | None = None
    try:
        for attempt in range(ATTEMPTS_MAX):
            yield ManualStep(BUTTON)
            try:
                change = _set_module_baud(device, baud)
                break
            except AtModeError as error:
                if attempt == ATTEMPTS_MAX - 1:
                    raise _at_mode_error(device, error) from error
                yield JobMessage(f"No: {error}. Once more.")
    finally:
        # In a `finally`, since a person who gives up must not be left with the bridge.
        settings = replace(settings, baud=change.now if change else settings.baud)
        events = list(flash(device, folder("firmware") / FIRMWARE, settings=settings))
    yield from (event for event in events if isinstance(event, JobMessage))
    assert change is not None
    yield change
    yield ManualStep(OUT_AGAIN)


def _set_module_baud(device: str, baud: int) -> BaudChange:
    with BoardSession(device, BAUD) as session:
        session.reset()
        time.sleep(BRIDGE_START_TIME_S)
        session.read(0.0)  # what the restart itself has put on the line
        dialogue = set_baud(baud)
        command = next(dialogue)
        while True:
            reply = _reply(session, command)
            try:
                command = dialogue.send(reply)
            except StopIteration as end:
                change: BaudChange = end.value
                return change


def _reply(session: BoardSession, command: str) -> AtReply:
    """The lines of the reply; none when it did not end in time."""
    reader = AtReplyReader()
    session.write(f"{command}\r\n".encode("ascii"))
    end = time.monotonic() + REPLY_TIMEOUT_S
    while (remaining := end - time.monotonic()) > 0:
        if reader.feed(session.read(remaining)):
            return reader.lines
    return []


def _at_mode_error(device: str, error: AtModeError) -> RunError:
    return RunError(
        Problem(
            "E-BLUETOOTH-AT",
            f"port {device}",
            f"the module is not in AT mode, or not an HC-05: {error}",
            "does its light blink slowly? Its TX leads to pin 19, its RX (through the two "
            "resistors) to pin 18. An HC-06 has no button and no such mode",
        )
    )
