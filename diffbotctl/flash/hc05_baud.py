"""Change of the baud rate of an HC-05 through the board that it is wired to, and of the board's.

A small program that connects the USB port with the module's port is flashed first, and the firmware
afterwards, also after an error.
"""

from __future__ import annotations

import time
from collections.abc import Generator
from dataclasses import replace
from typing import NamedTuple

from diffbotctl.bluetooth.hc05_at import AtModeError, AtReply, AtReplyReader, BaudChange, set_baud
from diffbotctl.config.lookup import folder
from diffbotctl.errors import Problem, RunError
from diffbotctl.flash.board_session import BoardSession, JobEvent, JobMessage
from diffbotctl.flash.flasher import flash
from diffbotctl.links.diffbot_settings import BoardSettings
from diffbotctl.links.stk500_frames import BAUD

BRIDGE, FIRMWARE = "bridge_mega2560.hex", "diffbot_mega2560.hex"
BRIDGE_START_TIME_S = 1.5  # from opening the port until the bridge runs; earlier bytes delay it
REPLY_TIMEOUT_S = 0.6  # at 38400 baud one takes 10 ms
ATTEMPTS_MAX = 3  # at getting the module into AT mode
BUTTON = (
    "Now the module: disconnect its VCC wire. Hold its small button, reconnect VCC, and release "
    "the button after a second. Its light must blink slowly, once in two seconds: that is AT mode."
)
OUT_AGAIN = (
    "Disconnect the module's VCC and reconnect it, without the button: its light blinks fast."
)


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
    if settings.shares_usb:
        raise _no_second_port_error(device)
    yield JobMessage(
        "flashing a temporary program that connects the USB port with the module's port:"
    )
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
                yield JobMessage(f"no success: {error}; try again")
    finally:
        # In a `finally`: the firmware is restored also when the user gives up.
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
        session.read(0.0)  # bytes of the restart
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


def _no_second_port_error(device: str) -> RunError:
    return RunError(
        Problem(
            "E-BLUETOOTH-AT",
            f"port {device}",
            "an Uno or Nano has one serial port: it cannot connect the USB cable with the module",
            "keep the module at its rate and state it as link.baud; a USB-to-serial adapter, or a "
            "Mega 2560, can change it",
        )
    )


def _at_mode_error(device: str, error: AtModeError) -> RunError:
    return RunError(
        Problem(
            "E-BLUETOOTH-AT",
            f"port {device}",
            f"the module is not in AT mode, or not an HC-05: {error}",
            "check that its light blinks slowly, its TX is wired to pin 19, and its RX (through "
            "the two resistors) to pin 18; an HC-06 has no button and no such mode",
        )
    )
