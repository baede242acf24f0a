"""The watchdog of one board, driver side: reports to its process, and returns what that did."""

from __future__ import annotations

from diffbotctl.drivers.watchdog_process import WatchdogProcess, watchdog_lost
from diffbotctl.links.rosserial_host import RosserialHost
from diffbotctl.links.rosserial_stop import WRITTEN_BYTES_MAX
from diffbotctl.messages import Stop
from diffbotctl.time import SECOND


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
        """The channel from the process."""
        return [] if self.process.lost else [self.process.channel.fileno()]

    def report(self, now: int, data: bytes) -> None:
        """Send a heartbeat, before `data` is written."""
        is_moving = self.host.may_move(now)
        self.process.report(self.host.stop_order(), is_moving, self.written + data)

    def wrote(self, data: bytes) -> None:
        """Note what was written."""
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
