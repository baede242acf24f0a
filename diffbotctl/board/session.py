"""A visit to a board with our firmware, outside of any run: meet it, have it do things, leave.

Who is behind a port: asked as a run would ask, and nothing moved.

Does the board behind a port run our firmware?
"""

from __future__ import annotations

import select
import time
from collections.abc import Iterator
from typing import TYPE_CHECKING

from diffbotctl.board.progress import FlashMessage
from diffbotctl.drivers.robot_link import diffbot_host
from diffbotctl.drivers.serial_port import OpenPort, disconnected_error, open_port
from diffbotctl.errors import Problem, RunError
from diffbotctl.links.diffbot_host import DiffbotHost, HostState
from diffbotctl.messages import Text
from diffbotctl.time import SECOND

if TYPE_CHECKING:
    from diffbotctl.config.robot import Robot

LOOK = 0.05  # s between two looks at a silent port


class BoardVisit:
    """One board behind an open port, which stays its owner's to close."""

    def __init__(self, port: OpenPort, host: DiffbotHost) -> None:
        self.port, self.host = port, host
        self._start = time.monotonic_ns()
        self._unsent = b""
        host.opened(0)

    @property
    def now(self) -> int:
        """ns since the visit began."""
        return time.monotonic_ns() - self._start

    def meet(self) -> Iterator[FlashMessage]:
        """Until the board is ready to drive. Raises RunError when it cannot be driven, OSError."""
        while self.host.state is not HostState.UP:
            refusal = self.host.refusal
            if refusal is not None:
                place = f"port {self.port.device}"
                raise RunError(Problem(refusal.code, place, refusal.cause, refusal.fix))
            yield from self._turn(LOOK)

    def stay(self, seconds: float) -> Iterator[FlashMessage]:
        """Talk on for so long. Raises OSError."""
        until = self.now + round(seconds * SECOND)
        while (left := until - self.now) > 0:
            yield from self._turn(min(LOOK, left / SECOND))

    def _turn(self, wait: float) -> Iterator[FlashMessage]:
        """Write what is due, wait for an answer, read it."""
        host = self.host
        if not self._unsent and host.due() <= self.now:
            self._unsent = host.send(self.now)
        self._unsent = self._unsent[self.port.write(self._unsent) :]
        wait = min(wait, max(host.due() - self.now, 0) / SECOND)
        select.select([self.port.fd], [], [], wait)
        data = self.port.read()
        for _port, heard in host.receive(self.now, data) + host.on_time(self.now):
            if isinstance(heard, Text):
                yield FlashMessage(heard.text)
        self.port.change_baud(host.baud)


def identify(device: str, host: DiffbotHost) -> Iterator[FlashMessage]:
    """Meet the board on `device`; what it says of itself. Opening a USB port resets its board.

    Raises RunError: what opening the port has to say, or who else answers, or that nobody does.
    """
    port = open_port(device, host.baud)
    try:
        yield from BoardVisit(port, host).meet()
    except OSError as error:
        raise disconnected_error(device, error) from error
    finally:
        port.close()


def is_diffbot(device: str, robot: Robot) -> bool:
    """Whether the board answers as our firmware does, and takes the robot's settings.

    Raises RunError when its port cannot be opened, or is gone.
    """
    host = diffbot_host(robot, device)
    port = open_port(device, host.baud)
    try:
        for _ in BoardVisit(port, host).meet():
            pass
    except RunError:
        return False
    except OSError as error:
        raise disconnected_error(device, error) from error
    finally:
        port.close()
    return True
