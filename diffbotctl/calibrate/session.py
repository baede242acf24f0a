"""The robot under calibration: driven directly, without blocks, and stopped by any trouble.

A command is repeated while it is active, so that the dead-man's timer of the board never expires
meanwhile and always does when this program dies. A key, a silent link, a board that stops by
itself, or a wheel beyond the announced limit end the step and stop the robot.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any, NamedTuple, Protocol, TypeVar, runtime_checkable

from diffbotctl.calibrate.result import Finding
from diffbotctl.calibrate.robot_file import with_findings
from diffbotctl.config.configuration import RobotFile
from diffbotctl.config.robot import Robot, SideSection
from diffbotctl.engine.clock import Clock
from diffbotctl.engine.driver import Delivery, RobotDriver
from diffbotctl.errors import Problem, RunError
from diffbotctl.links.diffbot_telemetry import RawEdge
from diffbotctl.messages import Battery, Duty, Encoders, Link, Message, Stop, Wheels
from diffbotctl.time import SECOND

COMMAND_PERIOD_NS = SECOND // 20  # six periods in the dead-man's time
FRAME_TIMEOUT_NS = SECOND // 2  # while moving; the link reports silence after 250 ms
CONNECT_TIMEOUT_NS = 20 * SECOND  # a board answers and takes its settings
STOP_TIMEOUT_NS = 3 * SECOND
STANDSTILL_TIME_NS = 3 * SECOND // 10  # without an edge: a wheel slower than 1 cm/s stands
NOISE_STOP_TIME_NS = SECOND  # a stop is taken as confirmed where counts cannot show it
NOISE_TEST_TIME_S = 1.0  # after a stop
NOISE_COUNTS_MIN = 5  # in that time; a wheel that coasts gives fewer
RATED_SPEED_RATIO_MAX = 1.6  # the robot file may state a rated speed that is too low by this
CAPTURE_TIME_S = 0.3  # the board starts to capture, or sends the remaining edges
TURN_LIMIT_MARGIN = 1  # count; the edge at which a wheel stood
KEY_STOP_FIX = "the robot was stopped; run the step again when you are ready"

WheelCommand = Duty | Wheels
DriverFactory = Callable[[RobotFile, RobotDriver | None, int], RobotDriver]
"""The driver for a changed robot file, from the file, the previous driver or None, and the time"""
Kind = TypeVar("Kind", bound=Message)


class KeyStopError(RunError):
    """A key was pressed while the robot moved; it has been stopped."""

    def __init__(self, cause: str) -> None:
        super().__init__(Problem("E-CALIBRATE-STOPPED", "calibrate", cause, KEY_STOP_FIX))


def stopped_error(cause: str, fix: str) -> RunError:
    return RunError(Problem("E-CALIBRATE-STOPPED", "calibrate", cause, fix))


class TurnLimit:
    """The number of turns by which a wheel may move away from its first position."""

    def __init__(self, turns: float) -> None:
        self.turns = turns
        self._start: tuple[int, int] | None = None

    def restart(self) -> None:
        self._start = None

    def check(self, frame: Encoders, robot: Robot) -> None:
        """Raises RunError if a wheel exceeds the limit."""
        counts = (frame.left, frame.right)
        self._start = self._start or counts
        sides = (robot.drive.left, robot.drive.right)
        for side, count, start in zip(sides, counts, self._start, strict=True):
            if abs(count - start) > self.turns * side.encoder.counts + TURN_LIMIT_MARGIN:
                cause = f"a wheel turned more than the announced {self.turns:g} turns"
                raise stopped_error(
                    cause, "is there noise on its encoder, or is the number of slots wrong?"
                )


class StopKey(Protocol):
    """A key press that stops the robot: `file` becomes readable, then `cause` is not None."""

    file: int

    @property
    def cause(self) -> str | None: ...


@runtime_checkable
class EdgeCapture(Protocol):
    """A driver, or the host half of its link, that captures every edge of both encoders."""

    @property
    def edges(self) -> list[Any]:
        """(time in ns, 0 left or 1 right, level after the edge); the reader clears the list."""

    def capture(self, now: int, on: bool) -> None:
        """Start or end the capture."""


class Received(NamedTuple):
    """The deliveries during one action."""

    deliveries: list[Delivery]

    def of(self, kind: type[Kind], wire: str = "") -> list[Kind]:
        """The messages of one class, in order; only those of `wire` if it is given."""
        return [
            delivery.message
            for delivery in self.deliveries
            if isinstance(delivery.message, kind) and wire in ("", delivery.wire)
        ]

    @property
    def encoders(self) -> list[Encoders]:
        return self.of(Encoders)

    @property
    def battery_volts(self) -> float | None:
        """The last battery voltage; None if the robot did not report one."""
        batteries = self.of(Battery)
        return batteries[-1].volts if batteries else None


class RobotSession:
    """The driver and the clock of one robot, whose robot file the calibration may change.

    A context manager: leaving it stops the robot and closes the driver.
    """

    def __init__(
        self,
        file: RobotFile,
        make_driver: DriverFactory,
        clock: Clock,
        key: StopKey | None = None,
        is_simulated: bool = True,
    ) -> None:
        self.file = file
        self.is_simulated = is_simulated
        self.clock = clock
        self.key = key
        self.now = 0
        self.encoders: Encoders | None = None
        self.frame_time = 0
        self.link: Link | None = None
        self.recording: list[Encoders] = []
        """all frames since it was last emptied"""
        self.turn_limit: TurnLimit | None = None
        """the last announced limit; None if there is none, or if counts are not reliable"""
        self.findings: dict[str, Finding] = {}
        """all findings of this session by field, whether they were written or not"""
        self.is_noisy = False
        """whether an encoder counts at standstill, so that counts do not show a stop"""
        self.standstill_counts = (0, 0)
        """counts of the left and right input in NOISE_TEST_TIME_S, with nothing turning"""
        self.stop_confirmed = False
        """after `close`: whether the board confirmed the stop"""
        self._make_driver = make_driver
        self.driver = make_driver(file, None, 0)

    def __enter__(self) -> RobotSession:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def try_findings(self, findings: Sequence[Finding]) -> None:
        """Continue with a robot file that contains these findings, without writing the file.

        The robot must be at rest. Raises ConfigurationError if a value is not plausible.
        """
        self.note_findings(findings)
        self.driver = self._make_driver(self.file, self.driver, self.now)
        self.encoders = self.link = None
        if self.turn_limit is not None:
            self.turn_limit.restart()  # a board that takes settings restarts its counts

    def note_findings(self, findings: Sequence[Finding]) -> None:
        """The same, but the board gets them only when the next driver connects to it."""
        self.findings.update({finding.field: finding for finding in findings})
        self.file = with_findings(self.file, list(self.findings.values()))

    def limit_turns(self, turns: float | None) -> None:
        """From now on each wheel may turn this far; None removes the limit."""
        self.turn_limit = None if turns is None else TurnLimit(turns)

    def connect(self) -> None:
        """Wait for frames and for a confirmed stop; from then on the board takes commands.

        Detects an encoder that counts at standstill. Raises RunError on a timeout.
        """
        self._wait_for_frame(CONNECT_TIMEOUT_NS)
        self.driver.stop(self.now)
        frames = self.listen(NOISE_TEST_TIME_S).encoders
        first, last = frames[0], frames[-1]
        self.standstill_counts = (abs(last.left - first.left), abs(last.right - first.right))
        self.is_noisy = max(self.standstill_counts) >= NOISE_COUNTS_MIN
        self.stop_and_wait()

    def latest_frame(self) -> Encoders:
        self.catch_up()
        assert self.encoders is not None
        return self.encoders

    def run_for(self, command: WheelCommand, seconds: float) -> Received:
        """Repeat a command for `seconds`. The robot continues to move afterwards.

        Raises RunError, with the robot stopped, on any trouble.
        """
        self.catch_up()
        received, end = Received([]), self.now + round(seconds * SECOND)
        try:
            while self.now < end:
                self.driver.command(self.now, command._replace(time=self.now))
                until = min(self.now + COMMAND_PERIOD_NS, end)
                while self.now < until:
                    self._collect(received, until, moving=True)
        except BaseException:
            self.driver.stop(self.now)
            raise
        return received

    def listen(self, seconds: float) -> Received:
        """Receive for `seconds` without sending a command."""
        self.catch_up()
        received, end = Received([]), self.now + round(seconds * SECOND)
        while self.now < end:
            self._collect(received, end, moving=False)
        return received

    def stop_and_wait(self) -> Received:
        """Stop, and wait until both wheels stand. Raises RunError if the stop is not confirmed."""
        self.driver.stop(self.now)
        received, begin, last_edge, counts = Received([]), self.now, self.now, None
        while not self._stands(begin, last_edge):
            if self.now - begin > STOP_TIMEOUT_NS:
                fix = "switch the motor battery off before you look for the cause"
                raise stopped_error("the board did not confirm that it has stopped", fix)
            self._collect(received, self.now + COMMAND_PERIOD_NS, moving=False)
            frame = self.encoders
            if frame is not None and counts != (frame.left, frame.right):
                counts, last_edge = (frame.left, frame.right), self.now
        return received

    def capture_edges(self, on: bool) -> list[RawEdge] | None:
        """Start or end the capture of every edge of both encoders, unfiltered.

        Returns the captured edges at the end; None for a board that cannot capture.
        """
        driver = self.driver  # some drivers leave it to the host half of their link
        candidates = [driver, getattr(driver, "host", None), getattr(driver, "protocol", None)]
        source = next((item for item in candidates if isinstance(item, EdgeCapture)), None)
        if source is None or self.file.robot.link.protocol == "rosserial":
            return None
        source.capture(self.now, on)
        self.listen(CAPTURE_TIME_S)
        # The simulated robot also reports the channel; edges of channel B are not used.
        edges = [RawEdge(*edge[:3]) for edge in source.edges if not any(edge[3:])]
        source.edges.clear()
        return edges

    def close(self) -> None:
        """Stop the robot and close the driver; `stop_confirmed` is the result."""
        self.key = None
        try:
            if self.encoders is not None:
                self.driver.stop(self.now)
                self.catch_up(STOP_TIMEOUT_NS)
                self.stop_and_wait()
            self.stop_confirmed = self.driver.stopped or self.encoders is None
        except RunError:
            self.stop_confirmed = False
        finally:
            self.driver.close()
            self.clock.close()

    def on_frame(self, now: int, frame: Encoders) -> None:
        self.encoders, self.frame_time = frame, now
        self.recording.append(frame)

    def catch_up(self, timeout: int = CONNECT_TIMEOUT_NS) -> None:
        """Receive what arrived while the program waited for input.

        Frames from that time must arrive before anything moves. Raises RunError if none does within
        `timeout` (ns).
        """
        self.now = max(self.now, self.clock.wait(self.now, [])[0])
        if self.encoders is None:
            self.connect()
        elif self.now - self.frame_time > FRAME_TIMEOUT_NS:
            self._wait_for_frame(timeout)
            self.stop_and_wait()

    def _wait_for_frame(self, timeout: int) -> None:
        """Wait for a frame over a link that is up. Raises RunError after `timeout` (ns)."""
        begin = self.now
        while self.encoders is None or self.frame_time <= begin or self._link_fault():
            if self.now - begin > timeout:
                cause = self._link_fault() or "no frames arrived"
                fix = "is the board switched on, and does `diffbotctl blink` work?"
                waited = f"the board was not ready within {timeout // SECOND} s"
                raise stopped_error(f"{waited}: {cause}", fix)
            self._receive(self.now + FRAME_TIMEOUT_NS)

    def _link_fault(self) -> str:
        """Why the link would not carry a command; empty if it would."""
        link = self.link
        return "" if link is None or link.state == "up" else link.cause or link.state

    def _stands(self, begin: int, last_edge: int) -> bool:
        frame = self.encoders
        if self.is_noisy and frame is not None:
            no_command = not frame.left_command and not frame.right_command and frame.time > begin
            return no_command and self.now - begin >= NOISE_STOP_TIME_NS
        return self.driver.stopped and self.now - last_edge >= STANDSTILL_TIME_NS

    def _collect(self, received: Received, until: int, moving: bool) -> None:
        """Receive once, and check for faults. Raises RunError."""
        deliveries = self._receive(until)
        received.deliveries.extend(deliveries)
        for _, message in deliveries:
            if isinstance(message, Stop) and message.code:
                fix = f"see `diffbotctl explain {message.code}`"
                raise stopped_error(f"the board stopped the motors: {message.cause}", fix)
            if isinstance(message, Link) and message.state == "lost":
                raise stopped_error("the link to the board was lost", "")
        if moving and self.now - self.frame_time > FRAME_TIMEOUT_NS:
            raise stopped_error("no frames from the board for half a second", "")
        if moving and self.turn_limit is not None and self.encoders is not None:
            self.turn_limit.check(self.encoders, self.file.robot)

    def _receive(self, until: int) -> list[Delivery]:
        """Wait for the next event, at most until `until`, and return the deliveries."""
        due = self.driver.due()
        files = self.driver.files()
        watched = files if self.key is None else [*files, self.key.file]
        now, ready = self.clock.wait(max(self.now, min(due, until)), watched)
        self.now = max(self.now, now)
        if self.key is not None and self.key.file in ready and self.key.cause:
            self.driver.stop(self.now)
            raise KeyStopError(self.key.cause)
        if due > self.now and set(ready).isdisjoint(files):
            return []
        deliveries = self.driver.deliver(self.now)
        for _, message in deliveries:
            if isinstance(message, Encoders):
                self.on_frame(self.now, message)
            elif isinstance(message, Link):
                self.link = message
        return deliveries


def drive_sides(robot: Robot) -> dict[str, SideSection]:
    return {"left": robot.drive.left, "right": robot.drive.right}
