"""The engine: one loop that waits for drivers and timers, and runs the instants of the graph.

Before messages are delivered at time t, each timer that is due before t fires at its nominal time;
a timer that is due at t fires in the same instant as the messages. Each instant is later than the
previous one. If two messages for one wire arrive together, the second one is delivered one
nanosecond later.
"""

import gc
import sys
from collections.abc import Callable, Iterable
from dataclasses import replace
from functools import partial
from typing import Any, NamedTuple, Protocol

from diffbotctl.engine.clock import Clock
from diffbotctl.engine.driver import Delivery, Driver, RobotDriver
from diffbotctl.engine.event_log import event_logger
from diffbotctl.engine.instant_monitor import InstantLimits, InstantMonitor
from diffbotctl.engine.live_changes import ChangeError
from diffbotctl.engine.output_check import OWN_PACKAGE, OutputError, checked
from diffbotctl.errors import Problem, RunError, join_words, place_in_code, place_of_function
from diffbotctl.graph import Graph, Sink
from diffbotctl.message_types import type_name
from diffbotctl.messages import LogLine
from diffbotctl.time import NEVER, SECOND

INTERRUPTED = 130  # exit code after SIGINT, as in shells
# New objects after which garbage is collected in a run that follows no clock. Messages that wait
# for a file are no garbage, but would be searched for it again and again: 5 % of the time.
GARBAGE_THRESHOLD = 20_000
STOP_TIMEOUT = 2 * SECOND  # for the confirmation of the final stop


class SignalSource(Protocol):
    """Receives signals. `file` is readable when `cause` has been set."""

    file: int

    @property
    def cause(self) -> str | None:
        """Why the run has to end; None until there is a reason."""


class RunOutcome(NamedTuple):
    """How a run ended.

    `code` is the exit code. `stopped`: whether the robot confirmed its stop; None without a robot.
    `time` is the logical time at which the run ended, or of the last instant if that was later.
    """

    code: int
    cause: str
    stopped: bool | None
    time: int


class Engine:
    """Runs a graph with its drivers and a clock. `run` stops the robot before it returns.

    `record` is called with each instant as one tuple, `idle` after each step, when all commands of
    the instant have been sent. `limits`: of the time that an instant may take; an engine without
    them does not look at it. `is_driving`: whether the command in force moves the robot. `overruns`
    counts, for each block, the timer firings that were late by more than the timer's period.
    """

    def __init__(
        self,
        graph: Graph,
        drivers: list[Driver],
        clock: Clock,
        *,
        robot: RobotDriver | None = None,
        sinks: dict[str, list[Sink]] | None = None,
        record: Callable[[tuple[Any, ...]], object] | None = None,
        idle: Callable[[], None] | None = None,
        signals: SignalSource | None = None,
        limits: InstantLimits | None = None,
        is_driving: Callable[[], bool] = lambda: True,
    ) -> None:
        self.graph = graph
        self.drivers = drivers
        self.clock = clock
        self.robot = robot
        self.record = record
        self.idle = idle
        self.wire_places = {wire: i for i, wire in enumerate(graph.sources)}
        self.no_messages: list[Any] = [None] * len(graph.sources)
        self.sinks = {wire: _fan_out(wire_sinks) for wire, wire_sinks in (sinks or {}).items()}
        self.event_logger = event_logger(graph)
        listeners = {} if self.event_logger is None else self.event_logger.sinks()
        self.compiled = graph.compile(self.sinks, record, listeners)
        self.monitor = None if limits is None else InstantMonitor(limits, is_driving)
        self._wrap_reactions()
        self.last_instant = -1
        self.end_time = 0
        self.ending: tuple[int, str] | None = None
        self.failure: RunError | None = None
        self.signals = signals
        self.driver_files: list[list[int]] = []
        self.files = self._all_files([])  # that are waited for
        self.overruns: dict[str, int] = {}
        periods = [period for _, period in self.compiled.timer_owners]
        self.overrun_tolerance = min(periods, default=NEVER)

    def end(self, code: int, cause: str) -> None:
        """End the loop after this instant. Only the first call has an effect."""
        if self.ending is None:
            self.ending = (code, cause)

    def run(self, until: int = NEVER, limit_code: Callable[[], int] | None = None) -> RunOutcome:
        """Run until `end` is called or logical time reaches `until`, then stop the robot.

        `limit_code` gives the exit code of a run that `until` ended; without it, 0.
        """
        gc.collect()
        gc.freeze()  # these objects live until the end; exclude them from garbage collection
        thresholds = gc.get_threshold()
        if self.monitor is None:
            gc.set_threshold(GARBAGE_THRESHOLD, *thresholds[1:])
        try:
            while self.ending is None and self.step(until):
                pass
        except RunError as failure:
            self.failure = failure
            first = failure.problems[0]
            self.end(1, f"{first.place}: {first.cause}")
        except BaseException as error:
            self.end(1, f"{type(error).__name__}: {error}")
            self._stop()
            raise
        finally:
            gc.unfreeze()
            gc.set_threshold(*thresholds)
            if self.monitor is not None:
                self.monitor.close()
        if self.ending is None:
            self.end(
                limit_code() if limit_code else 0, f"time limit of {until / SECOND:g} s reached"
            )
        stopped = self._stop()
        assert self.ending is not None
        code, cause = self.ending
        return RunOutcome(code, cause, stopped, max(self.last_instant, self.end_time))

    def step(self, until: int) -> bool:
        """Wait for the next event and process it. False when logical time has reached `until`."""
        dues = [driver.due() for driver in self.drivers]
        files = [driver.files() for driver in self.drivers]
        wake = min(self.compiled.due(), until, *dues)
        if files != self.driver_files:
            self.driver_files, self.files = files, self._all_files(files)
        now, ready = self.clock.wait(wake, self.files)
        if self.monitor is not None:
            self._check_time(self.monitor)
        if self.clock.late > self.overrun_tolerance:
            self._count_overruns(now, wake + self.clock.late)
        if self.signals is not None and self.signals.cause:
            self.end_time = min(now, until)
            self.end(INTERRUPTED, self.signals.cause)
            return False
        if now >= until:
            self.end_time = until
            self._catch_up(until)
            return False
        deliveries: list[Delivery] = []
        for driver, due, its_files in zip(self.drivers, dues, files, strict=True):
            if due <= now or (ready and its_files and not set(ready).isdisjoint(its_files)):
                deliveries += driver.deliver(now)
        if deliveries:
            self.deliver(now, deliveries)
        else:
            self._catch_up(now + 1)
        if self.monitor is not None and self.monitor.events:
            self._deliver_events(self.monitor)
        if self.idle is not None:
            self.idle()
        return True

    @property
    def stop_waits(self) -> bool:
        """True when an instant took so long that its commands are no longer valid."""
        return self.monitor is not None and self.monitor.stops

    def _wrap_reactions(self) -> None:
        """Have the outputs of all blocks checked, and their time if it is limited."""
        for node in self.graph.nodes:
            react: Callable[..., Any] = node.block.react
            if self.monitor is not None:
                react = self.monitor.timed(node.name, react)
            replace = partial(self.compiled.replace, node.name)
            self.compiled.swap(node.name, checked(node.block, react, replace))

    def _check_time(self, monitor: InstantMonitor) -> None:
        """Check the step before, and the wake-up of this one; a stop precedes what was due."""
        monitor.check_step(self.clock.busy)
        monitor.check_wake_up(self.clock.overslept)
        monitor.begin()
        if monitor.events:
            self._deliver_events(monitor)

    def _deliver_events(self, monitor: InstantMonitor) -> None:
        """Deliver what the monitor reports, right after the last instant."""
        now = self.last_instant + 1
        events = [
            Delivery(place, message._replace(time=now))
            for wire, message in monitor.take_events()
            for place in self._wires_of_all(wire, message)
        ]
        if events:
            self.deliver(now, events)

    def _wires_of_all(self, wire: str, message: Any) -> list[str]:
        """Where `wire` leads to: every robot of several gets a stop, one log a line."""
        wires = [f"{name}.{wire}" for name in self.graph.parts] or [wire]
        known = [wire for wire in wires if wire in self.wire_places]
        return known[:1] if isinstance(message, LogLine) else known

    def _count_overruns(self, now: int, actual: int) -> None:
        """Count the firings due by `now` that are more than a period late at `actual`."""
        due = self.compiled.timers()
        for (name, period), at in zip(self.compiled.timer_owners, due, strict=True):
            firings = range(at, min(now + 1, actual - period), period)
            if firings:
                self.overruns[name] = self.overruns.get(name, 0) + len(firings)

    def deliver(self, now: int, deliveries: Iterable[Delivery]) -> None:
        """Run the instant at `now`, and further ones if a wire has several messages."""
        now = max(now, self.last_instant + 1)
        values = self.no_messages.copy()
        for wire, message in deliveries:
            place = self.wire_places[wire]
            if values[place] is not None:
                self._instant(now, values)
                now, values = now + 1, self.no_messages.copy()
            values[place] = message
        self._instant(now, values)

    def _catch_up(self, before: int) -> None:
        """Fire each timer that is due earlier than `before` at its nominal time."""
        while (due := self.compiled.due()) < before:
            self._react(due, self.no_messages)

    def _instant(self, now: int, values: list[Any]) -> None:
        self._catch_up(now)
        self._react(now, values)

    def _react(self, now: int, values: list[Any]) -> None:
        self.last_instant = now
        try:
            self.compiled.instant(now, *values)
        except (Exception, SystemExit) as error:
            self._report_block_error(now, values, error)

    def _report_block_error(self, now: int, values: list[Any], error: BaseException) -> None:
        name = self.compiled.culprit(error)
        if isinstance(error, ChangeError):
            name, error = error.block, error.__cause__ or error
        if name is None:
            raise error
        if self.record is not None:
            blank = [None] * (len(self.graph.wires) - len(values))
            self.record((now, *values, *blank))
        block = self.graph.block(name)
        problem = block_problem(name, type(block), error)
        fix = problem.fix
        if isinstance(error, OutputError):
            problem = replace(problem, code="E-BLOCK-OUTPUT")
            fix = "correct what `react` returns"
        if self.robot is not None:  # a replay has none
            fix = f"the robot was stopped; {fix}"
        # Without the name of the file, which may be another one in a replay.
        line = f" (line {problem.line})" if problem.line else ""
        block.log.error(f"{problem.cause}{line}")
        self.compiled.publish(now)
        raise RunError(replace(problem, fix=fix)) from error

    def _all_files(self, of_drivers: list[list[int]]) -> list[int]:
        files = [file for files in of_drivers for file in files]
        return files if self.signals is None else [*files, self.signals.file]

    def _stop(self) -> bool | None:
        """Stop the robot and wait for the confirmation. None without a robot, False on timeout."""
        if self.robot is None:
            return None
        try:
            return self._stop_robot(self.robot)
        except RunError as failure:  # the robot is out of reach
            self.failure = self.failure or failure
            return False

    def _stop_robot(self, robot: RobotDriver) -> bool:
        now, _ = self.clock.wait(max(self.last_instant, 0), [])
        robot.stop(now)
        deadline = now + STOP_TIMEOUT
        while now < deadline and not robot.stopped:
            now, _ = self.clock.wait(min(deadline, robot.due()), robot.files())
            deliveries = robot.deliver(now)
            if deliveries and self.failure is None:
                self._deliver_final_telemetry(now, deliveries)
        return robot.stopped

    def _deliver_final_telemetry(self, now: int, deliveries: list[Delivery]) -> None:
        """Deliver the telemetry of the stopping robot to the graph; its commands are not sent."""
        try:
            self.deliver(now, deliveries)
        except RunError as failure:
            self.failure = failure


def block_problem(name: str, kind: type, error: BaseException) -> Problem:
    """What the block `name` of this class raised, at its line in a file of the user's."""
    is_output = isinstance(error, OutputError)
    cause = str(error) if is_output else f"it raised {type(error).__name__}: {error}"
    place = None
    if not kind.__module__.startswith(OWN_PACKAGE):
        file = getattr(sys.modules.get(kind.__module__), "__file__", None) or ""
        place = place_in_code(error, file)
        if place is None and is_output:
            place = place_of_function(kind.react, file)  # type: ignore[attr-defined]
    if place is None:
        fix = "run it again with --debug to see where in the block"
        return Problem("E-BLOCK-RAISED", f"block {name}", cause, fix)
    fix = "correct the block"
    if isinstance(error, AttributeError) and isinstance(error.obj, kind):
        fix = f"create `self.{error.name}` in `def reset(self):`"
    elif isinstance(error, AttributeError) and hasattr(error.obj, "_fields"):
        known = type_name(type(error.obj))
        fix = f"the fields of {known} are {join_words(error.obj._fields, 'and')}"
        fix += f"; `diffbotctl types {known}` explains them"
    return Problem("E-BLOCK-RAISED", place, f"block {name}: {cause}", fix)


def _fan_out(sinks: list[Sink]) -> Sink:
    if len(sinks) == 1:
        return sinks[0]

    def call_all(now: int, message: Any) -> None:
        for sink in sinks:
            sink(now, message)

    return call_all
