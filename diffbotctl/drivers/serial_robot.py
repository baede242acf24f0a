"""The robot behind a serial port: bytes of the port to the protocol, and its bytes to the port."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

from diffbotctl.config.robot import Robot
from diffbotctl.drivers.robot_link import diffbot_host, rosserial_host
from diffbotctl.drivers.serial_port import OpenPort, open_port, reopen_port
from diffbotctl.drivers.watchdog_process import WatchdogProcess
from diffbotctl.engine.driver import Delivery
from diffbotctl.errors import Problem, RunError
from diffbotctl.links.link_protocol import LinkProtocol
from diffbotctl.messages import Duty, Message, Wheels
from diffbotctl.time import MILLISECOND, NEVER

FIRST_RETRY = 200 * MILLISECOND  # a replugged board needs about this long to appear
# A board's times repeat every 2.1 s, so what waited for half of that may be taken for later than it
# is: after a person was asked, after a laptop slept, what has piled up tells nothing any more.
BACKLOG = 64  # reads of up to 4 kB
OUTDATED = 1_000 * MILLISECOND
LONGEST_RETRY = 2_000 * MILLISECOND
NO_DEADMAN = """\
Note: this board cannot stop by itself when the host falls silent. A guardian process
does it if diffbotctl dies; nothing can if the cable or the radio fails."""


def open_serial_robot(
    robot: Robot, device: str, tell: Callable[[str], None], now: int = 0
) -> SerialRobot:
    """Open `device` at `now` (ns) and drive `robot` through it. Raises RunError.

    A watchdog process replaces the dead-man's stop that the book's firmware lacks.
    """
    if robot.link.protocol != "rosserial":
        host = diffbot_host(robot, device)
        driver = SerialRobot(host, lambda: reopen_port(device, host.baud))
        driver.adopt(now, open_port(device, host.baud))
        return driver
    watchdog = WatchdogProcess()
    try:
        port = open_port(device, robot.link.baud)
    except RunError:
        watchdog.dismiss()
        raise
    tell(NO_DEADMAN)
    driver = SerialRobot(
        rosserial_host(robot), partial(reopen_port, device, robot.link.baud), watchdog
    )
    driver.adopt(now, port)
    return driver


class SerialRobot:
    """A driver. Reopens a port that vanished, with growing pauses; a stop comes first after it.

    `open_port` raises OSError while the device is away. The guardian, if there is one, is handed
    each newly opened port and the frames that stop the board.
    """

    def __init__(
        self,
        protocol: LinkProtocol,
        open_port: Callable[[], OpenPort],
        guardian: WatchdogProcess | None = None,
    ) -> None:
        self.protocol = protocol
        self.open_port = open_port
        self.guardian = guardian
        self.port: OpenPort | None = None
        self.retry_at = 0
        self.retry_pause = FIRST_RETRY
        self.unsent = b""
        self.gave_up = False
        self.heard_at = 0

    def due(self) -> int:
        """The protocol's next wish, or the next try to open the port."""
        if self.protocol.refusal is not None and not self.gave_up:
            return 0
        return self.retry_at if self.port is None else self.protocol.due()

    def files(self) -> list[int]:
        """The port while it is open."""
        return [] if self.port is None else [self.port.fd]

    def deliver(self, now: int) -> list[Delivery]:
        """Read, let time speak, write what is due.

        Raises RunError, once, when the port leads to no board that can be driven; a stop can still
        be sent after it.
        """
        if self.port is None:
            return self._reopen(now)
        self._give_up(self.port)
        unheard, self.heard_at = now - self.heard_at, now
        try:
            if unheard > OUTDATED:
                _discard(self.port)
            data = self.port.read()
            heard = self.protocol.receive(now, data) if data else []
            heard += self.protocol.on_time(now)
            self.port.change_baud(self.protocol.baud)
            self._write(now)
            if self.guardian is not None:
                self.guardian.arm(self.protocol.stop_frame())
        except OSError as error:
            return self._lost(now, error)
        return _addressed(heard)

    def command(self, now: int, wanted: Wheels | Duty) -> None:
        """Hand the command to the protocol and send it at once if the wire is free."""
        self.protocol.command(now, wanted)
        self._write_or_lose(now)

    def stop(self, now: int) -> None:
        """Discard what waits here and in the kernel, then stop, again and again."""
        self.unsent = b""
        if self.port is not None:
            self.port.discard_unsent()
        self.protocol.stop(now)
        self._write_or_lose(now)

    @property
    def stopped(self) -> bool:
        """True when the board's telemetry shows it."""
        return self.protocol.stopped

    def close(self) -> None:
        """Close the port. The robot has been stopped, or cannot be reached: no guardian either."""
        if self.guardian is not None:
            self.guardian.dismiss()
        if self.port is not None:
            self.port.close()

    def _give_up(self, port: OpenPort) -> None:
        refusal = self.protocol.refusal
        if refusal is not None and not self.gave_up:
            self.gave_up = True
            raise RunError(Problem(refusal.code, f"port {port.device}", refusal.cause, refusal.fix))

    def _write_or_lose(self, now: int) -> None:
        try:
            self._write(now)
        except OSError:
            self.retry_at = now  # `deliver` meets the same error and reports it

    def _write(self, now: int) -> None:
        if self.port is None:
            return
        if not self.unsent and self.protocol.due() <= now:
            self.unsent = self.protocol.send(now)
        if self.unsent:
            self.unsent = self.unsent[self.port.write(self.unsent) :]

    def _lost(self, now: int, error: OSError) -> list[Delivery]:
        cause = error.strerror or str(error)
        if self.port is not None:
            self.port.close()
        self.port, self.unsent = None, b""
        self.retry_at, self.retry_pause = now + FIRST_RETRY, FIRST_RETRY
        return _addressed(self.protocol.closed(now, cause))

    def _reopen(self, now: int) -> list[Delivery]:
        if now < self.retry_at:
            return []
        try:
            port = self.open_port()
        except (OSError, RunError):
            self.retry_pause = min(2 * self.retry_pause, LONGEST_RETRY)
            self.retry_at = now + self.retry_pause
            return []
        self.adopt(now, port)
        return []

    def adopt(self, now: int, port: OpenPort) -> None:
        """Use an open port: negotiate anew, and make a stop the first command on it."""
        self.port, self.unsent, self.heard_at = port, b"", now
        self.protocol.opened(now)
        self.protocol.stop(now)
        self.retry_at = NEVER
        if self.guardian is not None:
            self.guardian.watch(port.fd)
        self._write_or_lose(now)


def _discard(port: OpenPort) -> None:
    """Read away what waits; at most what the kernel may have kept."""
    for _ in range(BACKLOG):
        if not port.read():
            return


def _addressed(heard: list[tuple[str, Message]]) -> list[Delivery]:
    return [Delivery(f"robot.{port}", message) for port, message in heard]
