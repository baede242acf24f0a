"""The robot behind a serial port: moves bytes between the port and the link protocol."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

from diffbotctl.config.checks.calibration import simulated_fields
from diffbotctl.config.robot import Robot
from diffbotctl.drivers.robot_link import diffbot_host, rosserial_host
from diffbotctl.drivers.robot_ports import is_simulated_port
from diffbotctl.drivers.serial_port import OpenPort, open_port, reopen_port
from diffbotctl.drivers.watchdog_process import WatchdogProcess, watchdog_lost
from diffbotctl.engine.driver import Delivery
from diffbotctl.errors import ConfigurationError, Problem, RunError
from diffbotctl.links.link_protocol import LinkProtocol
from diffbotctl.links.rosserial_host import RosserialHost
from diffbotctl.links.rosserial_stop import WRITTEN_BYTES_MAX
from diffbotctl.messages import Duty, Message, Stop, Wheels
from diffbotctl.time import MILLISECOND, NEVER, SECOND


class BoardWatchdog:
    """Connects a WatchdogProcess to the host side of the board that it watches.

    Without the process nothing stops this board when the host hangs: its loss ends the run.
    """

    def __init__(self, process: WatchdogProcess, host: RosserialHost) -> None:
        self.process = process
        self.host = host
        self.written = b""  # the last bytes to the board
        self.loss_raised = False

    def use_port(self, fd: int) -> None:
        """Hand over a newly opened port."""
        self.written = b""
        self.process.set_port(fd)

    def port_closed(self) -> None:
        """The port is gone: without it there are no heartbeats, and nothing that could be stopped.

        Otherwise the process would take the missing heartbeats for an engine that does not run.
        """
        self.process.report(None, False, b"")

    def files(self) -> list[int]:
        return [] if self.process.lost else [self.process.channel.fileno()]

    def report(self, now: int, data: bytes) -> None:
        """Send a heartbeat, before `data` is written."""
        is_moving = self.host.may_move(now)
        self.process.report(self.host.stop_order(), is_moving, self.written + data)

    def wrote(self, data: bytes) -> None:
        self.written = (self.written + data)[-WRITTEN_BYTES_MAX:]

    def holds(self) -> bool:
        """Whether only zeros may be sent: the process has intervened, or is lost."""
        self.process.poll()
        return self.process.intervened or bool(self.process.lost)

    def has_news(self) -> bool:
        """Whether `take` has to be called at once."""
        return self.process.intervened or (bool(self.process.lost) and not self.loss_raised)

    def take(self, now: int) -> Stop | None:
        """The stop for an intervention, which ends here: the driver has stopped the robot.

        Raises RunError, once, when the process is lost.
        """
        process = self.process
        if process.lost and not self.loss_raised:
            self.loss_raised = True
            raise watchdog_lost(process.lost)
        if not process.intervened:
            return None
        process.release()
        cause = (
            f"diffbotctl did not run for {process.gap / SECOND:.2f} s while the robot drove: it "
            "was suspended, or the computer was overloaded; the watchdog process stopped the robot"
        )
        return Stop(now, "host_frozen", cause, True)

    def close(self) -> None:
        """End the process without a stop."""
        self.process.exit()


RETRY_PERIOD_MIN = 200 * MILLISECOND  # a replugged board needs about this long to appear
RETRY_PERIOD_MAX = 2_000 * MILLISECOND
# A board's 16-bit times wrap around every 2.1 s, so bytes that waited for half of that cannot be
# dated any more (after a prompt to the user, after a suspended laptop): they are discarded.
INPUT_AGE_MAX = 1_000 * MILLISECOND
DISCARD_READS_MAX = 64  # reads of up to 4 kB
NO_DEADMAN = (
    "WARNING: the book's firmware has no dead-man: this robot drives on with its last command "
    "when the cable or the radio fails, or when the computer crashes, sleeps or is switched off, "
    "and nothing can stop it then but its own switch. Only if diffbotctl hangs or is killed does "
    "a watchdog process stop it. `diffbotctl flash firmware` installs a firmware that stops."
)


def open_serial_robot(
    robot: Robot,
    device: str,
    tell: Callable[[str], None],
    now: int = 0,
    is_upward_checked: bool = True,
) -> SerialRobot:
    """Open `device` at `now` (ns) and drive `robot` through it. Raises RunError.

    `is_upward_checked`: the board compares the stated axis of the IMU with gravity.
    A watchdog process replaces the dead-man's stop that the book's firmware lacks. Raises
    ConfigurationError for a robot with results of a simulated one.
    """
    marked = simulated_fields(robot)
    if marked and not is_simulated_port(device):
        place, fix = f"calibration: {marked[0]}", "use the robot's own file"
        cause = "it was measured on a simulated robot"
        raise ConfigurationError(Problem("E-CALIBRATION-SIMULATED", place, cause, fix))
    if robot.link.protocol != "rosserial":
        host = diffbot_host(robot, device, is_upward_checked)
        driver = SerialRobot(host, lambda: reopen_port(device, host.baud))
        driver.use_port(now, open_port(device, host.baud))
        return driver
    stock_host, process = rosserial_host(robot), WatchdogProcess()
    try:
        port = open_port(device, robot.link.baud)
    except RunError:
        process.exit()
        raise
    tell(NO_DEADMAN)
    driver = SerialRobot(
        stock_host,
        partial(reopen_port, device, robot.link.baud),
        BoardWatchdog(process, stock_host),
    )
    driver.use_port(now, port)
    return driver


class SerialRobot:
    """A driver that reopens a port that vanished, with growing pauses, and then stops the robot.

    `reopen` raises OSError while the device is away. The watchdog, if there is one, gets each newly
    opened port; after it has stopped the robot, the driver delivers a latched Stop.
    """

    def __init__(
        self,
        protocol: LinkProtocol,
        reopen: Callable[[], OpenPort],
        watchdog: BoardWatchdog | None = None,
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
        if self.watchdog is not None and self.watchdog.has_news():
            return 0
        return self.retry_at if self.port is None else self.protocol.due()

    def files(self) -> list[int]:
        """The port while it is open, and the channel from the watchdog."""
        files = [] if self.port is None else [self.port.fd]
        return files if self.watchdog is None else files + self.watchdog.files()

    def deliver(self, now: int) -> list[Delivery]:
        """Read, update timeouts, write what is due.

        Raises RunError, once, when the port leads to no board that can be driven, or when the
        watchdog is lost; the robot can still be stopped after it.
        """
        deliveries = self._check_watchdog(now)
        if self.port is None:
            self._try_reopen(now)
            return deliveries
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
        except OSError as error:
            return deliveries + self._disconnect(now, error)
        return deliveries + _as_deliveries(messages)

    def command(self, now: int, command: Wheels | Duty) -> None:
        """Pass the command to the protocol, and send it at once if the line is free.

        While the watchdog stops the robot, nothing but zero is sent.
        """
        if self.watchdog is not None and self.watchdog.holds():
            command = Duty(now, 0.0, 0.0)
            self.unsent = b""
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
            self.watchdog.close()
        if self.port is not None:
            self.port.close()

    def use_port(self, now: int, port: OpenPort) -> None:
        """Use an open port: negotiate again, with a stop as the first command."""
        self.port, self.unsent, self.last_read = port, b"", now
        self.protocol.opened(now)
        self.protocol.stop(now)
        self.retry_at = NEVER
        if self.watchdog is not None:
            self.watchdog.use_port(port.fd)
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
        if self.watchdog is not None:
            self.watchdog.report(now, self.unsent)
            if self._has_intervened():
                self.unsent = b""  # of a motion, computed before the process was suspended
                return
        if self.unsent:
            size = self.port.write(self.unsent)
            if self.watchdog is not None:
                self.watchdog.wrote(self.unsent[:size])
            self.unsent = self.unsent[size:]

    def _has_intervened(self) -> bool:
        """Whether the watchdog has an intervention that `deliver` has not taken yet."""
        watchdog = self.watchdog
        return watchdog is not None and watchdog.holds() and watchdog.has_news()

    def _check_watchdog(self, now: int) -> list[Delivery]:
        """The stop for an intervention of the watchdog; the robot's target is zero afterwards."""
        if self.watchdog is None or not self._has_intervened():
            return []
        self.unsent = b""
        self.protocol.stop(now)
        stop = self.watchdog.take(now)
        return [] if stop is None else [Delivery("robot.stop", stop)]

    def _disconnect(self, now: int, error: OSError) -> list[Delivery]:
        if self.port is not None:
            self.port.close()
        self.port, self.unsent = None, b""
        if self.watchdog is not None:
            self.watchdog.port_closed()
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
