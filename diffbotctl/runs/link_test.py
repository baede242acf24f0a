"""How good is a link: meet the board behind a port, and measure for a while. No motor moves."""

from __future__ import annotations

import select
import time
from collections.abc import Iterator

from diffbotctl.bluetooth.measure import Figures
from diffbotctl.bluetooth.meter import Meter
from diffbotctl.drivers.port import OpenPort, gone, opened
from diffbotctl.errors import Problem, RunError
from diffbotctl.flash.events import Said
from diffbotctl.flash.visit import Visit
from diffbotctl.links.diffbot import DiffbotHost

LOOK = 0.05  # s


def measure(device: str, host: DiffbotHost, seconds: float) -> Iterator[Said | Figures]:
    """What the board says of itself, then the figures. Raises RunError."""
    port = opened(device, host.baud)
    try:
        yield from Visit(port, host).meet()
        yield _listen(port, seconds)
    except OSError as error:
        raise gone(device, error) from error
    finally:
        port.close()


def _listen(port: OpenPort, seconds: float) -> Figures:
    meter = Meter(time.monotonic_ns())
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
