"""Replaying a recording: the configuration and the inputs come from it, the blocks react again."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from typing import Any, NamedTuple

from diffbotctl import __version__
from diffbotctl.config.configuration import Configuration, SourceUse
from diffbotctl.drivers.virtual_sources import VirtualSources, open_virtual_sources
from diffbotctl.engine.clock import Clock, ScaledClock, VirtualClock
from diffbotctl.engine.driver import Driver
from diffbotctl.engine.live_changes import live_sinks
from diffbotctl.engine.loop import Engine, RunOutcome
from diffbotctl.errors import Problem, RunError, UserError
from diffbotctl.graph import Graph, Sink
from diffbotctl.message_types import type_name
from diffbotctl.messages import LogLevel
from diffbotctl.params import declared
from diffbotctl.printable import shortened
from diffbotctl.processes import screen
from diffbotctl.processes.child_process import wait_for_exit
from diffbotctl.processes.screen import RunSnapshot, ScreenFeed
from diffbotctl.recording.comparison import Difference, ReplayChecker
from diffbotctl.recording.digest import RunDigest
from diffbotctl.recording.metrics import Metrics, MetricsAccumulator, final_true_position
from diffbotctl.recording.reader import RecordedMessage, RecordingReader
from diffbotctl.recording.recorder import Recorder
from diffbotctl.recording.snapshot import StateError
from diffbotctl.recording.snapshot_restore import restore_snapshot
from diffbotctl.replay.recorded_run import (
    RecordedRun,
    ReplayDriver,
    read_run,
    recorded_configuration,
)
from diffbotctl.runs.build_graph import Assembly, assemble
from diffbotctl.runs.control_socket import RunControlSocket
from diffbotctl.runs.options import SocketOptions
from diffbotctl.runs.outputs import record_to
from diffbotctl.time import NEVER

Watch = Callable[[Graph, tuple[Any, ...]], None]
Show = Callable[[Iterator[RunSnapshot]], None]


class ReplayOptions(NamedTuple):
    """How to replay. Times are ns of the recorded run.

    `speed` is a multiple of real time, None as fast as possible. Before `begin` the replay always
    runs as fast as possible, so that the blocks are in the recorded state at `begin`; the metrics
    count from there. `sets` change the recorded configuration. `record` is the file to which the
    replay is recorded. `show` draws it; with `dash` it is the dashboard, connected to a control
    socket of the replay. `watch` is called with the graph and each of its instants.
    """

    check: bool = False
    speed: float | None = None
    begin: int = 0
    until: int = NEVER
    sets: tuple[str, ...] = ()
    record: Path | None = None
    show: Show | None = None
    dash: bool = False
    watch: Watch | None = None


class ReplayResult(NamedTuple):
    """Result of a replay.

    `compared` counts messages; `difference` is the first one, or None. `left_out` counts the
    messages on wires that the recording does not have, `text_differences` those in which another
    version worded a log line or a cause differently. `version` is the recording's. `failure` is the
    error that ended the replay, such as a block that raised; None when it came to its end.
    """

    ending: RunOutcome
    digest: str
    compared: int
    difference: Difference | None
    version: str
    metrics: Metrics
    begins: str
    left_out: Mapping[str, int] = {}
    text_differences: int = 0
    failure: UserError | None = None


def replay(path: Path, check: bool = False) -> ReplayResult:
    """Replay the recording at `path`; `check` compares every message with the recorded one.

    Raises RunError for a file that is not a recording, or one that is incomplete and to be checked.
    """
    return replay_run(read_run(path), ReplayOptions(check=check))


def replay_run(run: RecordedRun, options: ReplayOptions) -> ReplayResult:
    """Replay with the recorded motion: the drivers deliver what they did, the blocks react again.

    Raises RunError when it cannot be checked or begun, ConfigurationError for a wrong `sets`.
    """
    if options.check:
        _require_checkable(run)
    with recorded_configuration(run.path, run.about, options.sets) as configuration:
        if options.dash and configuration.robots:
            cause, fix = "the dashboard shows one robot; here are several", "replay without --dash"
            raise RunError(Problem("E-SEVERAL-ROBOTS", str(run.path), cause, fix))
        return _ReplayRun(run, options, configuration).go()


class _ReplayRun:
    """One replay with its engine, recorder, screen and control socket."""

    def __init__(
        self, run: RecordedRun, options: ReplayOptions, configuration: Configuration
    ) -> None:
        self.run, self.options = run, options
        self.assembly: Assembly = assemble(configuration, run.real)
        graph = self.assembly.graph
        self.graph: Graph = graph
        self.start = 0 if run.state is None else run.state[0]
        self.digest = RunDigest(graph.kinds)
        self.checker = ReplayChecker(
            graph.kinds,
            run.wires,
            RecordingReader(run.path).messages(),
            texts_may_differ=run.about.get("version") != __version__,
        )
        self.metrics = MetricsAccumulator()
        self.children: list[int] = []
        self.screen = self._start_screen()
        self.recorder = self._start_recorder(configuration)
        self.control_socket: RunControlSocket | None = None
        if options.dash:
            self.control_socket = RunControlSocket(
                SocketOptions(),
                configuration,
                self.assembly,
                run.about["port"],
                is_replay=True,
                is_paced=False,
            )
        self.computed = self._start_computed(configuration)
        self.recomputed = {
            wire for use in self._computed_uses(configuration) for wire in use.outputs
        }
        drivers: list[Driver] = [ReplayDriver(self._inputs())]
        self.engine = Engine(
            graph,
            drivers if self.computed is None else [*drivers, self.computed],
            self._clock(),
            sinks=self._sinks(),
            record=self._record,
            idle=self._idle,
        )
        if run.state is not None:
            _restore_state(run.path, run.state, self.engine, options.sets)

    def go(self) -> ReplayResult:
        outcome = self._run_engine()
        if self.options.check:
            self.checker.finish()
        self._close(outcome)
        if self.recorder is not None and self.recorder.lost is not None:
            raise recording_lost(self.options.record, self.recorder.lost)
        failure = self.engine.failure
        is_complete = self.options.until > self.run.last and failure is None
        return ReplayResult(
            outcome,
            self.digest.text(),
            self.checker.compared,
            self.checker.difference,
            self.run.about.get("version", ""),
            self.metrics.metrics(final_true_position(self.run.end) if is_complete else None),
            self.run.begins,
            self.checker.left_out,
            self.checker.text_differences,
            failure,
        )

    def _run_engine(self) -> RunOutcome:
        try:
            return self.engine.run(min(self.run.last + 1, self.options.until, NEVER))
        except UserError:
            raise
        except Exception as error:
            if self.run.state is None:
                raise
            raise _wrong_state(self.run.path, f"it leads to a {type(error).__name__}") from error

    def _start_screen(self) -> ScreenFeed | None:
        if self.options.show is None:
            return None
        channel, pid = screen.start_screen(
            self.options.show, self.options.dash, is_paced=self.options.speed is not None
        )
        self.children.append(pid)
        goals = len(self.run.goals())
        return ScreenFeed(channel, lambda: (len(self.metrics.reached), goals))

    def _start_recorder(self, configuration: Configuration) -> Recorder | None:
        if self.options.record is None:
            return None
        sets = json.dumps(configuration.settings)
        facts = {**self.run.about, "replayed": str(self.run.path), "sets": sets}
        facts.pop("flight", None)  # this recording has the blocks' messages too
        path = self.options.record

        def end(cause: str) -> None:
            """A recorder that fails ends the replay: no robot depends on it."""
            self.engine.end(1, cause)

        recorder, pid = record_to(path, configuration, self.assembly, facts, True, end)
        self.children.append(pid)
        return recorder

    def _computed_uses(self, configuration: Configuration) -> list[SourceUse]:
        """The sources that compute again: those that only compute, where something was changed."""
        sources = configuration.sources if self.options.sets else ()
        return [use for use in sources if use.cls.virtual_delay is not None]

    def _start_computed(self, configuration: Configuration) -> VirtualSources | None:
        def fail(now: int, level: LogLevel, source: str, text: str) -> None:
            raise RunError(Problem("E-DEVICE", source, text, "replay it without --set"))

        return open_virtual_sources(self._computed_uses(configuration), fail, True)

    def _inputs(self) -> Iterator[RecordedMessage]:
        """The recorded messages after the state in which the replay begins."""
        first = -1 if self.run.state is None else self.start
        for item in RecordingReader(self.run.path, self.graph.kinds).messages():
            if item.from_driver and self.graph.kinds.get(item.wire) is not type(item.message):
                names = (item.wire, type_name(type(item.message)))
                cause = f"its pipeline has no input {' for '.join(map(shortened, names))}"
                raise RunError(Problem("E-RECORDING", str(self.run.path), cause))
            if item.time > first and item.wire not in self.recomputed:
                yield item

    def _clock(self) -> Clock:
        if self.options.speed is None:
            return VirtualClock()
        return ScaledClock(self.options.speed, max(self.options.begin, self.start))

    def _sinks(self) -> dict[str, list[Sink]]:
        sinks = {wire: [sink] for wire, sink in live_sinks(self.graph).items()}
        for wire, sink in () if self.computed is None else self.computed.sinks():
            sinks.setdefault(wire, []).append(sink)
        if self.screen is not None:
            for wire in self.graph.wires:
                sinks.setdefault(wire, []).append(self.screen.sink(wire))
        return sinks

    def _record(self, instant: tuple[Any, ...]) -> None:
        self.digest.record(instant)
        if self.options.watch is not None:
            self.options.watch(self.graph, instant)
        if self.options.check:
            self.checker.record(instant)
        if self.recorder is not None:
            self.recorder.record(instant)
        if self.control_socket is not None:
            self.control_socket.channel.record(instant)
        for wire, message in zip(self.graph.wires, instant[1:], strict=True):
            if message is not None:
                self.metrics.take(instant[0], wire, message)
        if instant[0] < self.options.begin:
            self.metrics.forget()

    def _idle(self) -> None:
        if self.recorder is not None:
            self.recorder.drain()
        if self.control_socket is not None:
            self.control_socket.channel.flush()
        if self.screen is not None and self.engine.last_instant >= self.options.begin:
            self.screen.idle(self.engine.last_instant)

    def _close(self, outcome: RunOutcome) -> None:
        if self.screen is not None:
            last = max(self.engine.last_instant, 0)
            self.screen.finish(last, outcome.cause, outcome.code != 0)
        if self.recorder is not None:
            end = {**(self.run.end or {}), "last": str(self.engine.last_instant)}
            end.update({"code": str(outcome.code), "digest": self.digest.text()})
            self.recorder.close(end)
        self.engine.clock.close()
        if self.computed is not None:
            self.computed.close()
        if self.control_socket is not None:
            self.control_socket.channel.close()
            self.control_socket.end()
        for pid in self.children:
            wait_for_exit(pid)


def _restore_state(
    path: Path, state: tuple[int, bytes], engine: Engine, sets: tuple[str, ...]
) -> None:
    """Begin with the state in the recording; the parameters in `sets` keep their new values."""
    overrides = _block_parameters(engine.graph, sets)
    time, data = state
    try:
        restore_snapshot(data, time, engine)
    except StateError as error:
        raise _wrong_state(path, str(error)) from error
    for block, name, value in overrides:
        if not declared(type(block))[name].live:
            cause = f"{name} of {type(block).__name__} cannot change after the start of a run, and "
            cause += "this recording begins later"
            raise RunError(Problem("E-RECORDING", str(path), cause, "set a live parameter"))
        setattr(block, name, value)
        block.changed(name)
    engine.last_instant = time


def _wrong_state(path: Path, reason: str) -> RunError:
    cause = f"the state at its beginning cannot be used: {reason}"
    fix = "`diffbotctl bag export` shows the messages in it"
    return RunError(Problem("E-RECORDING", str(path), cause, fix))


def _block_parameters(graph: Graph, sets: tuple[str, ...]) -> list[tuple[Any, str, Any]]:
    """(block, attribute, value) for each of `sets` that names a block's parameter."""
    blocks = {node.name: node.block for node in graph.nodes}
    parameters = []
    for text in sets:
        block_name, _, key = text.partition("=")[0].strip().rpartition(".")
        block = blocks.get(block_name)
        for name, declaration in declared(type(block)).items() if block is not None else ():
            if key == (declaration.key or name):
                parameters.append((block, name, getattr(block, name)))
    return parameters


def _require_checkable(run: RecordedRun) -> None:
    if run.is_black_box:
        cause = "a black box file contains only inputs: there are no messages of blocks to compare"
        raise RunError(Problem("E-RECORDING", str(run.path), cause, "replay it without --check"))
    if run.end is None:
        cause = "the recording is incomplete: it was cut, or the disk was full"
        fix = "replay it without --check, up to where it ends"
        raise RunError(Problem("E-RECORDING-CUT", str(run.path), cause, fix))


def recording_lost(path: Path | None, cause: str) -> RunError:
    """The error of a replay whose recording at `path` is incomplete."""
    return RunError(Problem("E-RECORD", str(path), f"cannot record there: {cause}"))
