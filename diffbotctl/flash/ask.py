"""Who is behind a port: asked as a run would ask, and nothing moved."""

from __future__ import annotations

from collections.abc import Iterator

from diffbotctl.drivers.port import gone, opened
from diffbotctl.flash.events import Said
from diffbotctl.flash.visit import Visit
from diffbotctl.links.diffbot import DiffbotHost


def ask(device: str, host: DiffbotHost) -> Iterator[Said]:
    """Meet the board on `device`; what it says of itself. Opening a USB port resets its board.

    Raises RunError: what opening the port has to say, or who else answers, or that nobody does.
    """
    port = opened(device, host.baud)
    try:
        yield from Visit(port, host).meet()
    except OSError as error:
        raise gone(device, error) from error
    finally:
        port.close()
