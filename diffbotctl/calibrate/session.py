"""How far a wheel may turn: what was announced, and the error when it does not keep to it.

What arrived from a robot under calibration, and the keys that stop it.

The robot under calibration: moved directly, without blocks, and stopped by any trouble.

Commands are repeated while they hold, so that the board's dead-man's time never runs out on
purpose and always does when this program dies. A key, a link that falls silent, a board that stops
by itself, or a wheel beyond what was announced end the step and the movement.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any, NamedTuple, Protocol, TypeVar

from diffbotctl.calibrate.result import Finding
from diffbotctl.calibrate.robot_file import with_findings
from diffbotctl.config.configuration import RobotFile
from diffbotctl.config.robot import Robot
from diffbotctl.engine.clock import Clock
from diffbotctl.engine.driver import Delivery, RobotDriver
from diffbotctl.errors import Problem, RunError
from diffbotctl.links.diffbot_telemetry import RawEdge
from diffbotctl.messages import Duty, Encoders, Link, Message, Stop, Wheels
from diffbotctl.time import SECOND

COUNT_MARGIN = 1  # count; the edge that a wheel stood on


class TurnLimit:
    """Turns that either wheel may be from where it began."""

    def __init__(self, turns: float) -> None:
        self.turns = turns
        self._from: tuple[int, int] | None = None

    def begin(self) -> None:
        """Counts start anew with the next frame."""
        self._from = None

    def check(self, frame: Encoders, robot: Robot) -> None:
        """Raises RunError when a wheel is beyond."""
        if self._from is None:
            self._from = (frame.left, frame.right)
        drive = robot.drive
        for side, count, begun in zip(
            (drive.left, drive.right), (frame.left, frame.right), self._from, strict=True
        ):
            if abs(count - begun) > self.turns * side.encoder.slots + COUNT_MARGIN:
                cause = f"a wheel turned more than the {self.turns:g} turns that were announced"
                raise stopped_error(cause, "noise on its encoder, or a wrong count of slots?")


def stopped_error(cause: str, fix: str) -> RunError:
    """What to raise when the robot had to be stopped."""
    return RunError(Problem("E-CALIBRATE-STOPPED", "calibrate", cause, fix))


Kind = TypeVar("Kind", bound=Message)


class StopKey(Protocol):
    """Ends a movement when a person wants it: `file` is readable, `cause` says why."""

    file: int

    @property
    def cause(self) -> str | None: ...


class Received(NamedTuple):
    """What arrived while something was done."""

    deliveries: list[Delivery]

    def of(self, kind: type[Kind], wire: str = "") -> list[Kind]:
        """The messages of one class, in order; of one wire, when it is named."""
        return [
            each.message
            for each in self.deliveries
            if isinstance(each.message, kind) and wire in ("", each.wire)
        ]

    @property
    def encoders(self) -> list[Encoders]:
        """All frames."""
        return self.of(Encoders)


COMMAND_PERIOD_NS = (
    SECOND // 20
)  # ns between two sendings of a command that holds: six to a dead-man's time
FRAME_TIMEOUT_NS = (
    SECOND // 2
)  # ns without a frame while moving; the host itself notices after 250 ms
CONNECT_TIMEOUT_NS = 20 * SECOND  # ns until a board must have answered and taken its settings
STOP_TIMEOUT_NS = 3 * SECOND  # ns until a stop must have shown
STANDSTILL_TIME_NS = 3 * SECOND // 10  # ns without an edge: a wheel slower than 1 cm/s is at rest

NOISE_TEST_TIME_S = 1.0  # s of listening, after a stop, for inputs that count by themselves
CAPTURE_TIME_S = 0.3  # s until the board has heard of it, or has told the rest
KEY_STOP_FIX = "the robot was stopped; run the step again when you like"
NOISE_COUNTS_MIN = 5  # counts in that time; a wheel that rolls out gives fewer

WheelCommand = Duty | Wheels
DriverFactory = Callable[[RobotFile, RobotDriver | None, int], RobotDriver]


class Capturing(Protocol):
    """A robot, or the host half of its link, that gathers the flanks of both encoders."""

    @property
    def edges(self) -> list[Any]:
        """(time in ns, 0 left or 1 right, level after the flank), until they are taken"""

    def capture(self, now: int, on: bool) -> None:
        """Begin or end to."""


def _capturing(driver: RobotDriver) -> Capturing | None:
    found: list[Any] = [driver, getattr(driver, "host", None), getattr(driver, "protocol", None)]
    for each in found:
        if hasattr(each, "capture"):
            capturing: Capturing = each
            return capturing
    return None


class RobotSession:
    """A robot's driver and its clock, for one robot file that calibration may change.

    `make` makes the driver anew when the file has changed, on the same robot: it is handed the
    file, the driver before or None, and the time.
    """

    def __init__(
        self,
        file: RobotFile,
        make: DriverFactory,
        clock: Clock,
        keys: StopKey | None = None,
    ) -> None:
        self.file = file
        self.clock = clock
        self.keys = keys
        self.now = 0
        self.encoders: Encoders | None = None
        self.heard_at = 0
        self.link: Link | None = None
        self.recording: list[Encoders] = []
        """all frames since it was last emptied"""
        self.bound: TurnLimit | None = None
        """what was announced last; None: nothing that could be watched"""
        self.found: dict[str, Finding] = {}
        """what this calibration has found so far, whether it was written or not"""
        self.noisy = False
        """whether an encoder counts while nothing turns, so that counts do not show a stop"""
        self.still = (0, 0)
        """what the left and right input counted in QUIET, with nothing turning"""
        self._make = make
        self.driver = make(file, None, 0)

    def refit(self, file: RobotFile) -> None:
        """Go on with what the robot file says now. The robot must be at rest."""
        self.file = file
        self.driver = self._make(file, self.driver, self.now)
        self.encoders = self.link = None
        if self.bound is not None:
            self.bound.begin()  # a board that takes settings counts anew

    def attempt(self, findings: Sequence[Finding]) -> None:
        """Go on with a robot file that has these findings in it, though nothing is written yet.

        Raises ConfigurationError when a value is not plausible.
        """
        self.found.update({finding.field: finding for finding in findings})
        self.refit(with_findings(self.file, list(self.found.values())))

    def allow(self, turns: float | None) -> None:
        """What was announced: from here on either wheel may turn so far."""
        self.bound = None if turns is None else TurnLimit(turns)

    def meet(self) -> None:
        """Wait until frames come and a stop has shown: from then on commands are taken.

        An encoder that counts while nothing turns is noticed on the way. Raises RunError when
        that does not come about.
        """
        self._hear()
        self.driver.stop(self.now)
        self.still = self._counts_in(self.listen(NOISE_TEST_TIME_S).encoders)
        self.noisy = any(count >= NOISE_COUNTS_MIN for count in self.still)
        self.rest()

    def _hear(self) -> None:
        """Wait for a frame over a link that is up. Raises RunError when none comes."""
        begun = self.now
        while self.encoders is None or self.heard_at <= begun or self._link_trouble():
            if self.now - begun > CONNECT_TIMEOUT_NS:
                cause = self._link_trouble() or "no frames came"
                fix = "is it switched on, and does `diffbotctl blink` work?"
                raise stopped_error(f"the board was not ready within 20 s: {cause}", fix)
            self._turn(self.now + FRAME_TIMEOUT_NS)

    def _link_trouble(self) -> str:
        """Why no command would be taken, as far as the link tells."""
        link = self.link
        return "" if link is None or link.state == "up" else link.cause or link.state

    def _counts_in(self, frames: list[Encoders]) -> tuple[int, int]:
        first, last = frames[0], frames[-1]
        return abs(last.left - first.left), abs(last.right - first.right)

    def latest(self) -> Encoders:
        """The last frame; one of now is waited for."""
        self.awake()
        assert self.encoders is not None
        return self.encoders

    def hold(self, wanted: WheelCommand, seconds: float) -> Received:
        """Keep a command for so long, and return what arrived. The robot goes on moving after it.

        Raises RunError, with the robot stopped, on any trouble.
        """
        return self.follow(lambda _: wanted, seconds)

    def follow(self, wanted: Callable[[float], WheelCommand], seconds: float) -> Received:
        """As `hold`, with a command for each moment: `wanted` is handed seconds since the start."""
        self.awake()
        begun, heard = self.now, Received([])
        end = begun + round(seconds * SECOND)
        try:
            while self.now < end:
                command = wanted((self.now - begun) / SECOND)
                self.driver.command(self.now, command._replace(time=self.now))
                until = min(self.now + COMMAND_PERIOD_NS, end)
                while self.now < until:
                    self._take(heard, self._turn(until), moving=True)
        except BaseException:
            self.driver.stop(self.now)
            raise
        return heard

    def listen(self, seconds: float) -> Received:
        """Let time pass without a command, and return what arrived."""
        self.awake()
        heard, end = Received([]), self.now + round(seconds * SECOND)
        while self.now < end:
            self._take(heard, self._turn(end), moving=False)
        return heard

    def rest(self) -> Received:
        """Stop, and wait until both wheels stand. Raises RunError when the stop does not show."""
        self.driver.stop(self.now)
        heard, begun, still, counts = Received([]), self.now, self.now, None
        while not self._rests(begun, still):
            if self.now - begun > STOP_TIMEOUT_NS:
                fix = "switch the motors' battery off before you look for the cause"
                raise stopped_error("the board did not confirm that it has stopped", fix)
            self._take(heard, self._turn(self.now + COMMAND_PERIOD_NS), moving=False)
            last = self.encoders
            if last is not None and counts != (last.left, last.right):
                counts, still = (last.left, last.right), self.now
        return heard

    def _rests(self, begun: int, still: int) -> bool:
        last = self.encoders
        if self.noisy and last is not None:
            told = not last.left_command and not last.right_command and last.time > begun
            return told and self.now - begun >= SECOND
        return self.driver.stopped and self.now - still >= STANDSTILL_TIME_NS

    def capture(self, on: bool) -> list[RawEdge] | None:
        """Begin or end to gather every flank of both encoders, unfiltered.

        At the end, what was gathered; None for a board that cannot tell.
        """
        host = _capturing(self.driver)
        if host is None or self.file.robot.link.protocol == "rosserial":
            return None
        host.capture(self.now, on)
        self.listen(CAPTURE_TIME_S)
        found = [RawEdge(*each) for each in host.edges]
        host.edges.clear()
        return found

    def close(self) -> bool:
        """Stop and let go. False when the board did not confirm the stop."""
        self.keys = None
        try:
            if self.encoders is not None:
                self.rest()
            return self.driver.stopped or self.encoders is None
        except RunError:
            return False
        finally:
            self.driver.close()
            self.clock.close()

    def note(self, now: int, frame: Encoders) -> None:
        """A frame has arrived."""
        self.encoders, self.heard_at = frame, now
        self.recording.append(frame)

    def awake(self) -> None:
        """While a person was asked, nobody listened and time went by: catch up with both.

        What counted meanwhile is heard before anything moves. Raises RunError when nothing is.
        """
        self.now = max(self.now, self.clock.wait(self.now, [])[0])
        if self.encoders is None:
            self.meet()
        elif self.now - self.heard_at > FRAME_TIMEOUT_NS:
            self._hear()
            self.rest()

    def _take(self, heard: Received, deliveries: list[Delivery], moving: bool) -> None:
        heard.deliveries.extend(deliveries)
        for _, message in deliveries:
            if isinstance(message, Stop) and message.code:
                fix = f"`diffbotctl explain {message.code}` tells more"
                raise stopped_error(f"the board stopped the motors: {message.cause}", fix)
            if isinstance(message, Link) and message.state == "lost":
                raise stopped_error("the link to the board was lost", "")
        if moving and self.now - self.heard_at > FRAME_TIMEOUT_NS:
            raise stopped_error("no frames from the board for half a second", "")
        if moving and self.bound is not None and self.encoders is not None:
            self.bound.check(self.encoders, self.file.robot)

    def _turn(self, until: int) -> list[Delivery]:
        """Wait for the next thing, not after `until`, and hear it."""
        due = self.driver.due()
        files = self.driver.files()
        asked = files if self.keys is None else [*files, self.keys.file]
        now, ready = self.clock.wait(max(self.now, min(due, until)), asked)
        self.now = max(self.now, now)
        if self.keys is not None and self.keys.file in ready and self.keys.cause:
            self.driver.stop(self.now)
            raise stopped_error(self.keys.cause, KEY_STOP_FIX)
        if due > self.now and set(ready).isdisjoint(files):
            return []
        deliveries = self.driver.deliver(self.now)
        for _, message in deliveries:
            if isinstance(message, Encoders):
                self.note(self.now, message)
            elif isinstance(message, Link):
                self.link = message
        return deliveries
