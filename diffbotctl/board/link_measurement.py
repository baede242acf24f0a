"""How good is a link: meet the board behind a port, and measure for a while. No motor moves."""

from __future__ import annotations

import select
import time
from collections.abc import Iterator

from diffbotctl.bluetooth.link_stats import LinkFigures, LinkProbe
from diffbotctl.board.progress import FlashMessage
from diffbotctl.board.session import BoardVisit
from diffbotctl.drivers.serial_port import OpenPort, disconnected_error, open_port
from diffbotctl.errors import Problem, RunError
from diffbotctl.links.diffbot_host import DiffbotHost

LOOK = 0.05  # s


def measure_link(
    device: str, host: DiffbotHost, seconds: float
) -> Iterator[FlashMessage | LinkFigures]:
    """What the board says of itself, then the figures. Raises RunError."""
    port = open_port(device, host.baud)
    try:
        yield from BoardVisit(port, host).meet()
        yield _listen(port, seconds)
    except OSError as error:
        raise disconnected_error(device, error) from error
    finally:
        port.close()


def _listen(port: OpenPort, seconds: float) -> LinkFigures:
    meter = LinkProbe(time.monotonic_ns())
    until = time.monotonic() + seconds
    while time.monotonic() < until:
        port.write(meter.send(time.monotonic_ns()))
        wait = min(max(meter.due() - time.monotonic_ns(), 0) / 1e9, LOOK)
        select.select([port.fd], [], [], wait)
        meter.receive(time.monotonic_ns(), port.read())
    try:
        return meter.figures()
    except ValueError as error:
        fix = "measure for longer, and nearer; `diffbotctl blink` tells whether the board answers"
        problem = Problem("E-PORT-SILENT", f"port {port.device}", str(error), fix)
        raise RunError(problem) from error
