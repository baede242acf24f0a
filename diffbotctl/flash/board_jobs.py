"""Jobs at a board with our firmware, outside of any run: identify, blink, measure. No motor moves.

Opening a USB port resets its board.
"""

from __future__ import annotations

import time
from collections.abc import Iterator
from typing import TYPE_CHECKING

from diffbotctl.bluetooth.link_stats import LinkFigures, LinkProbe
from diffbotctl.drivers.robot_link import diffbot_host
from diffbotctl.errors import Problem, RunError
from diffbotctl.flash.board_session import POLL_PERIOD_S, BoardSession, JobMessage
from diffbotctl.links.diffbot_frames import BoardCode
from diffbotctl.links.diffbot_host import DiffbotHost
from diffbotctl.time import SECOND

if TYPE_CHECKING:
    from diffbotctl.config.robot import Robot

BLINK_HALF_PERIOD_S = 0.5
LIGHT_OFF, LIGHT_TOGGLE = 0, 2  # of the action `light`


def identify(device: str, host: DiffbotHost) -> Iterator[JobMessage]:
    """Connect to the board on `device`; yields its texts, among them its description.

    Raises RunError: the port cannot be opened, something else answers, or nothing does.
    """
    with BoardSession(device, host.baud) as session:
        yield from session.connect(host)


def is_diffbot(device: str, robot: Robot) -> bool:
    """Whether the board answers as our firmware does, and takes the robot's settings.

    Raises RunError when its port cannot be opened, or is gone.
    """
    host = diffbot_host(robot, device)
    with BoardSession(device, host.baud) as session:
        try:
            for _ in session.connect(host):
                pass
        except RunError:
            return False
    return True


def blink(device: str, host: DiffbotHost, times: int) -> Iterator[JobMessage]:
    """Connect to the board on `device` and blink its light `times` times.

    Raises RunError: the port cannot be opened, or the board cannot be driven.
    """
    with BoardSession(device, host.baud) as session:
        yield from session.connect(host)
        is_pico = host.settings.board is BoardCode.RP2040
        light = "the light beside the USB socket" if is_pico else "the light L beside pin 13"
        yield JobMessage(f"{light} now blinks {times} times")
        for _ in range(2 * times):
            host.light(LIGHT_TOGGLE)
            yield from session.run_for(host, BLINK_HALF_PERIOD_S)
        host.light(LIGHT_OFF)
        yield from session.run_for(host, BLINK_HALF_PERIOD_S)
        link = host.link(0)
        yield JobMessage(
            f"the link: {host.rate:.0f} frames a second, {link.damaged} damaged, {link.lost} lost, "
            f"answers after {link.latency * 1000:.0f} ms"
        )
        yield JobMessage("if it blinked, board, cable and port work")


def measure_link(
    device: str, host: DiffbotHost, seconds: float
) -> Iterator[JobMessage | LinkFigures]:
    """Connect to the board and measure for `seconds`: its texts, then the figures.

    Raises RunError.
    """
    with BoardSession(device, host.baud) as session:
        yield from session.connect(host)
        yield _probe_link(session, seconds)


def _probe_link(session: BoardSession, seconds: float) -> LinkFigures:
    probe = LinkProbe(time.monotonic_ns())
    end = time.monotonic() + seconds
    while time.monotonic() < end:
        session.write(probe.send(time.monotonic_ns()))
        data = session.read(min((probe.due() - time.monotonic_ns()) / SECOND, POLL_PERIOD_S))
        probe.receive(time.monotonic_ns(), data)
    try:
        return probe.figures()
    except ValueError as error:
        fix = "measure longer and at a shorter distance; `diffbotctl blink` checks the board"
        problem = Problem("E-PORT-SILENT", f"port {session.device}", str(error), fix)
        raise RunError(problem) from error
