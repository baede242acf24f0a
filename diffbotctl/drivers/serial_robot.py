"""The robot behind a serial port: moves bytes between the port and the link protocol."""

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

RETRY_PERIOD_MIN = 200 * MILLISECOND  # a replugged board needs about this long to appear
RETRY_PERIOD_MAX = 2_000 * MILLISECOND
# A board's 16-bit times wrap around every 2.1 s, so bytes that waited for half of that cannot be
# dated any more (after a prompt to the user, after a suspended laptop): they are discarded.
INPUT_AGE_MAX = 1_000 * MILLISECOND
DISCARD_READS_MAX = 64  # reads of up to 4 kB
NO_DEADMAN = """\
Note: this board does not stop by itself when the host falls silent. A watchdog process
stops it if diffbotctl is killed; nothing can stop it if the cable or the radio fails."""


def open_serial_robot(
    robot: Robot, device: str, tell: Callable[[str], None], now: int = 0
) -> SerialRobot:
    """Open `device` at `now` (ns) and drive `robot` through it. Raises RunError.

    A watchdog process replaces the dead-man's stop that the book's firmware lacks.
    """
    if robot.link.protocol != "rosserial":
        host = diffbot_host(robot, device)
        driver = SerialRobot(host, lambda: reopen_port(device, host.baud))
        driver.use_port(now, open_port(device, host.baud))
        return driver
    watchdog = WatchdogProcess()
    try:
        port = open_port(device, robot.link.baud)
    except RunError:
        watchdog.exit()
        raise
    tell(NO_DEADMAN)
    driver = SerialRobot(
        rosserial_host(robot), partial(reopen_port, device, robot.link.baud), watchdog
    )
    driver.use_port(now, port)
    return driver


class SerialRobot:
    """A driver that reopens a port that vanished, with growing pauses, and then stops the robot.

    `reopen` raises OSError while the device is away. The watchdog, if there is one, gets each newly
    opened port and the frames that stop the board.
    """

    def __init__(
        self,
        protocol: LinkProtocol,
        reopen: Callable[[], OpenPort],
        watchdog: WatchdogProcess | None = None,
    ) -> None:
        self.protocol = protocol
        self.reopen = reopen
        self.watchdog = watchdog
        self.port: OpenPort | None = None
        self.retry_at = 0
        self.retry_period = RETRY_PERIOD_MIN
        self.unsent = b""
        self.refusal_raised = False
        self.last_read = 0

    def due(self) -> int:
        """When the protocol next needs a call, or the next attempt to open the port."""
        if self.protocol.refusal is not None and not self.refusal_raised:
            return 0
        return self.retry_at if self.port is None else self.protocol.due()

    def files(self) -> list[int]:
        """The port while it is open."""
        return [] if self.port is None else [self.port.fd]

    def deliver(self, now: int) -> list[Delivery]:
        """Read, update timeouts, write what is due.

        Raises RunError, once, when the port leads to no board that can be driven; the robot can
        still be stopped after it.
        """
        if self.port is None:
            self._try_reopen(now)
            return []
        self._raise_refusal(self.port)
        age, self.last_read = now - self.last_read, now
        try:
            if age > INPUT_AGE_MAX:
                _discard_input(self.port)
            data = self.port.read()
            messages = self.protocol.receive(now, data) if data else []
            messages += self.protocol.on_time(now)
            self.port.change_baud(self.protocol.baud)
            self._write(now)
            if self.watchdog is not None:
                self.watchdog.set_stop_frame(self.protocol.stop_frame())
        except OSError as error:
            return self._disconnect(now, error)
        return _as_deliveries(messages)

    def command(self, now: int, command: Wheels | Duty) -> None:
        """Pass the command to the protocol, and send it at once if the line is free."""
        self.protocol.command(now, command)
        self._write_or_retry(now)

    def stop(self, now: int) -> None:
        """Discard unsent bytes here and in the kernel, then stop, repeatedly."""
        self.unsent = b""
        if self.port is not None:
            self.port.discard_unsent()
        self.protocol.stop(now)
        self._write_or_retry(now)

    @property
    def stopped(self) -> bool:
        """True when the board's telemetry shows it."""
        return self.protocol.stopped

    def close(self) -> None:
        """End the watchdog and close the port: the robot has been stopped, or is out of reach."""
        if self.watchdog is not None:
            self.watchdog.exit()
        if self.port is not None:
            self.port.close()

    def use_port(self, now: int, port: OpenPort) -> None:
        """Use an open port: negotiate again, with a stop as the first command."""
        self.port, self.unsent, self.last_read = port, b"", now
        self.protocol.opened(now)
        self.protocol.stop(now)
        self.retry_at = NEVER
        if self.watchdog is not None:
            self.watchdog.set_port(port.fd)
        self._write_or_retry(now)

    def _raise_refusal(self, port: OpenPort) -> None:
        refusal = self.protocol.refusal
        if refusal is not None and not self.refusal_raised:
            self.refusal_raised = True
            raise RunError(Problem(refusal.code, f"port {port.device}", refusal.cause, refusal.fix))

    def _write_or_retry(self, now: int) -> None:
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

    def _disconnect(self, now: int, error: OSError) -> list[Delivery]:
        if self.port is not None:
            self.port.close()
        self.port, self.unsent = None, b""
        self.retry_at, self.retry_period = now + RETRY_PERIOD_MIN, RETRY_PERIOD_MIN
        return _as_deliveries(self.protocol.closed(now, error.strerror or str(error)))

    def _try_reopen(self, now: int) -> None:
        if now < self.retry_at:
            return
        try:
            port = self.reopen()
        except (OSError, RunError):
            self.retry_period = min(2 * self.retry_period, RETRY_PERIOD_MAX)
            self.retry_at = now + self.retry_period
        else:
            self.use_port(now, port)


def _discard_input(port: OpenPort) -> None:
    """Discard what waits in the kernel's buffer."""
    for _ in range(DISCARD_READS_MAX):
        if not port.read():
            return


def _as_deliveries(messages: list[tuple[str, Message]]) -> list[Delivery]:
    return [Delivery(f"robot.{port}", message) for port, message in messages]
