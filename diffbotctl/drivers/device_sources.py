"""The sources of a pipeline: devices of this computer, each read by its driver.

A driver of another package runs in the engine, so what it returns is checked as what blocks return,
and whatever it raises ends no run: the device counts as lost. Its messages expire at once, and the
device is opened again after a growing time.
"""

from __future__ import annotations

import errno
import os
import select
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import suppress
from types import MappingProxyType
from typing import Any

from diffbotctl.config.configuration import SourceUse
from diffbotctl.device import DeviceDriver, DeviceError, Reading
from diffbotctl.drivers.goal_queue import Operator
from diffbotctl.drivers.input_leases import InputLeases
from diffbotctl.engine.driver import Delivery
from diffbotctl.engine.output_check import OutputError, check_message
from diffbotctl.errors import Problem, RunError, join_words
from diffbotctl.log import INFO, Log
from diffbotctl.messages import LOG_LEVELS, STARTING, LogLevel, Stop
from diffbotctl.time import MILLISECOND, NEVER, SECOND

BACK_OFF_S = (0.5, 1.0, 2.0, 4.0)  # before each attempt to open a lost device again
SILENCE_MAX = SECOND  # or four times its timeout, if that is longer
READ_MAX = 20 * MILLISECOND  # a longer `read` delays the commands to the robot
SLOW_READS_REPORTED_MAX = 3
READINGS_PER_SECOND_MAX = 1000
CHECK_CABLE = "check its plug, cable and power"
MISSING_FIX = "plug it in, or correct its path"


class DeviceSource:
    """One device as the engine sees it. Times are in ns."""

    def __init__(self, use: SourceUse, kinds: Mapping[str, type]) -> None:
        """`kinds`: the message class of each wire."""
        self.use = use
        self.driver: DeviceDriver = use.cls(**use.values)
        self.lines: list[tuple[int, str, str]] = []  # that the driver has logged
        self.driver.log = Log(use.name, self.lines, INFO)
        self.kinds = {wire.rpartition(".")[2]: kind for wire, kind in use.outputs.items()}
        self.driver.outputs = self.kinds
        self.driver.inputs = {port: kinds[wire] for port, wire in use.wires.items()}
        self.pending: dict[str, tuple[int, Any]] = {}  # the newest message of each input
        self.has_worked = False
        self.is_open = False
        self.is_starting = False  # opened, and nothing has come yet
        self.file: int | None = None
        self.poll_due = NEVER
        self.silent_at = NEVER
        self.retry_at = NEVER
        self.attempts = 0
        self.slow_reads = 0
        self.window = self.window_readings = 0
        self.last_cause = ""

    @property
    def who(self) -> str:
        """The source and its device, as errors and stops name it."""
        device = self.driver.device_name()
        who = f"{self.use.what} {self.use.name}"
        return f"{who} ({device})" if device else who

    def open(self, now: int) -> None:
        """Open the device. Raises DeviceError."""
        try:
            file = self.driver.open()
            if file is not None:
                _require_events(file)
        except OSError as error:
            raise DeviceError(_os_cause(error), _os_fix(error)) from error
        self.file = file
        self.is_open = True
        self.is_starting = not self.driver.is_on_demand
        self.poll_due = NEVER if self.driver.poll_period is None else now
        self._expect(now, round(self.driver.start_timeout * SECOND))

    def read(self, now: int) -> list[Reading]:
        """What the driver has read, checked. Raises DeviceError when the device is lost."""
        before = time.monotonic_ns()
        try:
            read = list(self.driver.read(now))
        except OSError as error:
            raise DeviceError(_os_cause(error), CHECK_CABLE) from error
        self._check_duration(time.monotonic_ns() - before)
        readings = [self._checked(now, reading) for reading in read]
        if now - self.window > SECOND:
            self.window, self.window_readings = now, 0
        self.window_readings += len(readings)
        if self.window_readings > READINGS_PER_SECOND_MAX:
            cause = f"more than {READINGS_PER_SECOND_MAX} messages came in a second"
            raise DeviceError(cause, "correct the driver")
        if self.driver.poll_period is not None and now >= self.poll_due:
            self.poll_due = now + max(round(self.driver.poll_period * SECOND), MILLISECOND)
        if readings:
            self.is_starting, self.has_worked = False, True
            self._expect(now, max(SILENCE_MAX, round(4 * self.use.timeout * SECOND)))
            self.attempts = 0
        elif now >= self.silent_at:
            raise DeviceError("nothing comes from it", CHECK_CABLE)
        return readings

    def sink(self, port: str) -> Callable[[int, Any], None]:
        """What takes the messages of an input; a newer one replaces one that was not sent."""

        def take(now: int, message: Any) -> None:
            self.pending[port] = (now, message)

        return take

    def write(self) -> None:
        """Send what is pending; drop it while the device is closed. Raises DeviceError."""
        pending, self.pending = self.pending, {}
        for port, (now, message) in pending.items() if self.is_open else ():
            try:
                self.driver.write(now, port, message)
            except OSError as error:
                raise DeviceError(_os_cause(error), CHECK_CABLE) from error

    def close(self) -> None:
        """Close the device, whatever its driver does."""
        self.pending.clear()
        self.is_open, self.is_starting, self.file = False, False, None
        self.poll_due = self.silent_at = NEVER
        with suppress(Exception):
            self.driver.close()

    def _expect(self, now: int, timeout: int) -> None:
        self.silent_at = NEVER if self.driver.is_on_demand else now + timeout

    def _check_duration(self, duration: int) -> None:
        if duration > READ_MAX and self.slow_reads < SLOW_READS_REPORTED_MAX:
            self.slow_reads += 1
            text = f"its driver took {duration / MILLISECOND:.0f} ms to read; it must not wait"
            self.driver.log.warning(text)

    def _checked(self, now: int, reading: Reading) -> Reading:
        """`reading` with plain numbers. Raises DeviceError when it does not fit."""
        port, message = reading
        if port not in self.kinds:
            cause = f"its driver has no output '{port}'; it has {', '.join(self.kinds)}"
            raise DeviceError(cause, "correct the driver")
        if message is None:
            return reading
        try:
            message = check_message(port, self.kinds[port], message)
        except OutputError as error:
            raise DeviceError(str(error), "correct the driver") from None
        if not 0 <= message.time <= now:
            cause = f"output {port}: the time {message.time} ns is not between 0 and {now} ns"
            raise DeviceError(cause, "correct the driver: `now`, or earlier")
        return Reading(port, message)


def _require_events(file: int) -> None:
    """Raise DeviceError unless the loop can wait for data of this file; OSError if it is closed."""
    with select.epoll() as poll:
        try:
            poll.register(file)
        except PermissionError as error:  # a folder, a plain file, or a device such as /dev/null
            raise DeviceError("it is no device that sends data", "correct its path") from error


class DeviceSourcesDriver:
    """A driver with all devices of a pipeline."""

    def __init__(
        self,
        uses: Sequence[SourceUse],
        inputs: InputLeases,
        operator: Operator,
        kinds: Mapping[str, type] = MappingProxyType({}),
    ) -> None:
        """Open all devices. `kinds`: the message class of each wire.

        Raises RunError with every device that cannot be opened.
        """
        self.sources = [DeviceSource(use, kinds) for use in uses]
        self.inputs = inputs
        self.operator = operator
        self.waits_for = ""  # what the robot was last reported to wait for
        problems = [problem for source in self.sources if (problem := _open_problem(source))]
        if problems:
            self.close()
            raise RunError(*problems)

    def sinks(self) -> Iterator[tuple[str, Callable[[int, Any], None]]]:
        """The wires that devices take, and what takes their messages."""
        for source in self.sources:
            for port, wire in source.use.wires.items():
                yield wire, source.sink(port)

    def idle(self, now: int) -> None:
        """Send the messages of the inputs, after the command to the robot has left."""
        for source in self.sources:
            if source.pending:
                try:
                    source.write()
                except DeviceError as error:
                    self._lose(now, source, error)
                except Exception as error:
                    self._lose(now, source, _defect(error))

    def due(self) -> int:
        """When a device is polled, counts as silent, or is opened again; or the wait changes."""
        if self._starting() != self.waits_for:
            return 0
        return min(min(each.poll_due, each.silent_at, each.retry_at) for each in self.sources)

    def files(self) -> list[int]:
        return [source.file for source in self.sources if source.file is not None]

    def deliver(self, now: int) -> list[Delivery]:
        """What the devices have sent; a lost one is opened again when that is due."""
        deliveries: list[Delivery] = []
        for source in self.sources:
            if now >= source.retry_at:
                self._reopen(now, source)
            if source.is_open:
                deliveries += self._read(now, source)
            for level, name, text in source.lines:
                self._log(now, LOG_LEVELS[level], name, text)
            source.lines.clear()
        return deliveries + self._wait(now)

    def _starting(self) -> str:
        """The open devices that have sent nothing yet and on which the motion depends."""
        leases = self.inputs.leases
        return join_words(
            [
                source.who
                for source in self.sources
                if source.is_starting
                and any(leases[wire].use.feeds_motion for wire in source.use.outputs)
            ],
            "and",
        )

    def _wait(self, now: int) -> list[Delivery]:
        """The stop until all devices on which the motion depends have begun, or its end."""
        waits_for = self._starting()
        if waits_for == self.waits_for:
            return []
        self.waits_for = waits_for
        cause = f"{waits_for} starts, and has sent nothing yet" if waits_for else ""
        stop = Stop(now, STARTING if waits_for else "", cause, False)
        return [Delivery("operator.wait", stop)]

    def close(self) -> None:
        for source in self.sources:
            source.close()

    def _read(self, now: int, source: DeviceSource) -> list[Delivery]:
        try:
            readings = source.read(now)
        except DeviceError as error:
            self._lose(now, source, error)
            return []
        except Exception as error:
            self._lose(now, source, _defect(error))
            return []
        deliveries = []
        for port, message in readings:
            wire = source.use.wire(port)
            if message is None:
                self.inputs.release(wire, source.use.name)
            else:
                self.inputs.renew(now, wire, source.use.name, source.who)
                deliveries.append(Delivery(wire, message))
        return deliveries

    def _lose(self, now: int, source: DeviceSource, error: DeviceError) -> None:
        """The messages of a lost device expire at once."""
        source.close()
        cause = f"{source.who}: {error.cause}"
        if error.is_final and not source.has_worked and not source.attempts:
            raise RunError(Problem("E-DEVICE", source.use.place, cause, error.fix))
        if not (error.is_final and error.cause == source.last_cause):
            self._log(now, "error", source.use.name, f"{cause}; {error.fix}")
        self.inputs.end(now, source.use.name, cause, source.use.outputs)
        self._retry_later(now, source, error.cause)

    def _reopen(self, now: int, source: DeviceSource) -> None:
        source.retry_at = NEVER
        try:
            source.open(now)
        except DeviceError as error:
            failure = error
        except Exception as error:
            failure = _defect(error)
        else:
            self._log(now, "info", source.use.name, f"{source.who}: opened again")
            return
        source.close()
        if failure.cause != source.last_cause:
            text = f"{source.who}: {failure.cause}; {failure.fix}"
            self._log(now, "error", source.use.name, text)
        self._retry_later(now, source, failure.cause)

    def _retry_later(self, now: int, source: DeviceSource, cause: str) -> None:
        wait = BACK_OFF_S[min(source.attempts, len(BACK_OFF_S) - 1)]
        source.attempts += 1
        source.retry_at, source.last_cause = now + round(wait * SECOND), cause

    def _log(self, now: int, level: LogLevel, name: str, text: str) -> None:
        self.operator.log(now, level, name, text)


def open_sources(
    uses: Sequence[SourceUse],
    inputs: InputLeases,
    operator: Operator,
    kinds: Mapping[str, type],
) -> DeviceSourcesDriver | None:
    """The driver of all devices of a pipeline; None without one. Raises RunError."""
    return DeviceSourcesDriver(uses, inputs, operator, kinds) if uses else None


def _open_problem(source: DeviceSource) -> Problem | None:
    try:
        source.open(0)
    except DeviceError as error:
        failure = error
    except Exception as error:
        failure = _defect(error)
    else:
        return None
    return Problem("E-DEVICE", source.use.place, f"{source.who}: {failure.cause}", failure.fix)


def _defect(error: Exception) -> DeviceError:
    cause = f"its driver raised {type(error).__name__}: {error}"
    return DeviceError(cause, "correct the driver")


def _os_cause(error: OSError) -> str:
    if error.errno in (errno.EIO, errno.ENODEV, errno.ENXIO):
        return "it has disconnected"
    return os.strerror(error.errno) if error.errno else str(error)


def _os_fix(error: OSError) -> str:
    if isinstance(error, PermissionError):
        return "join the group that owns it, then log out and in: ls -l shows it"
    return MISSING_FIX
