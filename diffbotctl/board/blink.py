"""The 60-second check of a board: the link is made, and the board's light goes on and off."""

from __future__ import annotations

from collections.abc import Iterator

from diffbotctl.board.progress import FlashMessage
from diffbotctl.board.session import BoardVisit
from diffbotctl.drivers.serial_port import disconnected_error, open_port
from diffbotctl.links.diffbot_host import DiffbotHost

HALF = 0.5  # s the light is on, and off
OFF, FLIP = 0, 2  # of the action `light`


def blink(device: str, host: DiffbotHost, times: int) -> Iterator[FlashMessage]:
    """Meet the board on `device` and blink its light so many times. No motor moves.

    Raises RunError: what opening the port has to say, or why the board cannot be spoken to.
    """
    port = open_port(device, host.baud)
    try:
        visit = BoardVisit(port, host)
        yield from visit.meet()
        yield FlashMessage(f"its light, L beside pin 13, now blinks {times} times")
        for _ in range(2 * times):
            host.light(FLIP)
            yield from visit.stay(HALF)
        host.light(OFF)
        yield from visit.stay(HALF)
        yield FlashMessage(f"the link: {_figures(host)}")
        yield FlashMessage("if you saw it blink, board, cable and port are right")
    except OSError as error:
        raise disconnected_error(device, error) from error
    finally:
        port.close()


def _figures(host: DiffbotHost) -> str:
    link = host.link(0)
    return (
        f"{host.rate:.0f} frames a second, {link.damaged} damaged, {link.lost} lost, "
        f"answers after {link.latency * 1000:.0f} ms"
    )
