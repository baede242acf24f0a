"""The 60-second check of a board: the link is made, and the board's light goes on and off."""

from __future__ import annotations

import select
import time
from collections.abc import Iterator

from diffbotctl.drivers.port import Port
from diffbotctl.errors import Problem, RunError
from diffbotctl.flash.job import Said
from diffbotctl.links.diffbot import UP, DiffbotHost
from diffbotctl.messages import Text

SECOND = 1_000_000_000
MEET = 8 * SECOND  # ns until the board must have answered: bootloader, three tries, settings
HALF = SECOND // 2  # ns the light is on, and off
LOOK = 0.05  # s between two looks at the port when it is silent
FLIP = 2  # of the action `light`


def blink(device: str, host: DiffbotHost, times: int) -> Iterator[Said]:
    """Meet the board on `device` and blink its light so many times. No motor moves.

    Raises RunError: what opening the port has to say, or why the board cannot be spoken to.
    """
    try:
        port = Port(device, host.baud)
    except OSError as error:
        raise _deaf(device, error.strerror or str(error)) from error
    try:
        start = time.monotonic_ns()
        host.opened(0)
        yield from _meet(port, host, start)
        yield Said(f"its light, L beside pin 13, now blinks {times} times")
        for _ in range(2 * times):
            now = time.monotonic_ns() - start
            host.light(now, FLIP)
            yield from _talk(port, host, start, now + HALF)
        yield Said("if you saw it, board, cable and port are right")
    except OSError as error:
        raise _deaf(device, error.strerror or str(error)) from error
    finally:
        port.close()


def _meet(port: Port, host: DiffbotHost, start: int) -> Iterator[Said]:
    while host.state != UP:
        now = time.monotonic_ns() - start
        if now > MEET:
            raise _deaf(port.device, host.cause or "nothing answers")
        yield from _talk(port, host, start, now)


def _talk(port: Port, host: DiffbotHost, start: int, until: int) -> Iterator[Said]:
    """Read and write until then; at least once."""
    while True:
        now = time.monotonic_ns() - start
        if host.due() <= now:
            port.write(host.send(now))
        port.change_baud(host.baud)
        for _, heard in host.receive(now, port.read()) + host.timed(now):
            if isinstance(heard, Text):
                yield Said(heard.text)
        if now >= until:
            return
        rest = min(LOOK, max(host.due() - now, 0) * 1e-9)
        select.select([port.fd], [], [], rest)


def _deaf(device: str, cause: str) -> RunError:
    fix = "press the board's reset button; `diffbotctl flash firmware` puts our program on it"
    return RunError(Problem("E-PORT-SILENT", f"port {device}", cause, fix))
